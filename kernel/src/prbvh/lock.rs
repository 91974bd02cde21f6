//! PRBVH lock: every input node claims the nodes that its reinsertion would change.
//!
//! Source: Meister & Bittner 2018, §4.3.1 (topological conflicts) and §5 "Lock nodes", aggressive strategy. Kind: scatter: a maximum does
//! not depend on the order. Reads `nodes[2n-1]`, `found`; raises `locks[2n-1]`, which starts as 0 (free).
//!
//! Two forms with the same winners: one 64-bit word per node ([`lock`]); where a device has no 64-bit atomics, the area decreases
//! first ([`lock_decrease`]), then the inputs among the holders of the largest one ([`lock_input`]).

use super::{PrbvhParams, Reinsertion, TopologyNodes, lock_key};
use crate::mem::{AtomicU32, AtomicU64};
use crate::node::{NO_NODE, Node};

/// Invocation `i` claims with a 64-bit key.
#[inline(always)]
pub fn lock(i: u32, params: &PrbvhParams, nodes: &[Node], found: &[Reinsertion], locks: &[AtomicU64]) {
    let Reinsertion { area_decrease, input, output } = found[i as usize];
    if output != NO_NODE {
        let key = lock_key(area_decrease, input);
        TopologyNodes::of(nodes, params.nodes / 2, input, output).for_each(|v| locks[v].max(key));
    }
}

/// Invocation `i` claims with the bits of its area decrease: the upper words of the keys.
#[inline(always)]
pub fn lock_decrease(i: u32, params: &PrbvhParams, nodes: &[Node], found: &[Reinsertion], decreases: &[AtomicU32]) {
    let Reinsertion { area_decrease, input, output } = found[i as usize];
    if output != NO_NODE {
        let key = area_decrease.to_bits();
        TopologyNodes::of(nodes, params.nodes / 2, input, output).for_each(|v| decreases[v].max(key));
    }
}

/// Invocation `i` claims with its input node where its area decrease is the largest: the lower words of the keys.
#[inline(always)]
pub fn lock_input(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Reinsertion],
    decreases: &[u32],
    inputs: &[AtomicU32],
) {
    let Reinsertion { area_decrease, input, output } = found[i as usize];
    if output != NO_NODE {
        let key = area_decrease.to_bits();
        TopologyNodes::of(nodes, params.nodes / 2, input, output).for_each(move |v| {
            if decreases[v] == key {
                inputs[v].max(input);
            }
        });
    }
}

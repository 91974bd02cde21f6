//! PRBVH check: a reinsertion stays only if it owns every node that it claimed.
//!
//! Source: Meister & Bittner 2018, §5 "Check locks". Kind: map: invocation `i` reads `nodes[2n-1]` and the locks, and clears `found[i]` of a
//! loser. The globally largest key wins all of its nodes, so something moves whenever something was found.

use super::{PrbvhParams, Reinsertion, TopologyNodes, lock_key};
use crate::mem::{AtomicU32, Slot};
use crate::node::{NO_NODE, Node};
use crate::status::OWNED;

/// Invocation `i` checks 64-bit locks.
#[inline(always)]
pub fn check(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    locks: &[u64],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
) {
    check_with(i, params, nodes, found, report, |v, decrease, input| locks[v] == lock_key(decrease, input));
}

/// Invocation `i` checks locks of two 32-bit words.
#[inline(always)]
pub fn check_words(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    decreases: &[u32],
    inputs: &[u32],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
) {
    check_with(i, params, nodes, found, report, |v, decrease, input| {
        decreases[v] == decrease.to_bits() && inputs[v] == input
    });
}

#[inline(always)]
fn check_with(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
    owns: impl Fn(usize, f32, u32) -> bool,
) {
    let Reinsertion { area_decrease, input, output } = found[i as usize].get();
    if output != NO_NODE {
        if TopologyNodes::of(nodes, params.nodes / 2, input, output).all(|v| owns(v, area_decrease, input)) {
            report[OWNED].add(1);
        } else {
            found[i as usize].set(Reinsertion::NONE);
        }
    }
}

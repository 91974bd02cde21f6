//! PRBVH lock, conservative strategy: every input node claims its [`Footprint`].
//!
//! Kind: scatter: a maximum does not depend on the order. Reads `nodes[2n-1]`, `found`, `tops`; raises `locks[2n-1]`, which starts as 0
//! (free). Two forms with the same winners, as in [`crate::prbvh::lock`]; the lower word is a [`claim`].

use super::{Footprint, claim};
use crate::mem::{AtomicU32, AtomicU64};
use crate::node::{NO_NODE, Node};
use crate::prbvh::{PrbvhParams, Reinsertion, lock_key};

/// Invocation `i` claims with a 64-bit key.
#[inline(always)]
pub fn lock(i: u32, params: &PrbvhParams, nodes: &[Node], found: &[Reinsertion], tops: &[u32], locks: &[AtomicU64]) {
    let area_decrease = found[i as usize].area_decrease;
    for_each(i, params, nodes, found, tops, |v, claim| locks[v].max(lock_key(area_decrease, claim)));
}

/// Invocation `i` claims with the bits of its area decrease: the upper words of the keys.
#[inline(always)]
pub fn lock_decrease(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Reinsertion],
    tops: &[u32],
    decreases: &[AtomicU32],
) {
    let key = found[i as usize].area_decrease.to_bits();
    for_each(i, params, nodes, found, tops, |v, _| decreases[v].max(key));
}

/// Invocation `i` claims where its area decrease is the largest: the lower words of the keys.
#[inline(always)]
pub fn lock_input(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Reinsertion],
    tops: &[u32],
    decreases: &[u32],
    inputs: &[AtomicU32],
) {
    let key = found[i as usize].area_decrease.to_bits();
    for_each(i, params, nodes, found, tops, move |v, claim| {
        if decreases[v] == key {
            inputs[v].max(claim);
        }
    });
}

/// Calls `raise` with every node of invocation `i` and its claim on it.
#[inline(always)]
fn for_each(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Reinsertion],
    tops: &[u32],
    raise: impl Fn(usize, u32),
) {
    let Reinsertion { input, output, .. } = found[i as usize];
    if output != NO_NODE {
        let footprint = Footprint { internal: params.nodes / 2, input, output, top: tops[i as usize] };
        footprint.for_each(nodes, move |v, written| raise(v as usize, claim(input, written)));
    }
}

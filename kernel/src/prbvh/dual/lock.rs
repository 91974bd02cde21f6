//! Lock of the dual reinsertions: every input node claims its [`DualNodes`].
//!
//! Kind: scatter: a maximum does not depend on the order. Reads `nodes[2n-1]`, `found`, `seconds`; raises `locks[2n-1]`, which starts as 0
//! (free). Two forms with the same winners, as in [`crate::prbvh::lock`].

use super::{DualMove, DualNodes, is_move};
use crate::mem::{AtomicU32, AtomicU64};
use crate::node::Node;
use crate::prbvh::{PrbvhParams, Reinsertion, lock_key};

/// Invocation `i` claims with a 64-bit key.
#[inline(always)]
pub fn lock(i: u32, params: &PrbvhParams, nodes: &[Node], found: &[Reinsertion], seconds: &[u32], locks: &[AtomicU64]) {
    let key = lock_key(found[i as usize].area_decrease, params.input(i));
    for_each(i, params, nodes, found, seconds, |v| locks[v].max(key));
}

/// Invocation `i` claims with the bits of its area decrease: the upper words of the keys.
#[inline(always)]
pub fn lock_decrease(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Reinsertion],
    seconds: &[u32],
    decreases: &[AtomicU32],
) {
    let key = found[i as usize].area_decrease.to_bits();
    for_each(i, params, nodes, found, seconds, |v| decreases[v].max(key));
}

/// Invocation `i` claims with its input node where its area decrease is the largest: the lower words of the keys.
#[inline(always)]
pub fn lock_input(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Reinsertion],
    seconds: &[u32],
    decreases: &[u32],
    inputs: &[AtomicU32],
) {
    let key = found[i as usize].area_decrease.to_bits();
    let input = params.input(i);
    for_each(i, params, nodes, found, seconds, move |v| {
        if decreases[v] == key {
            inputs[v].max(input);
        }
    });
}

/// Calls `raise` with every node of invocation `i`.
#[inline(always)]
fn for_each(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Reinsertion],
    seconds: &[u32],
    raise: impl Fn(usize),
) {
    let found = found[i as usize];
    if is_move(found) {
        let dual = DualMove::new(nodes, params.input(i), found, seconds[i as usize]);
        DualNodes::of(nodes, &dual).for_each(raise);
    }
}

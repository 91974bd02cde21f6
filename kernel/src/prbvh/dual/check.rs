//! Check of the dual reinsertions: one stays only if it owns every node that it claimed.
//!
//! Kind: map: invocation `i` reads `nodes[2n-1]`, `seconds` and the locks, and clears `found[i]` of a loser. The globally largest key wins all of
//! its nodes, so something moves whenever something was found.

use super::{DualMove, DualNodes, is_move};
use crate::mem::{AtomicU32, Slot};
use crate::node::Node;
use crate::prbvh::{PrbvhParams, Reinsertion, lock_key};
use crate::status::OWNED;

/// Invocation `i` checks 64-bit locks.
#[inline(always)]
pub fn check(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    seconds: &[u32],
    locks: &[u64],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
) {
    check_with(i, params, nodes, seconds, found, report, |v, decrease, input| locks[v] == lock_key(decrease, input));
}

/// Invocation `i` checks locks of two 32-bit words.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn check_words(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    seconds: &[u32],
    decreases: &[u32],
    inputs: &[u32],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
) {
    check_with(i, params, nodes, seconds, found, report, move |v, decrease, input| {
        decreases[v] == decrease.to_bits() && inputs[v] == input
    });
}

#[inline(always)]
fn check_with(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    seconds: &[u32],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
    owns: impl Fn(usize, f32, u32) -> bool,
) {
    let candidate = found[i as usize].get();
    if is_move(candidate) {
        let input = params.input(i);
        let dual = DualMove::new(nodes, input, candidate, seconds[i as usize]);
        if DualNodes::of(nodes, &dual).all(move |v| owns(v, candidate.area_decrease, input)) {
            report[OWNED].add(1);
        } else {
            found[i as usize].set(Reinsertion::NONE);
        }
    }
}

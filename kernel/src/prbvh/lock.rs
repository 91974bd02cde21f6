//! Lock: every move claims its nodes.
//!
//! Source: Meister & Bittner 2018, §4.3.1 (topological conflicts) and §5 "Lock nodes". Kind: scatter: a maximum does not depend on the order. Reads
//! `nodes[2n-1]`, `found`; raises `locks[2n-1]`, where 0 is free.
//!
//! Two forms with the same winners: one 64-bit word per node ([`lock`]); where a device has no 64-bit atomics, the area decreases
//! first, then the claims among the holders of the largest one ([`lock_words`], twice).

use super::conservative::Footprint;
use super::{CONSERVATIVE, DUAL, LAST, Move, MoveNodes, PrbvhParams, ROUNDS, SECOND_WORD};
use crate::mem::{AtomicU32, AtomicU64, Slot};
use crate::node::{Node, WholeNodes};

/// Lower word of a lock: the input node, and whether it writes the node or only reads it.
#[inline(always)]
#[must_use]
pub fn claim(input: u32, written: bool) -> u32 {
    // Node indices have 31 bits.
    input << 1 | written as u32
}

/// Bits of the area decrease above the claim: larger decreases win a lock, then larger indices. Only positive decreases order like their bits.
#[inline(always)]
#[must_use]
pub fn lock_key(area_decrease: f32, claim: u32) -> u64 {
    ((area_decrease.to_bits() as u64) << 32) | claim as u64
}

/// Lock of a node that a move of an earlier round of locks has won: above all keys.
pub const TAKEN: u64 = u64::MAX;
/// Each word of [`TAKEN`].
pub const TAKEN_WORD: u32 = u32::MAX;

/// Whether `holds(v, written)` is true of every node `v` that `found` writes or reads; asks all of them.
#[inline(always)]
pub(super) fn all_nodes<T: WholeNodes + ?Sized>(
    params: &PrbvhParams,
    nodes: &T,
    found: &Move,
    holds: impl Fn(usize, bool) -> bool + Copy,
) -> bool {
    let internal = params.nodes / 2;
    let mut all = MoveNodes::of(nodes, internal, found, params.has(DUAL)).all(|v| holds(v, true));
    if params.has(CONSERVATIVE) {
        all &= Footprint::of(found).all(nodes, holds);
    }
    all
}

/// Invocation `i` claims with a 64-bit key.
#[inline(always)]
pub fn lock<T: WholeNodes + ?Sized>(
    i: u32,
    params: &PrbvhParams,
    nodes: &T,
    found: &[Slot<Move>],
    locks: &[AtomicU64],
) {
    let own = found[i as usize].get();
    if own.is_open() {
        if is_out(params, nodes, &own, |v| locks[v].load() == TAKEN) {
            found[i as usize].set(Move::NONE);
        } else {
            all_nodes(params, nodes, &own, move |v, written| {
                locks[v].max(lock_key(own.area_decrease, claim(own.input, written)));
                true
            });
        }
    }
}

/// Invocation `i` claims with the bits of its area decrease, the upper words of the keys, or with [`SECOND_WORD`] with its claim where its decrease is the
/// largest.
#[inline(always)]
pub fn lock_words(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Slot<Move>],
    decreases: &[AtomicU32],
    claims: &[AtomicU32],
) {
    let own = found[i as usize].get();
    if own.is_open() {
        let key = own.area_decrease.to_bits();
        if params.has(SECOND_WORD) {
            all_nodes(params, nodes, &own, move |v, written| {
                if decreases[v].load() == key {
                    claims[v].max(claim(own.input, written));
                }
                true
            });
        } else if is_out(params, nodes, &own, move |v| decreases[v].load() == TAKEN_WORD) {
            found[i as usize].set(Move::NONE);
        } else {
            all_nodes(params, nodes, &own, move |v, _| {
                decreases[v].max(key);
                true
            });
        }
    }
}

/// Whether the move meets a node that another has won.
#[inline(always)]
fn is_out<T: WholeNodes + ?Sized>(
    params: &PrbvhParams,
    nodes: &T,
    own: &Move,
    is_taken: impl Fn(usize) -> bool + Copy,
) -> bool {
    params.has(ROUNDS) && !all_nodes(params, nodes, own, move |v, _| !is_taken(v))
}

/// What the check leaves in the locks.
#[inline(always)]
pub(super) fn takes(params: &PrbvhParams) -> bool {
    params.has(ROUNDS) && !params.has(LAST)
}

//! Check: a move wins if it owns every node that it claimed.
//!
//! Source: Meister & Bittner 2018, §5 "Check locks". Kind: map: invocation `i` reads `nodes[2n-1]` and marks `found[i]` of a winner. The largest key of
//! all wins, so something moves whenever something was found.
//!
//! With several rounds of locks it is a scatter, too: a holder takes its nodes or lets go of them, and nobody else writes them. Whether others see
//! that in this dispatch or not, they see a key that is not theirs.

use super::lock::{TAKEN, TAKEN_WORD, all_nodes, claim, lock_key, takes};
use super::{CONSERVATIVE, LAST, Move, PrbvhParams, ROUNDS, WON};
use crate::mem::{AtomicU32, AtomicU64, Slot};
use crate::node::{Node, WholeNodes};
use crate::status::{self, OWNED, PREDICTED};
use crate::sum::Sum;

/// Invocation `i` checks 64-bit locks.
#[inline(always)]
pub fn check<T: WholeNodes + ?Sized>(
    i: u32,
    params: &PrbvhParams,
    nodes: &T,
    locks: &[AtomicU64],
    found: &[Slot<Move>],
    report: &[AtomicU32],
) {
    let own = found[i as usize].get();
    if own.is_open() {
        let key = lock_key(own.area_decrease, claim(own.input, true));
        let wins = if params.has(CONSERVATIVE) {
            all_nodes(params, nodes, &own, move |v, written| {
                let lock = locks[v].load();
                holds((lock >> 32) as u32, lock as u32, &own, written)
            })
        } else {
            all_nodes(params, nodes, &own, move |v, _| locks[v].load() == key)
        };
        if wins {
            win(i, params, &own, found, report);
        }
        if params.has(ROUNDS) {
            let left = if wins && takes(params) { TAKEN } else { 0 };
            all_nodes(params, nodes, &own, move |v, _| {
                if locks[v].load() == key {
                    locks[v].store(left);
                }
                true
            });
        }
    } else if own.has_won() && params.has(LAST) {
        all_nodes(params, nodes, &own, move |v, _| {
            locks[v].store(0);
            true
        });
    }
}

/// Invocation `i` checks locks of two 32-bit words.
#[inline(always)]
pub fn check_words(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    decreases: &[AtomicU32],
    claims: &[AtomicU32],
    found: &[Slot<Move>],
    report: &[AtomicU32],
) {
    let own = found[i as usize].get();
    if own.is_open() {
        let wins = all_nodes(params, nodes, &own, move |v, written| {
            holds(decreases[v].load(), claims[v].load(), &own, written)
        });
        if wins {
            win(i, params, &own, found, report);
        }
        if params.has(ROUNDS) {
            let left = if wins && takes(params) { TAKEN_WORD } else { 0 };
            all_nodes(params, nodes, &own, move |v, _| {
                if claims[v].load() == claim(own.input, true) && decreases[v].load() == own.area_decrease.to_bits() {
                    claims[v].store(left);
                    decreases[v].store(left);
                }
                true
            });
        }
    } else if own.has_won() && params.has(LAST) {
        all_nodes(params, nodes, &own, move |v, _| {
            claims[v].store(0);
            decreases[v].store(0);
            true
        });
    }
}

/// Whether a lock of these two words leaves the node to the move: it is its own, or both only read.
#[inline(always)]
fn holds(decrease: u32, held: u32, own: &Move, written: bool) -> bool {
    let is_own = decrease == own.area_decrease.to_bits() && (held | 1) == claim(own.input, true);
    is_own || (!written && held & 1 == 0)
}

#[inline(always)]
fn win(i: u32, params: &PrbvhParams, own: &Move, found: &[Slot<Move>], report: &[AtomicU32]) {
    found[i as usize].set(Move { input: own.input | WON, ..*own });
    status::count(report, params.row, OWNED, 1);
    Sum::of(own.area_decrease, params.scale).add_to(report, params.row as usize + PREDICTED);
}

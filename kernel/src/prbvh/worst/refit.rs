//! Boxes and keys of the nodes above what moved.
//!
//! Kind: the climbs of [`super::super::paths`].

use super::books::{FRINGE_LENGTH, FRINGE_SIDE, POOL_LENGTH, POOL_SIDE, UNFOLDS};
use super::keys::{COLD, IN_POOL, ON_FRINGE, STALE, fresh, measure, measure_of, push, waits};
use crate::mem::{AtomicU32, Slot};
use crate::node::{AtomicNode, Links, NO_NODE, ROOT};
use crate::prbvh::{Move, PrbvhParams, paths};

/// Invocation `i` marks the ways up from the move `found[i]`, and sees to it that the nodes whose children changed get new keys. Those at which nobody has
/// looked go on the fringe, and so do their children: the walk that would have come by may not find them any more. (A child may be one whose children
/// another move changed. Whoever comes first puts it on the fringe, once, and it gets a new key either way.) Reads `nodes[2n-1]` and `found`; raises
/// `ways[n-1]`; writes `keys[n-1]` and `fringe[2(n-1)]`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn mark<T: Links + ?Sized>(
    i: u32,
    params: &PrbvhParams,
    found: &[Slot<Move>],
    nodes: &T,
    ways: &[AtomicU32],
    keys: &[AtomicU32],
    fringe: &[AtomicU32],
    books: &[AtomicU32],
    report: &[AtomicU32],
) {
    let own = found[i as usize].get();
    if own.has_won() {
        let places = params.nodes / 2;
        let side = books[FRINGE_SIDE].load() ^ books[UNFOLDS].load();
        let length = &books[FRINGE_LENGTH + side as usize];
        let changed = [own.output, own.other, own.input(), nodes.parent(own.other), nodes.parent(own.input())];
        for k in 0..5u32 {
            let v = changed[k as usize];
            if v != NO_NODE {
                if keys[v as usize].load() & IN_POOL != 0 {
                    keys[v as usize].store(STALE | IN_POOL);
                } else if keys[v as usize].swap(STALE) == COLD {
                    push(fringe, places, side, length, v);
                }
                let left = nodes.down(v);
                let right = nodes.up(left);
                for side_of in 0..2u32 {
                    let child = if side_of == 0 { left } else { right };
                    if child < places
                        && keys[child as usize].load() == COLD
                        && keys[child as usize].swap(ON_FRINGE) == COLD
                    {
                        push(fringe, places, side, length, child);
                    }
                }
            }
        }
        paths::mark(i, params, found, nodes, ways, report);
    }
}

/// Invocation `i` climbs from the ends of the move `found[i]` and recomputes boxes and keys; sums up how the areas change. Reads and writes `nodes[2n-1]`,
/// `keys[n-1]`, `pool[2(n-1)]`; lowers `ways[n-1]` to 0.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn refit(
    i: u32,
    params: &PrbvhParams,
    found: &[Slot<Move>],
    nodes: &[AtomicNode],
    ways: &[AtomicU32],
    keys: &[AtomicU32],
    pool: &[AtomicU32],
    books: &[AtomicU32],
    report: &[AtomicU32],
) {
    let places = params.nodes / 2;
    let side = books[POOL_SIDE].load();
    let length = &books[POOL_LENGTH + side as usize];
    paths::refit(i, params, found, nodes, ways, report, |v, area, left, right| {
        if v != ROOT {
            let old_key = keys[v as usize].load();
            let new_measure = measure(area, left.half_area(), right.half_area());
            if measure_of(old_key) != new_measure {
                let mut key = fresh(new_measure) | (old_key & IN_POOL);
                if waits(key) && old_key & IN_POOL == 0 {
                    key |= IN_POOL;
                    push(pool, places, side, length, v);
                }
                keys[v as usize].store(key);
            }
        }
    });
}

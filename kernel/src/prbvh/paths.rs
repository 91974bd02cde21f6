//! Refit: boxes of the nodes above what moved, and of no others.
//!
//! Source: Meister & Bittner 2018, §5 "Recompute bounding boxes", which recomputes all. Kind: climbs from the ends of every move, the
//! node that lost leaves and those that gained some. The first ([`mark`]) counts how many ways lead into each node; only the first to come
//! goes on, so a node above many moves is passed once. The second ([`refit`]) counts down; the last to come completes the node and goes
//! on, as in [`climb`](mod@crate::climb), after both of its children. All counts are 0 again at the end if the links are a tree: in a
//! loop every node waits for another one.

use super::{Move, PrbvhParams};
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{AtomicNode, Links, NO_NODE};
use crate::status::{self, GREW, MARKED, REFITTED, SHRUNK};
use crate::sum::Sum;

/// Invocation `i` climbs from the ends of the move `found[i]`, if it was made. Reads `nodes[2n-1]`, raises `ways[n-1]`, which starts as 0. Reports how
/// many nodes it was the first to come to, and one more if the climb did not come to its end.
#[inline(always)]
pub fn mark<T: Links + ?Sized>(
    i: u32,
    params: &PrbvhParams,
    found: &[Slot<Move>],
    nodes: &T,
    ways: &[AtomicU32],
    report: &[AtomicU32],
) {
    let own = found[i as usize].get();
    if own.has_won() {
        let mut marked = mark_from(own.output, params, nodes, ways);
        marked += mark_from(own.other, params, nodes, ways);
        if own.input() != own.other {
            marked += mark_from(own.input(), params, nodes, ways);
        }
        status::count(report, params.row, MARKED, marked);
    }
}

#[inline(always)]
fn mark_from<T: Links + ?Sized>(start: u32, params: &PrbvhParams, nodes: &T, ways: &[AtomicU32]) -> u32 {
    let mut v = start;
    let mut marked = 0;
    let mut done = false;
    while !done && marked < params.nodes {
        done = v == NO_NODE || ways[v as usize].arrive() != 0;
        if !done {
            marked += 1;
            v = nodes.parent(v);
        }
    }
    // A climb that the device cut short counts one that nobody completes.
    marked + !done as u32
}

/// Invocation `i` climbs from the ends of the move `found[i]` and recomputes boxes; reports how the sum of the areas changes. Reads and writes
/// `nodes[2n-1]`, lowers `ways[n-1]` to 0. Calls `complete(v, area, left box, right box)` of each node that it completes.
#[inline(always)]
pub fn refit(
    i: u32,
    params: &PrbvhParams,
    found: &[Slot<Move>],
    nodes: &[AtomicNode],
    ways: &[AtomicU32],
    report: &[AtomicU32],
    mut complete: impl FnMut(u32, f32, Aabb, Aabb),
) {
    let own = found[i as usize].get();
    if own.has_won() {
        let mut shrunk = Sum::ZERO;
        let mut grew = Sum::ZERO;
        let mut complete = |v: u32, old: Aabb, left: Aabb, right: Aabb| {
            let area = left.union(right).half_area();
            let change = old.half_area() - area;
            shrunk = shrunk.plus(Sum::of(change, params.scale));
            grew = grew.plus(Sum::of(-change, params.scale));
            complete(v, area, left, right);
        };
        let mut completed = refit_from(own.output, params, nodes, ways, &mut complete);
        completed += refit_from(own.other, params, nodes, ways, &mut complete);
        if own.input() != own.other {
            completed += refit_from(own.input(), params, nodes, ways, &mut complete);
        }
        status::count(report, params.row, REFITTED, completed);
        shrunk.add_to(report, params.row as usize + SHRUNK);
        grew.add_to(report, params.row as usize + GREW);
    }
}

#[inline(always)]
fn refit_from(
    start: u32,
    params: &PrbvhParams,
    nodes: &[AtomicNode],
    ways: &[AtomicU32],
    complete: &mut impl FnMut(u32, Aabb, Aabb, Aabb),
) -> u32 {
    let mut v = start;
    let mut completed = 0;
    while completed < params.nodes {
        if v == NO_NODE || ways[v as usize].depart() != 1 {
            break;
        }
        let left = nodes.down(v);
        let (left_box, right_box) = (nodes[left as usize].aabb(), nodes[nodes.up(left) as usize].aabb());
        complete(v, nodes[v as usize].aabb(), left_box, right_box);
        nodes[v as usize].set_aabb(left_box.union(right_box));
        completed += 1;
        v = nodes.parent(v);
    }
    completed
}

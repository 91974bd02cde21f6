//! Reinsert: winners of their locks change the tree.
//!
//! Source: Meister & Bittner 2018, §4.2 and §5 "Reinsert nodes". Kind: scatter: the children links of a node (its `down`, the `up` of both
//! children) are touched only by the move that owns the node. Reads and writes `found`, the links of `nodes[2n-1]`, and `kept[n-1]`; boxes are
//! stale until the next refit.

use super::dual::DualMove;
use super::worst::books::EPOCH;
use super::{DUAL, Move, PrbvhParams};
use crate::kept::{Kept, keep};
use crate::mem::{AtomicU32, Slot};
use crate::node::{AtomicNode, Links, RIGHT, ROOT};
use crate::status::{self, APPLIED};

/// Invocation `i` makes the move `found[i]`, if it has won, and leaves there the lowest nodes whose boxes change: `input`, `output` and `other` in place of
/// what they were.
#[inline(always)]
pub fn reinsert(
    i: u32,
    params: &PrbvhParams,
    found: &[Slot<Move>],
    nodes: &[AtomicNode],
    kept: &[Slot<Kept>],
    books: &[AtomicU32],
    report: &[AtomicU32],
) {
    let own = found[i as usize].get();
    if own.has_won() {
        let epoch = books[EPOCH].load();
        let mut changed = own;
        if params.has(DUAL) {
            let dual = DualMove::new(nodes, &own);
            let parent = nodes.parent(dual.input);
            let above = nodes.parent(parent);
            keep(parent, epoch, nodes, kept);
            keep(dual.input, epoch, nodes, kept);
            keep(above, epoch, nodes, kept);
            replace(parent, nodes.sibling(dual.input), nodes);
            insert(dual.first, dual.first_output, parent, epoch, nodes, kept);
            // The second output may be the node that was inserted just now.
            insert(dual.second, dual.second_output, dual.input, epoch, nodes, kept);
            changed.output = above;
            changed.other = parent;
        } else {
            let input = own.input();
            let (freed, above) = remove(input, epoch, nodes, kept);
            insert(input, own.output, freed, epoch, nodes, kept);
            changed = Move { output: above, input: freed | super::WON, other: freed, ..own };
        }
        found[i as usize].set(changed);
        status::count(report, params.row, APPLIED, 1);
    }
}

/// Takes `input` and one more node out of the tree; the sibling closes the gap. Returns the node that is free to be the new parent, and the
/// lowest one with fewer leaves below than before.
#[inline(always)]
fn remove(input: u32, epoch: u32, nodes: &[AtomicNode], kept: &[Slot<Kept>]) -> (u32, u32) {
    let parent = nodes.parent(input);
    let sibling = nodes.sibling(input);
    keep(parent, epoch, nodes, kept);
    if parent == ROOT {
        // The root keeps its place and adopts the children of the sibling.
        keep(sibling, epoch, nodes, kept);
        let left = nodes.down(sibling);
        let right = nodes.up(left);
        nodes[ROOT as usize].set_down(left);
        nodes[right as usize].set_up(ROOT | RIGHT);
        (sibling, ROOT)
    } else {
        let above = nodes.parent(parent);
        keep(above, epoch, nodes, kept);
        replace(parent, sibling, nodes);
        (parent, above)
    }
}

/// Makes `freed` the parent of `output` and `input` in the place of `output`. A parent of `output` that the move has changed already is kept already.
#[inline(always)]
fn insert(input: u32, output: u32, freed: u32, epoch: u32, nodes: &[AtomicNode], kept: &[Slot<Kept>]) {
    keep(nodes.parent(output), epoch, nodes, kept);
    replace(output, freed, nodes);
    nodes[freed as usize].set_down(output);
    nodes[output as usize].set_up(input);
    nodes[input as usize].set_up(freed | RIGHT);
}

/// Puts `new` in the place of `old`, which is not the root, below the parent of `old`.
#[inline(always)]
fn replace(old: u32, new: u32, nodes: &[AtomicNode]) {
    let up = nodes.up(old);
    if up & RIGHT == 0 {
        let parent = nodes.up(up) & !RIGHT;
        nodes[parent as usize].set_down(new);
    } else {
        let left = nodes.down(up & !RIGHT);
        nodes[left as usize].set_up(new);
    }
    nodes[new as usize].set_up(up);
}

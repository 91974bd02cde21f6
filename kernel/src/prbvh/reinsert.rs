//! PRBVH reinsert: owners of their locks change the tree.
//!
//! Source: Meister & Bittner 2018, §4.2 and §5 "Reinsert nodes". Kind: scatter: the children links of a node (its `down`, the `up` of both
//! children) are touched only by the reinsertion that owns the node. Reads and writes `found` and the links of
//! `nodes[2n-1]`; boxes are stale until the next refit.

use super::Reinsertion;
use crate::mem::{AtomicU32, Slot};
use crate::node::{AtomicNode, Links, NO_NODE, RIGHT, ROOT};
use crate::status::APPLIED;

/// Invocation `i` applies the reinsertion `found[i]`, if it kept its locks, and leaves there where it left from.
#[inline(always)]
pub fn reinsert(i: u32, found: &[Slot<Reinsertion>], nodes: &[AtomicNode], report: &[AtomicU32]) {
    let reinsertion = found[i as usize].get();
    if reinsertion.output != NO_NODE {
        let (freed, above) = remove(reinsertion.input, nodes);
        insert(reinsertion.input, reinsertion.output, freed, nodes);
        found[i as usize].set(Reinsertion { output: above, ..reinsertion });
        report[APPLIED].add(1);
    }
}

/// Takes `input` and one more node out of the tree; the sibling closes the gap. Returns the node that is free to be the new parent, and the
/// lowest one with fewer leaves below than before.
#[inline(always)]
fn remove(input: u32, nodes: &[AtomicNode]) -> (u32, u32) {
    let parent = nodes.parent(input);
    let sibling = nodes.sibling(input);
    if parent == ROOT {
        // The root keeps its place and adopts the children of the sibling.
        let left = nodes.down(sibling);
        let right = nodes.up(left);
        nodes[ROOT as usize].set_down(left);
        nodes[right as usize].set_up(ROOT | RIGHT);
        (sibling, ROOT)
    } else {
        let above = nodes.parent(parent);
        replace(parent, sibling, nodes);
        (parent, above)
    }
}

/// Makes `freed` the parent of `output` and `input` in the place of `output`.
#[inline(always)]
pub(super) fn insert(input: u32, output: u32, freed: u32, nodes: &[AtomicNode]) {
    replace(output, freed, nodes);
    nodes[freed as usize].set_down(output);
    nodes[output as usize].set_up(input);
    nodes[input as usize].set_up(freed | RIGHT);
}

/// Puts `new` in the place of `old`, which is not the root, below the parent of `old`.
#[inline(always)]
pub(super) fn replace(old: u32, new: u32, nodes: &[AtomicNode]) {
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

//! PRBVH candidates: the input nodes whose reinsertion could gain more than a floor.
//!
//! Kind: map ([`flag`]), and after an exclusive scan of the flags a scatter to places of their own ([`pack`]): the list is in the order of the
//! nodes on every device.

use super::PrbvhParams;
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Node, ROOT, WholeNodes};
use crate::status::CANDIDATES;

/// Upper bound of the area decrease of every reinsertion of `input`, which is not the root, up to rounding: what its removal takes off the
/// areas of all nodes above it, less its own area, which no output can avoid.
#[inline(always)]
#[must_use]
pub fn largest_decrease<T: WholeNodes + ?Sized>(input: u32, nodes: &T) -> f32 {
    let node = nodes.whole(input);
    let mut family = nodes.family(node);
    let mut without: Aabb = family.sibling_box;
    let mut decrease = family.parent_node.aabb().half_area() - node.aabb().half_area();
    let mut shrinks = true;
    while shrinks && family.parent != ROOT {
        family = nodes.family(family.parent_node);
        without = without.union(family.sibling_box);
        let change = family.parent_node.aabb().half_area() - without.half_area();
        // The root keeps its box; above a node that does, so do all. Written so that a NaN ends.
        shrinks = family.parent != ROOT && change > 0.0;
        if shrinks {
            decrease += change;
        }
    }
    decrease
}

/// Invocation `i` sets `flags[i]` to 1 if node `i` is a candidate, else to 0. Reads `nodes[2n-1]`, writes `flags[2n]`, whose last word is 0.
#[inline(always)]
pub fn flag(i: u32, params: &PrbvhParams, nodes: &[Node], flags: &[Slot<u32>]) {
    let is_candidate = i != ROOT && i < params.nodes && largest_decrease(i, nodes) > params.floor;
    flags[i as usize].set(is_candidate as u32);
}

/// Invocation `i` puts node `i` in its place of the list if it is a candidate. Reads the scanned `places[2n]`, writes `candidates`; the last
/// invocation reports how many there are.
#[inline(always)]
pub fn pack(i: u32, params: &PrbvhParams, places: &[u32], candidates: &[Slot<u32>], report: &[AtomicU32]) {
    let place = places[i as usize];
    let next = places[i as usize + 1];
    if next != place {
        candidates[place as usize].set(i);
    }
    if i + 1 == params.nodes {
        report[CANDIDATES].store(next);
    }
}

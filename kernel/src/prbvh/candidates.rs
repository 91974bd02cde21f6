//! PRBVH candidates: the input nodes whose reinsertion could gain more than a floor.
//!
//! Kind: map ([`flag`]), and after an exclusive scan of the flags a scatter to places of their own ([`pack`]): the list is in the order of the
//! nodes on every device.

use super::PrbvhParams;
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Links, Node, ROOT};
use crate::status::CANDIDATES;

/// Upper bound of the area decrease of every reinsertion of `input`, which is not the root, up to rounding: what its removal takes off the
/// areas of all nodes above it, less its own area, which no output can avoid.
#[inline(always)]
#[must_use]
pub fn largest_decrease(input: u32, nodes: &[Node]) -> f32 {
    let parent = nodes.parent(input);
    let mut without: Aabb = nodes[nodes.sibling(input) as usize].aabb();
    let mut decrease = nodes[parent as usize].aabb().half_area() - nodes[input as usize].aabb().half_area();
    let mut below = parent;
    let mut shrinks = true;
    while shrinks && below != ROOT {
        without = without.union(nodes[nodes.sibling(below) as usize].aabb());
        below = nodes.parent(below);
        let change = nodes[below as usize].aabb().half_area() - without.half_area();
        // The root keeps its box; above a node that does, so do all. Written so that a NaN ends.
        shrinks = below != ROOT && change > 0.0;
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

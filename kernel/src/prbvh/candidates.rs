//! PRBVH candidates: the input nodes whose reinsertion could gain more than a floor.
//!
//! A reinsertion gains at most the area of the old parent and what the ancestors above it lose. The list has the children of all nodes of which
//! a few times their area exceeds the floor: one look at each internal node, in the order of the memory. It leaves out those whose ancestors lose
//! much though their parent is small; a later list, with a lower floor, has them. [`largest_decrease`] is the bound with the ancestors, which the search asks for
//! each candidate.
//!
//! Kind: map ([`flag`]), and after an exclusive scan of the flags a scatter to places of their own ([`pack`]): the list is in the order of the
//! parents on every device. After a search [`strike`] leaves on it those that found something, for another try of those that then lose their
//! locks.

use super::{PrbvhParams, Reinsertion};
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Links, NO_NODE, Node, ROOT, WholeNodes};
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

/// How many times the area of its old parent a reinsertion may gain, as the list sees it.
const PARENT_AREAS: f32 = 4.0;

/// Invocation `i` sets `flags[i]` to 1 if the children of node `i` are candidates, else to 0; so of a leaf. Reads `nodes[2n-1]`, writes `flags[n]`,
/// whose last word is 0.
#[inline(always)]
pub fn flag(i: u32, params: &PrbvhParams, nodes: &[Node], flags: &[Slot<u32>]) {
    let is_parent = i < params.nodes / 2 && PARENT_AREAS * nodes[i as usize].aabb().half_area() > params.floor;
    flags[i as usize].set(is_parent as u32);
}

/// Invocation `i` puts the children of internal node `i` in their places of the list if it is flagged. Reads the scanned `places[n]` and
/// `nodes[2n-1]`, writes `candidates[2n-2]`; the last invocation reports how many there are.
#[inline(always)]
pub fn pack(
    i: u32,
    params: &PrbvhParams,
    places: &[u32],
    nodes: &[Node],
    candidates: &[Slot<u32>],
    report: &[AtomicU32],
) {
    let place = places[i as usize];
    let next = places[i as usize + 1];
    if next != place {
        let left = nodes.down(i);
        candidates[2 * place as usize].set(left);
        candidates[2 * place as usize + 1].set(nodes.up(left));
    }
    if i + 1 == params.nodes / 2 {
        report[CANDIDATES].store(2 * next);
    }
}

/// Invocation `i` takes its candidate off the list if its search found nothing. Reads `found`, writes [`NO_NODE`] in `candidates`.
#[inline(always)]
pub fn strike(i: u32, params: &PrbvhParams, found: &[Reinsertion], candidates: &[Slot<u32>]) {
    if found[i as usize].output == NO_NODE {
        candidates[params.input(i) as usize].set(NO_NODE);
    }
}

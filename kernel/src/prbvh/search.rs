//! PRBVH search: for every input node the output node with the largest area decrease.
//!
//! Source: Meister & Bittner 2018, §4.1 and algorithm 1. Kind: map: an invocation reads `nodes[2n-1]` and writes an element of `found`.
//!
//! The walk needs no stack. It takes the pivots one by one, from the input's parent to the root, and visits the subtree on the
//! other side of each in depth-first order, with `up` of a node as the way on. What differs from the published algorithm:
//! the sum `d` starts afresh at each pivot, so that rounding does not pile up; the winner's area decrease is computed again, directly,
//! and must exceed what rounding could have made of it; a NaN prunes; the number of steps is bounded; the pivots themselves are
//! no candidates. As published those can never win; evaluated exactly they did, and the final cost on six scenes changed by
//! -0.1 % to +0.5 %, so they are left out.

use super::rounds::Rounds;
use super::walk::Walk;
use super::{Move, PrbvhParams};
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Links, NO_NODE, ROOT, WholeNodes, WideNode};
use crate::status::{self, FAULT_SEARCH_STEPS, FOUND, MOST_STEPS, VISITS};

/// A decrease must exceed this part of the areas that it was computed from, 16 roundings: below it is noise.
pub const RELATIVE_THRESHOLD: f32 = 1.0 / (1 << 20) as f32;

/// Most steps of one search; then it keeps the best output so far. Ten times what the longest search on any known scene takes
/// (341). Devices need a bound that is the same on all: lavapipe leaves a loop after 65,535 rounds without a word.
pub const MAX_STEPS: u32 = 4096;

/// Invocation `i` searches for its input node.
#[inline(always)]
pub fn search(
    i: u32,
    params: &PrbvhParams,
    nodes: &[WideNode],
    found: &[Slot<Move>],
    books: &[AtomicU32],
    report: &[AtomicU32],
) {
    let input = params.by(books).input(i);
    let mut best = Move::NONE;
    if input != ROOT && input < params.nodes {
        let (output, top, _) = best_output(input, params, nodes, report);
        if output != NO_NODE {
            let area_decrease = checked_area_decrease(input, output, nodes.parent(top), nodes);
            if area_decrease > 0.0 {
                best = Move { area_decrease, input, output, other: top };
                status::count(report, params.row, FOUND, 1);
            }
        }
    }
    found[i as usize].set(best);
}

/// The best output node, the child of its pivot above it, and the area decrease as the walk added it up; [`NO_NODE`] and 0 if no
/// move promises a decrease.
#[inline(always)]
#[must_use]
pub fn best_output<T: WholeNodes + ?Sized>(
    input: u32,
    params: &PrbvhParams,
    nodes: &T,
    report: &[AtomicU32],
) -> (u32, u32, f32) {
    let internal = params.nodes / 2;
    let input_box = nodes.box_of(input);
    let sibling = nodes.sibling(input);
    let parent = nodes.parent(input);
    let parent_area = nodes.box_of(parent).half_area();
    // No output can cost less than the input's own area.
    let bound = parent_area - input_box.half_area();

    let mut best = 0.0f32;
    let mut output = NO_NODE;
    let mut output_top = NO_NODE;

    let mut walk = Walk::new(sibling, parent);
    // Sum of decreases above the input up to the pivot; `d` adds the increases from the pivot down to the node.
    let mut d_pivot = 0.0f32;
    let mut d = 0.0f32;
    let mut done = false;

    // Of a tree a step has one look on the way up and two for a pivot at most; what is none may have no end.
    let mut rounds = Rounds { left: 4 * MAX_STEPS, visits: 0 };
    while !done && rounds.visits < MAX_STEPS && rounds.next() {
        let v = walk.v;
        let node = nodes.whole(v);
        let own_area = node.aabb().half_area();
        if walk.is_at_pivot() && v != parent {
            d_pivot += own_area - walk.pivot_box.half_area();
        }
        if walk.climbs(&node) {
            d = d_pivot;
            continue;
        }
        let area = node.aabb().union(input_box).half_area();
        if walk.enters(&node) {
            rounds.visits += 1;
            if v != sibling {
                let decrease = d + (parent_area - area);
                if decrease > best {
                    best = decrease;
                    output = v;
                    output_top = walk.top;
                }
            }
            // Written so that a NaN does not descend.
            let d_below = d + (own_area - area);
            if v < internal && d_below + bound > best {
                d = d_below;
                walk.descend(&node);
                continue;
            }
        } else {
            // Each step up takes an increase back.
            d -= own_area - area;
        }
        if !walk.goes_on(&node) {
            done = walk.pivot == ROOT;
            walk.climb();
        }
    }
    // Neither at the end nor at the bound: the device cut the loop short, or this is no tree.
    if !done && rounds.visits < MAX_STEPS {
        status::raise(report, params.row, FAULT_SEARCH_STEPS);
    }
    status::raise_most(report, params.row, MOST_STEPS, rounds.visits);
    status::count(report, params.row, VISITS, rounds.visits);
    (output, output_top, best)
}

/// The area decrease of a reinsertion, from its definition; 0 if rounding could account for it or if it might close a loop (see
/// [`super`]).
#[inline(always)]
#[must_use]
pub fn checked_area_decrease<T: WholeNodes + ?Sized>(input: u32, output: u32, pivot: u32, nodes: &T) -> f32 {
    let input_node = nodes.whole(input);
    let input_box = input_node.aabb();
    let input_area = input_box.half_area();
    let mut family = nodes.family(input_node);
    let sibling = family.sibling;

    let parent_area = family.parent_node.aabb().half_area();
    let mut decrease = 0.0f32;
    // The areas whose roundings the sums contain; an unchanged box contributes exactly 0 and no rounding.
    let mut magnitude = parent_area;
    if family.parent != pivot {
        let mut without: Aabb = family.sibling_box;
        family = nodes.family(family.parent_node);
        while family.parent != pivot {
            without = without.union(family.sibling_box);
            let area = family.parent_node.aabb().half_area();
            let change = area - without.half_area();
            decrease += change;
            if change > 0.0 {
                magnitude += area;
            }
            family = nodes.family(family.parent_node);
        }
    }

    let output_node = nodes.whole(output);
    let output_area = output_node.aabb().union(input_box).half_area();
    let mut increase = 0.0f32;
    magnitude += output_area;
    let mut loop_free = true;
    let mut w = nodes.family(output_node).parent;
    while w != pivot {
        let node = nodes.whole(w);
        let w_box = node.aabb();
        let area = w_box.union(input_box).half_area();
        let change = area - w_box.half_area();
        increase += change;
        if change > 0.0 {
            magnitude += area;
        }
        if w != sibling && w_box.half_area() <= input_area {
            loop_free = false;
        }
        w = nodes.family(node).parent;
    }

    let total = (parent_area - output_area) + (decrease - increase);
    if loop_free && total > RELATIVE_THRESHOLD * magnitude { total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{Node, RIGHT};
    use crate::status::{FAULTS, REPORT_WORDS};

    #[test]
    fn a_walk_that_comes_back_to_itself_ends_with_a_fault() {
        let node = |size: f32, up: u32, down: u32| Node { min: [0.0; 3], up, max: [size; 3], down };
        let params = PrbvhParams::every(1, 0, 5);
        // The root has the leaf 2 and the node 1, which has the leaves 3 and 4.
        for (up_of_4, faults) in [(1 | RIGHT, 0), (4 | RIGHT, FAULT_SEARCH_STEPS)] {
            let one = node(1.0, ROOT | RIGHT, 3);
            let nodes = [node(9.0, NO_NODE, 2), one, node(1.0, 1, 0), node(1.0, 4, 1), node(1.0, up_of_4, 2)];
            let mut words = [0u32; REPORT_WORDS as usize];
            let report = AtomicU32::from_mut_slice(&mut words);
            let _ = best_output(2, &params, nodes.as_slice(), report);
            assert_eq!(report[FAULTS].load(), faults);
        }
    }
}

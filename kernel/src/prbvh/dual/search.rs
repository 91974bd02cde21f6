//! Search of the dual reinsertions: for every input node on a list the best places of its children.
//!
//! Kind: map: an invocation reads `nodes[2n-1]` and writes an element of `found`. The first child goes where it costs least in the tree without the input,
//! the second one where it costs least in the tree that then is. The larger child is the first, or each of them in turn. The area decrease is
//! computed again, directly, as in [`crate::prbvh::search`].

use super::gain::checked_area_decrease;
use super::place::{Placed, Search, best_place};
use crate::aabb::Aabb;
use crate::mem::AtomicU32;
use crate::node::{NO_NODE, RIGHT, ROOT, WholeNodes};
use crate::prbvh::Move;
use crate::prbvh::rounds::Rounds;
use crate::status::{self, FOUND, MOST_STEPS, VISITS};
use bytemuck::{Pod, Zeroable};

/// Most rounds of all loops of one search; then the input stays. Devices need a bound that is the same on all, as in [`crate::prbvh::search`].
pub const MAX_ROUNDS: u32 = 1 << 14;

/// More levels than any tree has.
pub const TO_THE_ROOT: u32 = 1 << 30;

/// Push constants of [`search`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct DualParams {
    /// Most invocations.
    pub count: u32,
    /// Nodes of the tree, `2n-1`.
    pub nodes: u32,
    /// Whether each child is tried as the first, or only the larger one.
    pub both_orders: u32,
    /// Levels of the climb above the first ancestor that keeps its box without the input, at most [`TO_THE_ROOT`].
    pub climb: u32,
    /// The climb ends where no place can be better by this part of the child's area than the best so far.
    pub slack: f32,
    /// The word of the report with which the row of the iteration begins.
    pub row: u32,
}

/// Searches for `input`.
#[inline(always)]
pub fn search<T: WholeNodes + ?Sized>(input: u32, params: &DualParams, nodes: &T, report: &[AtomicU32]) -> Move {
    let mut best = Move::NONE;
    if input != ROOT && input < params.nodes / 2 && nodes.parent(input) != ROOT {
        let mut rounds = Rounds { left: MAX_ROUNDS, visits: 0 };
        let left = nodes.down(input);
        let right = nodes.up(left);
        let is_right_larger = nodes.box_of(right).half_area() > nodes.box_of(left).half_area();
        for order in 0..2u32 {
            if order == 0 || params.both_orders != 0 {
                let is_right_first = (order == 1) != is_right_larger;
                let first = Placed::nowhere(if is_right_first { right } else { left }, nodes);
                let second = Placed::nowhere(if is_right_first { left } else { right }, nodes);
                let (first, second) =
                    best_places(input, params, best.area_decrease, first, second, nodes, &mut rounds, report);
                if second.output != NO_NODE {
                    let area_decrease = checked_area_decrease(input, &first, &second, nodes, &mut rounds);
                    if area_decrease > best.area_decrease {
                        let other = second.output | if is_right_first { RIGHT } else { 0 };
                        best = Move { area_decrease, input, output: first.output, other };
                    }
                }
            }
        }
        if rounds.left == 0 {
            best = Move::NONE;
        }
        if best.output != NO_NODE {
            status::count(report, params.row, FOUND, 1);
        }
        status::raise_most(report, params.row, MOST_STEPS, MAX_ROUNDS - rounds.left);
        status::count(report, params.row, VISITS, rounds.visits);
    }
    best
}

/// What the ancestors of a dissolved node have to do with its children.
struct Above {
    /// Area that the removal takes away: the input, its parent, and what the ancestors shrink by.
    decrease: f32,
    /// What the first child adds to the ancestors.
    first: f32,
    /// What the second child adds to them once the first one is in its place.
    second: f32,
    /// Levels from the parent of the input to the first ancestor that keeps its box without it.
    levels: u32,
}

/// Climbs until the box of an ancestor is the same without the input: all above it add nothing.
#[inline(always)]
fn above<T: WholeNodes + ?Sized>(input: u32, first: &Placed, second: &Placed, nodes: &T, rounds: &mut Rounds) -> Above {
    let mut family = nodes.family(nodes.whole(input));
    let mut sums = Above {
        decrease: family.parent_node.aabb().half_area() + nodes.box_of(input).half_area(),
        first: 0.0,
        second: 0.0,
        levels: 0,
    };
    let mut without: Aabb = family.sibling_box;
    let mut has_first = first.pivot == family.parent;
    let mut shrinks = true;
    while shrinks && family.parent != ROOT && rounds.next() {
        family = nodes.family(family.parent_node);
        without = without.union(family.sibling_box);
        let aabb = family.parent_node.aabb();
        shrinks = !without.contains(aabb);
        if family.parent == first.pivot {
            has_first = true;
        }
        let area = without.half_area();
        sums.decrease += aabb.half_area() - area;
        let with_first = without.union(first.aabb);
        sums.first += with_first.half_area() - area;
        let have = if has_first { with_first } else { without };
        sums.second += have.union(second.aabb).half_area() - have.half_area();
        sums.levels += 1;
    }
    sums
}

/// The best place of the first child, and then the best of the second; no output of the second one if not even rounding aside they promise more
/// than `least`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "what both searches need")]
fn best_places<T: WholeNodes + ?Sized>(
    input: u32,
    params: &DualParams,
    least: f32,
    first: Placed,
    second: Placed,
    nodes: &T,
    rounds: &mut Rounds,
    report: &[AtomicU32],
) -> (Placed, Placed) {
    let before = above(input, &first, &second, nodes, rounds);
    // The second child will add its own area at least.
    let search = Search {
        input,
        node_count: params.nodes,
        most: before.first,
        floor: before.first - before.decrease + second.aabb.half_area() + least,
        pivots: before.levels + 1 + params.climb,
        ends: 1.0 + params.slack,
        row: params.row,
    };
    let (first, first_value) = best_place::<false, T>(&search, &first, &second, nodes, rounds, report);
    if first.output == NO_NODE {
        return (first, second);
    }
    let after = above(input, &first, &second, nodes, rounds);
    let floor = (before.first - first_value) - before.decrease + after.second + least;
    let (second, _) =
        best_place::<true, T>(&Search { most: after.second, floor, ..search }, &second, &first, nodes, rounds, report);
    (first, second)
}

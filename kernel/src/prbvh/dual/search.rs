//! Search of the dual reinsertions: for every internal input node the best places of its children.
//!
//! Kind: map: invocation `i` reads `nodes[2n-1]` and writes `found[i]` and `seconds[i]`. Each order of the children is tried: the first child
//! goes where it costs least in the tree without the input, the second one where it costs least in the tree that then is. The
//! area decrease of the better order is computed again, directly, as in [`crate::prbvh::search`].

use super::gain::checked_area_decrease;
use super::place::{Placed, Rounds, Search, best_place};
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Links, NO_NODE, Node, RIGHT, ROOT};
use crate::prbvh::{PrbvhParams, Reinsertion};
use crate::status::{FOUND, MOST_STEPS};

/// Most rounds of all loops of one search; then the input stays. Devices need a bound that is the same on all, as in [`crate::prbvh::search`].
pub const MAX_ROUNDS: u32 = 1 << 14;

/// Invocation `i` searches for input node `params.input(i)`. `found[i]` has the first output, `seconds[i]` the second as [`super::DualMove::new`]
/// reads it.
#[inline(always)]
pub fn search(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    found: &[Slot<Reinsertion>],
    seconds: &[Slot<u32>],
    report: &[AtomicU32],
) {
    let input = params.input(i);
    let mut best = Reinsertion::NONE;
    let mut second_output = NO_NODE;
    if input != ROOT && input < params.nodes / 2 && nodes.parent(input) != ROOT {
        let mut rounds = Rounds { left: MAX_ROUNDS };
        let left = nodes.down(input);
        let right = nodes.up(left);
        for order in 0..2u32 {
            let is_right_first = order == 1;
            let first = Placed::nowhere(if is_right_first { right } else { left }, nodes);
            let second = Placed::nowhere(if is_right_first { left } else { right }, nodes);
            let (first, second) =
                best_places(input, params.nodes, best.area_decrease, first, second, nodes, &mut rounds, report);
            if second.output != NO_NODE {
                let area_decrease = checked_area_decrease(input, &first, &second, nodes, &mut rounds);
                if area_decrease > best.area_decrease {
                    best = Reinsertion { area_decrease, input, output: first.output };
                    second_output = second.output | if is_right_first { RIGHT } else { 0 };
                }
            }
        }
        if rounds.left == 0 {
            best = Reinsertion::NONE;
            second_output = NO_NODE;
        }
        if best.output != NO_NODE {
            report[FOUND].add(1);
        }
        report[MOST_STEPS].max(MAX_ROUNDS - rounds.left);
    }
    found[i as usize].set(best);
    seconds[i as usize].set(second_output);
}

/// What the ancestors of a dissolved node have to do with its children.
struct Above {
    /// Area that the removal takes away: the input, its parent, and what the ancestors shrink by.
    decrease: f32,
    /// What the first child adds to the ancestors.
    first: f32,
    /// What the second child adds to them once the first one is in its place.
    second: f32,
}

/// Climbs until the box of an ancestor is the same without the input: all above it add nothing.
#[inline(always)]
fn above(input: u32, first: &Placed, second: &Placed, nodes: &[Node], rounds: &mut Rounds) -> Above {
    let parent = nodes.parent(input);
    let mut sums = Above {
        decrease: nodes[parent as usize].aabb().half_area() + nodes[input as usize].aabb().half_area(),
        first: 0.0,
        second: 0.0,
    };
    let mut without: Aabb = nodes[nodes.sibling(input) as usize].aabb();
    let mut has_first = first.pivot == parent;
    let mut below = parent;
    let mut shrinks = true;
    while shrinks && below != ROOT && rounds.next() {
        without = without.union(nodes[nodes.sibling(below) as usize].aabb());
        below = nodes.parent(below);
        let aabb = nodes[below as usize].aabb();
        shrinks = !without.contains(aabb);
        if below == first.pivot {
            has_first = true;
        }
        let area = without.half_area();
        sums.decrease += aabb.half_area() - area;
        let with_first = without.union(first.aabb);
        sums.first += with_first.half_area() - area;
        let have = if has_first { with_first } else { without };
        sums.second += have.union(second.aabb).half_area() - have.half_area();
    }
    sums
}

/// The best place of the first child, and then the best of the second; no output of the second one if not even rounding aside they promise more
/// than `least`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "what both searches need")]
fn best_places(
    input: u32,
    node_count: u32,
    least: f32,
    first: Placed,
    second: Placed,
    nodes: &[Node],
    rounds: &mut Rounds,
    report: &[AtomicU32],
) -> (Placed, Placed) {
    let before = above(input, &first, &second, nodes, rounds);
    // The second child will add its own area at least.
    let floor = before.first - before.decrease + second.aabb.half_area() + least;
    let search = Search { input, node_count, most: before.first, floor };
    let (first, first_value) = best_place(&search, &first, &second, nodes, rounds, report);
    if first.output == NO_NODE {
        return (first, second);
    }
    let after = above(input, &first, &second, nodes, rounds);
    let floor = (before.first - first_value) - before.decrease + after.second + least;
    let search = Search { input, node_count, most: after.second, floor };
    let (second, _) = best_place(&search, &second, &first, nodes, rounds, report);
    (first, second)
}

//! What a dual reinsertion gains, from its definition.

use super::place::Placed;
use crate::aabb::Aabb;
use crate::node::WholeNodes;
use crate::prbvh::rounds::Rounds;
use crate::prbvh::search::RELATIVE_THRESHOLD;

/// Sums of areas.
struct Sum {
    decrease: f32,
    /// The areas whose roundings the decrease contains; an unchanged box contributes exactly 0 and no rounding.
    magnitude: f32,
}

impl Sum {
    /// A node whose area changes.
    #[inline(always)]
    fn change(&mut self, old: f32, new: f32) {
        let change = old - new;
        self.decrease += change;
        if change > 0.0 {
            self.magnitude += old;
        } else if change < 0.0 {
            self.magnitude += new;
        }
    }
}

/// Nodes between `v` and `pivot`, both left out.
#[inline(always)]
fn nodes_between<T: WholeNodes + ?Sized>(v: u32, pivot: u32, nodes: &T, rounds: &mut Rounds) -> u32 {
    let mut count = 0;
    let mut w = nodes.parent(v);
    while w != pivot && rounds.next() {
        count += 1;
        w = nodes.parent(w);
    }
    count
}

/// The area decrease of the reinsertion of both children of `input`; 0 if rounding could account for it, if it might close a loop (see
/// [`super`]), or if the rounds are used up.
#[inline(always)]
pub(super) fn checked_area_decrease<T: WholeNodes + ?Sized>(
    input: u32,
    first: &Placed,
    second: &Placed,
    nodes: &T,
    rounds: &mut Rounds,
) -> f32 {
    let parent = nodes.parent(input);
    let sibling = nodes.sibling(input);
    let first_area = first.aabb.half_area();
    let second_area = second.aabb.half_area();
    let both = first.aabb.union(second.aabb);
    let old = nodes.box_of(parent).half_area() + nodes.box_of(input).half_area();
    let mut sum = Sum { decrease: 0.0, magnitude: old };

    // Ancestors of the input: smaller, until each child has joined again.
    let mut has_first = first.pivot == parent;
    let mut has_second = second.pivot == parent;
    let mut without: Aabb = nodes.box_of(sibling);
    let mut below = parent;
    while !(has_first && has_second) && rounds.next() {
        without = without.union(nodes.box_of(nodes.sibling(below)));
        below = nodes.parent(below);
        has_first |= below == first.pivot;
        has_second |= below == second.pivot;
        if !(has_first && has_second) {
            let mut aabb = without;
            if has_first {
                aabb = aabb.union(first.aabb);
            }
            if has_second {
                aabb = aabb.union(second.aabb);
            }
            sum.change(nodes.box_of(below).half_area(), aabb.half_area());
        }
    }

    // A second child beside the first one, or beside the new parent, is in the place of the first output.
    let x = first.output;
    let is_new = second.output == parent || second.output == first.child;
    let y = if is_new { x } else { second.output };
    // Ancestors of the outputs grow by what is below them, from where the paths meet on by both at once.
    let do_meet = first.pivot == second.pivot;
    let mut loop_free = true;
    let mut is_y_below_x = false;
    let mut is_x_below_y = false;
    let mut above_x = nodes_between(x, first.pivot, nodes, rounds);
    let mut above_y = nodes_between(y, second.pivot, nodes, rounds);
    let mut v = x;
    let mut w = y;
    while above_x + above_y > 0 && rounds.next() {
        let are_together = do_meet && above_x == above_y && nodes.parent(v) == nodes.parent(w);
        let is_first = are_together || above_x >= above_y;
        let is_second = are_together || !is_first;
        let mut grown = Aabb::EMPTY;
        let mut least = 0.0f32;
        if is_first {
            v = nodes.parent(v);
            above_x -= 1;
            is_x_below_y |= v == y;
            grown = first.aabb;
            least = first_area;
        }
        if is_second {
            w = nodes.parent(w);
            above_y -= 1;
            is_y_below_x |= w == x;
            grown = grown.union(second.aabb);
            least = if second_area > least { second_area } else { least };
        }
        let node = if is_first { v } else { w };
        let aabb = nodes.box_of(node);
        let area = aabb.half_area();
        sum.change(area, aabb.union(grown).half_area());
        if node != sibling && area <= least {
            loop_free = false;
        }
    }

    let x_box = nodes.box_of(x);
    let y_box = nodes.box_of(y);
    let first_new;
    let second_new;
    if is_new || x == y {
        first_new = x_box.union(both);
        second_new = if second.output == parent {
            x_box.union(first.aabb)
        } else if is_new {
            both
        } else {
            x_box.union(second.aabb)
        };
    } else {
        first_new = x_box.union(if is_y_below_x { both } else { first.aabb });
        second_new = y_box.union(if is_x_below_y { both } else { second.aabb });
    }
    let new = first_new.half_area() + second_new.half_area();
    let total = (old - new) + sum.decrease;
    let magnitude = sum.magnitude + new;
    if loop_free && rounds.left > 0 && total > RELATIVE_THRESHOLD * magnitude { total } else { 0.0 }
}

//! Where a child of a dissolved node costs least.

use super::way::{Stand, Way};
use crate::aabb::Aabb;
use crate::mem::AtomicU32;
use crate::node::{NO_NODE, RIGHT, ROOT, WholeNodes};
use crate::prbvh::rounds::Rounds;
use crate::prbvh::walk::Walk;
use crate::status::{self, FAULT_SEARCH_STEPS};

/// A child with its place.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    /// Its box.
    pub(super) aabb: Aabb,
    /// The child.
    pub(super) child: u32,
    /// Its new sibling; [`NO_NODE`] while it has no place.
    pub(super) output: u32,
    /// The lowest ancestor of the input above the output.
    pub(super) pivot: u32,
}

impl Placed {
    /// `child`, which has no place.
    #[inline(always)]
    pub(super) fn nowhere<T: WholeNodes + ?Sized>(child: u32, nodes: &T) -> Self {
        Self { aabb: nodes.box_of(child), child, output: NO_NODE, pivot: NO_NODE }
    }
}

/// The output that wins most.
struct Best {
    value: f32,
    output: u32,
    pivot: u32,
}

impl Best {
    #[inline(always)]
    fn offer(&mut self, value: f32, output: u32, pivot: u32) {
        if value > self.value {
            self.value = value;
            self.output = output;
            self.pivot = pivot;
        }
    }
}

/// What is searched for.
#[derive(Clone, Copy)]
pub(super) struct Search {
    /// The node that was dissolved.
    pub(super) input: u32,
    /// Nodes of the tree.
    pub(super) node_count: u32,
    /// Sum of what the child would add to the ancestors of the input, from the grandparent to the root.
    pub(super) most: f32,
    /// What a place must be better than.
    pub(super) floor: f32,
    /// Pivots to take.
    pub(super) pivots: u32,
    /// The climb ends when no place above can be better than this many areas of the child at the least.
    pub(super) ends: f32,
    /// Where the row of the report begins.
    pub(super) row: u32,
}

/// The best place of `child` in the tree without the input and its parent, but with `other`, if that has a place, and its value; the value
/// is [`Search::most`] less the area that the insertion adds. The walk is a [`Walk`], with the boxes that ancestors
/// have without the input. The output is the input's parent for the new parent of `other`.
#[inline(always)]
pub(super) fn best_place<const HAS_OTHER: bool, T: WholeNodes + ?Sized>(
    search: &Search,
    child: &Placed,
    other: &Placed,
    nodes: &T,
    rounds: &mut Rounds,
    report: &[AtomicU32],
) -> (Placed, f32) {
    let internal = search.node_count / 2;
    let child_area = child.aabb.half_area();
    let sibling = nodes.sibling(search.input);
    let parent = nodes.parent(search.input);
    let mut way = Way::NOWHERE;
    // What the new parent of the other one grows by.
    let mut new_growth = 0.0f32;
    let mut new_area = 0.0f32;
    if HAS_OTHER {
        let new_box = nodes.box_of(other.output).union(other.aabb);
        new_area = new_box.union(child.aabb).half_area();
        new_growth = new_area - new_box.half_area();
    }

    let mut best = Best { value: search.floor, output: NO_NODE, pivot: NO_NODE };
    let mut walk = Walk::new(sibling, parent);
    let mut stand = Stand::new(false);
    // Whether the pivot has the other child below it.
    let mut has_other = false;
    // Sum of growths above the input below the pivot; `d` takes off the growths from the pivot down to the node.
    let mut d_pivot = 0.0f32;
    let mut d = 0.0f32;
    let mut pivots = 1;
    let mut done = false;

    while !done && rounds.next() {
        let v = walk.v;
        let node = nodes.whole(v);
        if walk.climbs(&node) {
            continue;
        }
        // One of the two is next.
        nodes.ask_for(node.up);
        if v < internal {
            nodes.ask_for(node.down);
        }
        let enters = walk.enters(&node);
        if HAS_OTHER && enters && v == walk.top {
            stand = Stand::new(walk.pivot == other.pivot);
        }
        let mut aabb = node.aabb();
        let own_area = aabb.half_area();
        if HAS_OTHER && v != other.output && stand.is_on_way() {
            aabb = aabb.union(other.aabb);
        }
        let area = aabb.union(child.aabb).half_area();
        let growth = aabb.half_area() - area;
        if enters {
            rounds.visits += 1;
            let mut here = d;
            if HAS_OTHER && v == other.output {
                best.offer(d - new_area, parent, walk.pivot);
                here = d - new_growth;
                best.offer(here - other.aabb.union(child.aabb).half_area(), other.child, walk.pivot);
            }
            best.offer(here - area, v, walk.pivot);
            // Written so that a NaN does not descend. Below a node that is no larger than the child a move might close a loop.
            let d_below = here + growth;
            if v < internal && d_below - child_area > best.value && (own_area > child_area || v == sibling) {
                if HAS_OTHER {
                    if v == walk.top && stand.is_on_way() {
                        way = Way::to(other.output, walk.pivot, nodes, rounds);
                    }
                    stand.down(&way);
                }
                d = d_below;
                walk.descend(&node);
                continue;
            }
        } else {
            // Each step up takes a growth back.
            d -= growth;
            if HAS_OTHER && v == other.output {
                d += new_growth;
            }
        }
        if walk.goes_on(&node) {
            if HAS_OTHER && node.up & RIGHT == 0 {
                stand.aside(&way);
            } else if HAS_OTHER {
                stand.up();
            }
            continue;
        }
        // The next pivot; none if even the child's own area would be too much.
        if walk.pivot == ROOT || pivots >= search.pivots || search.most - search.ends * child_area <= best.value {
            done = true;
        } else {
            pivots += 1;
            if HAS_OTHER && walk.pivot == other.pivot {
                has_other = true;
            }
            if walk.pivot != parent {
                let aabb = if has_other { walk.pivot_box.union(other.aabb) } else { walk.pivot_box };
                d_pivot += aabb.union(child.aabb).half_area() - aabb.half_area();
            }
            d = d_pivot;
            walk.climb();
        }
    }
    // Neither at the end nor at the bound: the device cut the loop short.
    if !done && rounds.left > 0 {
        status::raise(report, search.row, FAULT_SEARCH_STEPS);
    }
    (Placed { output: best.output, pivot: best.pivot, ..*child }, best.value)
}

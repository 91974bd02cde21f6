//! Where a subtree costs least: branch and bound from the root, the smallest induced cost first.

use super::tree::RbvhTree;
use crate::bvh::{NO_NODE, ROOT};
use prbvh_kernel::aabb::Aabb;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Queue of the search; its memory is kept from one search to the next.
#[derive(Debug)]
pub(super) struct Search {
    /// Bits of the induced cost, which is no negative number, above the id of an internal node whose children are to be looked at.
    queue: BinaryHeap<Reverse<u64>>,
}

/// The best place found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Node that gets a new parent.
    pub(super) target: u32,
    /// Sum of the half areas that the insertion adds: the new parent's and what its ancestors grow by.
    pub(super) cost: f32,
    /// Nodes whose children were looked at.
    pub(super) steps: u32,
}

impl Search {
    /// Room for every internal node of the tree, so that no search allocates.
    pub(super) fn new(internal: u32) -> Self {
        Self { queue: BinaryHeap::with_capacity(internal as usize) }
    }

    /// The place in the tree where a subtree with the box `aabb` adds the least area. `hint` is a node of the tree: the nearer to the
    /// best one, the shorter the queue. The subtree is not in the tree.
    ///
    /// A node is queued at most once, so the search ends whatever the boxes are; and it ends, with the best so far, when the children of `most_steps`
    /// nodes were looked at.
    pub(super) fn best_place(&mut self, tree: &RbvhTree, aabb: Aabb, hint: u32, most_steps: u32) -> Place {
        let area = aabb.half_area();
        let internal = tree.internal();
        self.queue.clear();
        let mut best = Place { target: hint, cost: cost_at(tree, aabb, hint), steps: 0 };
        let look_at = |node: u32, induced: f32, best: &mut Place, queue: &mut BinaryHeap<Reverse<u64>>| {
            let have = tree.node(node).aabb;
            let direct = have.union(aabb).half_area();
            if induced + direct < best.cost {
                best.cost = induced + direct;
                best.target = node;
            }
            if node < internal {
                // Exactly 0 more where the node holds the box already. A NaN is not below, so it prunes.
                let below = induced + (direct - have.half_area());
                if below + area < best.cost {
                    queue.push(Reverse(key(below, node)));
                }
            }
        };
        look_at(ROOT, 0.0, &mut best, &mut self.queue);
        while let Some(Reverse(key)) = self.queue.pop() {
            let induced = f32::from_bits((key >> 32) as u32);
            if induced + area >= best.cost || best.steps >= most_steps {
                break;
            }
            best.steps += 1;
            for child in tree.node(key as u32).children {
                look_at(child, induced, &mut best, &mut self.queue);
            }
        }
        best
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.queue.capacity() * size_of::<u64>()) as u64
    }
}

/// Orders by cost, then by node.
fn key(cost: f32, node: u32) -> u64 {
    u64::from(cost.to_bits()) << 32 | u64::from(node)
}

/// Area that an insertion of `aabb` at `target` adds.
pub(super) fn cost_at(tree: &RbvhTree, aabb: Aabb, target: u32) -> f32 {
    let mut cost = tree.node(target).aabb.union(aabb).half_area();
    let mut v = tree.parent(target);
    while v != NO_NODE {
        let have = tree.node(v).aabb;
        let grown = have.union(aabb);
        if grown == have {
            // All above hold the box too.
            break;
        }
        cost += grown.half_area() - have.half_area();
        v = tree.parent(v);
    }
    cost
}

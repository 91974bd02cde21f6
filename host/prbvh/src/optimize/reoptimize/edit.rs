//! Primitives that come and go, in a tree of one primitive per leaf on the host.
//!
//! A new leaf goes where it adds the least area, found by branch and bound: Bittner, Hapala & Havran, *Incremental BVH Construction for Ray Tracing*,
//! Computers & Graphics 47, 2015, §3.1. What is taken out leaves its sibling in the place of its parent. Trees stay valid, and their boxes tight.

use crate::bvh::{Bvh, BvhNode, Content, NO_NODE, ROOT};
use prbvh_kernel::aabb::Aabb;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A tree whose leaves hold a primitive each, by its number: the order is the identity.
pub(super) struct Edited {
    nodes: Vec<BvhNode>,
    primitives: u32,
    /// Bits of the area that is added on the way, which is no negative number, above the node whose children are to be looked at.
    queue: BinaryHeap<Reverse<u64>>,
}

impl Edited {
    /// `tree` has one primitive in each leaf.
    pub(super) fn new(tree: Bvh) -> Self {
        let Bvh { mut nodes, triangle_order } = tree;
        for node in &mut nodes {
            if let Content::Leaf { first, .. } = &mut node.content {
                *first = triangle_order[*first as usize];
            }
        }
        Self { nodes, primitives: triangle_order.len() as u32, queue: BinaryHeap::new() }
    }

    pub(super) fn finish(self) -> Bvh {
        Bvh { nodes: self.nodes, triangle_order: (0..self.primitives).collect() }
    }

    /// Inserts a primitive with the next number.
    pub(super) fn insert(&mut self, aabb: Aabb) {
        let target = self.best_place(&aabb);
        let leaf = self.nodes.len() as u32;
        let inner = leaf + 1;
        let content = Content::Leaf { first: self.primitives, count: 1 };
        self.primitives += 1;
        self.nodes.push(BvhNode { aabb, parent: inner, content });
        let united = self.nodes[target as usize].aabb.union(aabb);
        let above = self.nodes[target as usize].parent;
        if target == ROOT {
            // The root keeps its number: what it was goes elsewhere.
            let was = BvhNode { parent: ROOT, ..self.nodes[ROOT as usize] };
            self.nodes.push(was);
            if let Content::Internal { left, right } = was.content {
                self.nodes[left as usize].parent = inner;
                self.nodes[right as usize].parent = inner;
            }
            let content = Content::Internal { left: inner, right: leaf };
            self.nodes[ROOT as usize] = BvhNode { aabb: united, parent: NO_NODE, content };
            self.nodes[leaf as usize].parent = ROOT;
            return;
        }
        let content = Content::Internal { left: target, right: leaf };
        self.nodes.push(BvhNode { aabb: united, parent: above, content });
        self.nodes[target as usize].parent = inner;
        self.replace_child(above, target, inner);
        let mut v = above;
        while v != NO_NODE {
            let node = &mut self.nodes[v as usize];
            node.aabb = node.aabb.union(aabb);
            v = node.parent;
        }
    }

    /// The node that a leaf with the box `aabb` costs least beside.
    fn best_place(&mut self, aabb: &Aabb) -> u32 {
        let area = aabb.half_area();
        let (mut best, mut best_cost) = (ROOT, f32::INFINITY);
        self.queue.clear();
        self.queue.push(Reverse(u64::from(ROOT)));
        while let Some(Reverse(key)) = self.queue.pop() {
            let (induced, v) = (f32::from_bits((key >> 32) as u32), key as u32);
            if induced + area >= best_cost {
                break;
            }
            let node = &self.nodes[v as usize];
            let direct = node.aabb.union(*aabb).half_area();
            if induced + direct < best_cost {
                (best, best_cost) = (v, induced + direct);
            }
            if let Content::Internal { left, right } = node.content {
                let below = induced + (direct - node.aabb.half_area()).max(0.0);
                if below + area < best_cost {
                    let key = |child: u32| Reverse(u64::from(below.to_bits()) << 32 | u64::from(child));
                    self.queue.extend([key(left), key(right)]);
                }
            }
        }
        best
    }

    fn replace_child(&mut self, parent: u32, old: u32, new: u32) {
        if let Content::Internal { left, right } = &mut self.nodes[parent as usize].content {
            *(if *left == old { left } else { right }) = new;
        }
    }

    /// Takes primitives out; the others keep their order, and their numbers are those of a list from which these were removed. One at least stays.
    pub(super) fn remove(&mut self, is_out: &[bool]) {
        let leaf_of = |node: &BvhNode| match node.content {
            Content::Leaf { first, .. } => Some(first),
            Content::Internal { .. } => None,
        };
        let doomed: Vec<u32> = (0..self.nodes.len() as u32)
            .filter(|&v| leaf_of(&self.nodes[v as usize]).is_some_and(|primitive| is_out[primitive as usize]))
            .collect();
        let mut is_gone = vec![false; self.nodes.len()];
        for leaf in doomed {
            self.take_out(leaf, &mut is_gone);
        }
        let numbers = ranks(is_out);
        for node in &mut self.nodes {
            if let Content::Leaf { first, .. } = &mut node.content {
                *first = numbers[*first as usize];
            }
        }
        self.primitives -= is_out.iter().filter(|&&is_out| is_out).count() as u32;
        self.close_ranks(&is_gone);
    }

    /// Takes a leaf and its parent out.
    fn take_out(&mut self, leaf: u32, is_gone: &mut [bool]) {
        let parent = self.nodes[leaf as usize].parent;
        let Content::Internal { left, right } = self.nodes[parent as usize].content else { return };
        let sibling = if left == leaf { right } else { left };
        is_gone[leaf as usize] = true;
        if parent == ROOT {
            // The root keeps its number and becomes the sibling.
            let moved = BvhNode { parent: NO_NODE, ..self.nodes[sibling as usize] };
            if let Content::Internal { left, right } = moved.content {
                self.nodes[left as usize].parent = ROOT;
                self.nodes[right as usize].parent = ROOT;
            }
            self.nodes[ROOT as usize] = moved;
            is_gone[sibling as usize] = true;
            return;
        }
        is_gone[parent as usize] = true;
        let above = self.nodes[parent as usize].parent;
        self.nodes[sibling as usize].parent = above;
        self.replace_child(above, parent, sibling);
        let mut v = above;
        while v != NO_NODE {
            let Content::Internal { left, right } = self.nodes[v as usize].content else { break };
            let aabb = self.nodes[left as usize].aabb.union(self.nodes[right as usize].aabb);
            if std::mem::replace(&mut self.nodes[v as usize].aabb, aabb) == aabb {
                break;
            }
            v = self.nodes[v as usize].parent;
        }
    }

    fn close_ranks(&mut self, is_gone: &[bool]) {
        let numbers = ranks(is_gone);
        let mut v = 0;
        self.nodes.retain(|_| {
            v += 1;
            !is_gone[v - 1]
        });
        let new = |link: &mut u32| {
            if *link != NO_NODE {
                *link = numbers[*link as usize];
            }
        };
        for node in &mut self.nodes {
            new(&mut node.parent);
            if let Content::Internal { left, right } = &mut node.content {
                new(left);
                new(right);
            }
        }
    }
}

/// How many before each stay.
fn ranks(is_out: &[bool]) -> Vec<u32> {
    let mut next = 0;
    let rank = |&is_out: &bool| {
        let rank = next;
        next += u32::from(!is_out);
        rank
    };
    is_out.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::sah_sweep;
    use crate::bvh::{SahModel, quality, validate};
    use crate::scene::{built_in, stand_in};
    use prbvh_kernel::setup::Triangle;
    use proptest::prelude::*;

    fn edited(triangles: &[Triangle]) -> Edited {
        Edited::new(Bvh::from_device(&sah_sweep(triangles)).unwrap().with_boxes_of(triangles))
    }

    fn cost_beside(tree: &Bvh, target: u32, aabb: Aabb) -> f64 {
        let half_area = |aabb: &Aabb| f64::from(aabb.half_area());
        let mut cost = half_area(&tree.nodes[target as usize].aabb.union(aabb));
        let mut v = tree.nodes[target as usize].parent;
        while v != NO_NODE {
            let have = tree.nodes[v as usize].aabb;
            cost += half_area(&have.union(aabb)) - half_area(&have);
            v = tree.nodes[v as usize].parent;
        }
        cost
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn what_comes_and_goes_leaves_a_tree(n in 1usize..40, more in 0usize..40, out in prop::collection::vec(any::<bool>(), 80)) {
            let all = built_in(1000).triangles;
            let mut triangles = all[..n].to_vec();
            let mut tree = edited(&triangles);
            for triangle in &all[500..500 + more] {
                tree.insert(triangle.aabb());
                triangles.push(*triangle);
            }
            let mut is_out = out[..triangles.len()].to_vec();
            is_out[0] = false;
            tree.remove(&is_out);
            let mut at = is_out.iter();
            triangles.retain(|_| !at.next().unwrap());
            let tree = tree.finish();
            prop_assert_eq!(validate(&tree, Some(&triangles)).map(|stats| stats.triangles as usize), Ok(triangles.len()));
        }

        #[test]
        fn no_place_costs_less(n in 1usize..60, k in 500usize..1000) {
            let all = built_in(1000).triangles;
            let mut tree = edited(&all[..n]);
            let aabb = all[k].aabb();
            let best = tree.best_place(&aabb);
            let tree = tree.finish();
            let costs: Vec<f64> = (0..tree.nodes.len() as u32).map(|v| cost_beside(&tree, v, aabb)).collect();
            let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert!(costs[best as usize] <= least * (1.0 + 1e-5), "{} is not {}", costs[best as usize], least);
        }
    }

    #[test]
    fn trees_grown_one_by_one_are_good() {
        let boxes: Vec<Aabb> = built_in(3000).triangles.iter().map(Triangle::aabb).collect();
        let stand_ins: Vec<Triangle> = boxes.iter().map(stand_in).collect();
        let mut tree = edited(&stand_ins[..1]);
        boxes[1..].iter().for_each(|&aabb| tree.insert(aabb));
        let tree = tree.finish();
        validate(&tree, Some(&stand_ins)).unwrap();
        let cost = |tree: &Bvh| quality(tree, &SahModel::default()).sah_cost;
        let swept = edited(&stand_ins).finish();
        assert!(cost(&tree) < 1.5 * cost(&swept), "{} against {}", cost(&tree), cost(&swept));
    }
}

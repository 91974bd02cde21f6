//! Is it a tree, is every triangle in it once, and are its boxes right?

use super::{Bvh, Content, Link, NO_NODE, ROOT, TreeFault};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::RIGHT;
use prbvh_kernel::setup::Triangle;

/// What [`validate`] counted on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TreeStats {
    /// Triangles.
    pub triangles: u32,
    /// Nodes, leaves included.
    pub nodes: u32,
    /// Leaves.
    pub leaves: u32,
    /// Most links between the root and a leaf; 0 for a tree of one node.
    pub max_depth: u32,
}

/// Checks that
/// - links are mutual, lead from one root to every node, and make no cycle;
/// - every triangle is in exactly one leaf: of all `triangles`, or without them of as many as the triangle order is long;
/// - every box is finite and equals the union of its children's; with `triangles` also that a leaf's box equals the union of its
///   triangles'. Equal means bit for bit, but -0.0 and +0.0 are taken as one: they bound the same.
///
/// # Errors
/// All faults, structure before boxes.
pub fn validate(tree: &Bvh, triangles: Option<&[Triangle]>) -> Result<TreeStats, Vec<TreeFault>> {
    let mut check = Check::new(tree, triangles.map_or(tree.triangle_order.len(), <[Triangle]>::len));
    check.structure();
    if !tree.nodes.is_empty() {
        check.boxes(triangles);
    }
    check.finish()
}

/// The faults of links and leaves of a tree that is to hold `triangles` triangles, without boxes.
#[must_use]
pub fn links_and_leaves(tree: &Bvh, triangles: usize) -> Vec<TreeFault> {
    let mut check = Check::new(tree, triangles);
    check.structure();
    check.faults
}

/// The faults of links and leaves alone, without boxes.
pub(super) fn structure_faults(tree: &Bvh) -> Vec<TreeFault> {
    links_and_leaves(tree, tree.triangle_order.len())
}

/// Those of links and of ranges, whatever triangles are in these.
pub(super) fn link_faults(tree: &Bvh) -> Vec<TreeFault> {
    let most = tree.triangle_order.iter().max().map_or(0, |&id| id as usize + 1);
    let mut check = Check::with_repeats_and_gaps(tree, most);
    check.structure();
    check.faults
}

/// How far the walk is with a node.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Visit {
    Not,
    /// The walk is below it.
    Open,
    Done,
}

pub(super) struct Check<'a> {
    tree: &'a Bvh,
    triangles: usize,
    /// Whether a triangle may be in several leaves, and whether one may be in none.
    may_repeat: bool,
    may_miss: bool,
    faults: Vec<TreeFault>,
    visits: Vec<Visit>,
    max_depth: u32,
    /// Leaves whose range can be followed.
    sound_leaf: Vec<bool>,
}

impl<'a> Check<'a> {
    fn new(tree: &'a Bvh, triangles: usize) -> Self {
        let (faults, visits, sound_leaf) = (Vec::new(), Vec::new(), Vec::new());
        Self { tree, triangles, may_repeat: false, may_miss: false, faults, visits, max_depth: 0, sound_leaf }
    }

    /// Triangles may be in several leaves.
    pub(super) fn with_repeats(tree: &'a Bvh, triangles: usize) -> Self {
        Self { may_repeat: true, ..Self::new(tree, triangles) }
    }

    /// The same, and in none.
    pub(super) fn with_repeats_and_gaps(tree: &'a Bvh, triangles: usize) -> Self {
        Self { may_miss: true, ..Self::with_repeats(tree, triangles) }
    }

    pub(super) fn finish(self) -> Result<TreeStats, Vec<TreeFault>> {
        let nodes = &self.tree.nodes;
        if !self.faults.is_empty() {
            return Err(self.faults);
        }
        Ok(TreeStats {
            triangles: self.tree.triangle_order.len() as u32,
            nodes: nodes.len() as u32,
            leaves: nodes.iter().filter(|node| matches!(node.content, Content::Leaf { .. })).count() as u32,
            max_depth: self.max_depth,
        })
    }

    fn count(&self) -> u32 {
        self.tree.nodes.len() as u32
    }

    pub(super) fn structure(&mut self) {
        let nodes = self.tree.nodes.len();
        if nodes == 0 || nodes >= RIGHT as usize {
            self.faults.push(TreeFault::NodeCount { nodes });
            return;
        }
        for v in 0..self.count() {
            self.links(v);
        }
        self.reach();
        self.leaves();
    }

    /// Links of `v`, each in both directions.
    fn links(&mut self, v: u32) {
        let nodes = &self.tree.nodes;
        let node = nodes[v as usize];
        let count = self.count();
        if v == ROOT {
            if node.parent != NO_NODE {
                self.faults.push(TreeFault::RootParent { parent: node.parent });
            }
        } else if node.parent == NO_NODE {
            self.faults.push(TreeFault::ExtraRoot { node: v });
        } else if let Some(parent) = nodes.get(node.parent as usize) {
            if !matches!(parent.content, Content::Internal { left, right } if left == v || right == v) {
                self.faults.push(TreeFault::ChildOfParent { node: v, parent: node.parent });
            }
        } else {
            self.faults.push(TreeFault::LinkOutOfRange {
                node: v,
                link: Link::Parent,
                value: node.parent,
                nodes: count,
            });
        }
        let Content::Internal { left, right } = node.content else { return };
        if left == right {
            self.faults.push(TreeFault::SameChildren { node: v, child: left });
        }
        for (link, child) in [(Link::Left, left), (Link::Right, right)] {
            if child == ROOT {
                self.faults.push(TreeFault::RootIsChild { node: v });
            } else if let Some(to) = nodes.get(child as usize) {
                if to.parent != v {
                    self.faults.push(TreeFault::ParentOfChild { node: v, child, parent: to.parent });
                }
            } else {
                self.faults.push(TreeFault::LinkOutOfRange { node: v, link, value: child, nodes: count });
            }
        }
    }

    /// Walks from the root, then from whatever that did not reach.
    fn reach(&mut self) {
        self.visits = vec![Visit::Not; self.tree.nodes.len()];
        self.max_depth = self.walk(ROOT);
        let lost: Vec<u32> = (0..self.count()).filter(|&v| self.visits[v as usize] == Visit::Not).collect();
        for node in lost {
            self.faults.push(TreeFault::Unreachable { node });
            if self.visits[node as usize] == Visit::Not {
                self.walk(node);
            }
        }
    }

    /// Walks depth-first from `start` and returns the depth. A node met again while the walk is below it is in a cycle.
    fn walk(&mut self, start: u32) -> u32 {
        const LEAVE: u32 = 0x8000_0000;
        let mut stack = vec![start];
        let (mut depth, mut deepest) = (0, 0);
        while let Some(entry) = stack.pop() {
            let v = entry & !LEAVE;
            if entry & LEAVE != 0 {
                self.visits[v as usize] = Visit::Done;
                depth -= 1;
                continue;
            }
            match self.visits[v as usize] {
                Visit::Open => self.faults.push(TreeFault::Cycle { node: v }),
                // From elsewhere than the root the walk may run into what an earlier one saw.
                Visit::Done if start == ROOT => self.faults.push(TreeFault::Shared { node: v }),
                Visit::Done => {}
                Visit::Not => match self.tree.nodes[v as usize].content {
                    Content::Internal { left, right } => {
                        self.visits[v as usize] = Visit::Open;
                        depth += 1;
                        stack.push(v | LEAVE);
                        let exists = |child: &u32| (*child as usize) < self.tree.nodes.len();
                        stack.extend([right, left].iter().filter(|child| exists(child)));
                    }
                    Content::Leaf { .. } => {
                        self.visits[v as usize] = Visit::Done;
                        deepest = deepest.max(depth);
                    }
                },
            }
        }
        deepest
    }

    /// Every position in one leaf, every triangle at one position. Linear in the positions however the leaves overlap.
    fn leaves(&mut self) {
        let positions = self.tree.triangle_order.len();
        let mut holder = vec![NO_NODE; positions];
        self.sound_leaf = vec![false; self.tree.nodes.len()];
        for (v, node) in self.tree.nodes.iter().enumerate() {
            let Content::Leaf { first, count } = node.content else { continue };
            let v32 = v as u32;
            let Some(range) = holder.get_mut(first as usize..).and_then(|rest| rest.get_mut(..count as usize)) else {
                self.faults.push(TreeFault::LeafRange { node: v32, first, count, positions });
                continue;
            };
            if range.is_empty() {
                self.faults.push(TreeFault::EmptyLeaf { node: v32 });
                continue;
            }
            match range.iter().position(|&other| other != NO_NODE) {
                Some(k) => {
                    let (other, position) = (range[k], first + k as u32);
                    range[..k].fill(v32);
                    self.faults.push(TreeFault::PositionShared { node: v32, other, position });
                }
                None => {
                    range.fill(v32);
                    self.sound_leaf[v] = true;
                }
            }
        }
        self.triangles(&holder);
    }

    fn triangles(&mut self, holder: &[u32]) {
        let mut leaf_of = vec![NO_NODE; self.triangles];
        for (position, (&triangle, &node)) in self.tree.triangle_order.iter().zip(holder).enumerate() {
            if node == NO_NODE {
                self.faults.push(TreeFault::PositionUnused { position: position as u32 });
            } else if let Some(leaf) = leaf_of.get_mut(triangle as usize) {
                if *leaf == NO_NODE {
                    *leaf = node;
                } else if !self.may_repeat {
                    self.faults.push(TreeFault::TriangleTwice { triangle, first: *leaf, second: node });
                }
            } else {
                self.faults.push(TreeFault::TriangleOutOfRange { node, triangle, triangles: self.triangles });
                self.sound_leaf[node as usize] = false;
            }
        }
        if self.may_miss {
            return;
        }
        let missing = (0..self.triangles as u32).filter(|&triangle| leaf_of[triangle as usize] == NO_NODE);
        self.faults.extend(missing.map(|triangle| TreeFault::TriangleMissing { triangle }));
    }

    /// Boxes of leaves that are none.
    pub(super) fn leaf_boxes(&mut self) {
        for (v, node) in (0..).zip(&self.tree.nodes) {
            if matches!(node.content, Content::Leaf { .. }) {
                self.own_box(v, node.aabb);
            }
        }
    }

    /// Whether the box of `v` is finite; a fault if not, or if it is inverted.
    fn own_box(&mut self, v: u32, aabb: Aabb) -> bool {
        if !finite(&aabb) {
            self.faults.push(TreeFault::NotFinite { node: v, aabb });
            return false;
        }
        if (0..3).any(|k| aabb.min[k] > aabb.max[k]) {
            self.faults.push(TreeFault::Inverted { node: v, aabb });
        }
        true
    }

    pub(super) fn boxes(&mut self, triangles: Option<&[Triangle]>) {
        let nodes = &self.tree.nodes;
        for (v, node) in (0..).zip(nodes) {
            let have = node.aabb;
            if !self.own_box(v, have) {
                continue;
            }
            match node.content {
                Content::Internal { left, right } => {
                    let (Some(left), Some(right)) = (nodes.get(left as usize), nodes.get(right as usize)) else {
                        continue;
                    };
                    // A child that is not finite has a fault of its own.
                    if !finite(&left.aabb) || !finite(&right.aabb) {
                        continue;
                    }
                    let need = left.aabb.union(right.aabb);
                    if need != have {
                        self.faults.push(TreeFault::BoxOfChildren { node: v, have, need });
                    }
                }
                Content::Leaf { first, count } => {
                    let Some(triangles) = triangles.filter(|_| self.sound_leaf[v as usize]) else { continue };
                    let boxes = self.tree.triangles_of(first, count).iter().map(|&t| triangles[t as usize].aabb());
                    let need = boxes.fold(Aabb::EMPTY, Aabb::union);
                    if need != have {
                        self.faults.push(TreeFault::BoxOfTriangles { node: v, have, need });
                    }
                }
            }
        }
    }
}

fn finite(aabb: &Aabb) -> bool {
    aabb.min.iter().chain(&aabb.max).all(|x| x.is_finite())
}

#[cfg(test)]
#[path = "validate_tests.rs"]
mod tests;

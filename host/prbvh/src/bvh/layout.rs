//! The canonical layout of a tree: siblings side by side, 32 bytes a node.
//!
//! Source: Wald 2007, §4. The order depends on nothing but the tree: internal nodes are visited depth-first, left before right, and
//! each visit appends its two children; leaves take their triangles in the same order. So equal trees are equal bytes.

use super::validate::links_and_leaves;
use super::{Bvh, BvhNode, Content, NO_NODE, ROOT, TreeFault, without_negative_zeros};
use bytemuck::{Pod, Zeroable};
use prbvh_kernel::aabb::Aabb;

/// A node of a [`FlatTree`], 32 bytes without padding. Two siblings are one cache line where the array starts at one and a
/// child's number is even.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FlatNode {
    /// Smallest corner of the box, scene units.
    pub min: [f32; 3],
    /// Internal: the left child, whose sibling is the next node. Leaf: its first position in the triangle order.
    pub first: u32,
    /// Largest corner of the box, scene units.
    pub max: [f32; 3],
    /// Internal: 0. Leaf: its triangles.
    pub count: u32,
}

impl FlatNode {
    fn new(aabb: Aabb, first: u32, count: u32) -> Self {
        // Equal trees must be equal bytes, also where a device left a -0.0.
        let aabb = without_negative_zeros(aabb);
        Self { min: aabb.min, first, max: aabb.max, count }
    }

    /// Its box.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    /// Its children or triangles.
    #[must_use]
    pub fn content(&self) -> Content {
        match self.count {
            0 => Content::Internal { left: self.first, right: self.first.wrapping_add(1) },
            count => Content::Leaf { first: self.first, count },
        }
    }
}

/// A tree as two arrays, which `bytemuck` casts to bytes: what `tree.bvh` holds, without the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlatTree {
    /// `[nodes]`; the root is the first.
    pub nodes: Vec<FlatNode>,
    /// Triangle ids, leaf by leaf, `[n]`.
    pub order: Vec<u32>,
}

impl FlatTree {
    /// The tree in the canonical layout. Children come after their parents.
    ///
    /// # Panics
    /// If the links are no tree.
    #[must_use]
    pub fn new(tree: &Bvh) -> Self {
        let mut nodes = vec![FlatNode::zeroed(); tree.nodes.len()];
        let mut order = Vec::with_capacity(tree.triangle_order.len());
        let mut next = ROOT + 1;
        let mut stack = vec![(ROOT, ROOT)];
        while let Some((from, to)) = stack.pop() {
            let node = &tree.nodes[from as usize];
            // A walk in a ring ends here too: its numbers leave the array.
            nodes[to as usize] = match node.content {
                Content::Internal { left, right } => {
                    let first = next;
                    next += 2;
                    stack.push((right, first + 1));
                    stack.push((left, first));
                    FlatNode::new(node.aabb, first, 0)
                }
                Content::Leaf { first, count } => {
                    let start = order.len() as u32;
                    order.extend_from_slice(tree.triangles_of(first, count));
                    FlatNode::new(node.aabb, start, count)
                }
            };
        }
        assert_eq!(next as usize, tree.nodes.len(), "the links are no tree");
        Self { nodes, order }
    }

    /// The words of the machine as those of a file: little-endian. Does nothing on most machines.
    pub(super) fn into_little_endian(mut self) -> Self {
        if cfg!(target_endian = "big") {
            let nodes: &mut [u32] = bytemuck::cast_slice_mut(&mut self.nodes);
            nodes.iter_mut().chain(&mut self.order).for_each(|word| *word = word.to_le());
        }
        self
    }

    /// Nodes, then triangle order.
    #[must_use]
    pub fn bytes(&self) -> [&[u8]; 2] {
        [bytemuck::cast_slice(&self.nodes), bytemuck::cast_slice(&self.order)]
    }
}

impl Bvh {
    /// The tree that boxes, contents and a triangle order make, with its parents; node 0 is the root. Nodes may come in any order, and
    /// positions of the order that no leaf holds are dropped.
    ///
    /// # Errors
    /// All faults of the links and of the ranges of leaves. Nothing is asked of boxes and of triangle ids, which spatial splits put into
    /// several leaves: [`validate`](super::validate()) asks the rest.
    pub fn from_parts(
        nodes: impl IntoIterator<Item = (Aabb, Content)>,
        order: impl Into<Vec<u32>>,
    ) -> Result<Self, Vec<TreeFault>> {
        let node = |(aabb, content)| BvhNode { aabb, parent: NO_NODE, content };
        let mut tree = Self { nodes: nodes.into_iter().map(node).collect(), triangle_order: order.into() };
        for v in 0..tree.nodes.len() {
            let Content::Internal { left, right } = tree.nodes[v].content else { continue };
            for child in [left, right] {
                // A root that is a child is a fault of that link, and of no other.
                if let Some(child) = tree.nodes.get_mut(child as usize).filter(|_| child != ROOT) {
                    child.parent = v as u32;
                }
            }
        }
        let mut faults = links_and_leaves(&tree, tree.triangle_order.len());
        let unused = faults.iter().any(|fault| matches!(fault, TreeFault::PositionUnused { .. }));
        faults.retain(|fault| !is_of_triangles(fault));
        if !faults.is_empty() {
            return Err(faults);
        }
        if unused {
            tree.drop_unused_positions();
        }
        Ok(tree)
    }

    /// The tree of flat nodes in any order: those of a [`FlatTree`], of a mapped file, of another program. The root is the first.
    ///
    /// # Errors
    /// As [`Bvh::from_parts`].
    pub fn from_flat(nodes: &[FlatNode], order: &[u32]) -> Result<Self, Vec<TreeFault>> {
        Self::from_parts(nodes.iter().map(|node| (node.aabb(), node.content())), order)
    }

    fn drop_unused_positions(&mut self) {
        let mut used = Vec::with_capacity(self.triangle_order.len());
        for node in &mut self.nodes {
            if let Content::Leaf { first, count } = &mut node.content {
                let held = *first as usize..(*first + *count) as usize;
                *first = used.len() as u32;
                used.extend_from_slice(&self.triangle_order[held]);
            }
        }
        self.triangle_order = used;
    }
}

/// Whether a fault is one of the triangle order's content.
fn is_of_triangles(fault: &TreeFault) -> bool {
    matches!(
        fault,
        TreeFault::TriangleTwice { .. }
            | TreeFault::TriangleMissing { .. }
            | TreeFault::TriangleOutOfRange { .. }
            | TreeFault::PositionUnused { .. }
    )
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Rng, renumbered, tree};
    use super::super::{tree_hash, validate};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_tree_comes_back_from_its_slices(n in 1usize..200, seed: u64) {
            let (triangles, tree) = tree(n, seed);
            let flat = FlatTree::new(&renumbered(&tree, &mut Rng::new(seed)));
            let [nodes, order] = flat.bytes();
            let back = Bvh::from_flat(bytemuck::cast_slice(nodes), bytemuck::cast_slice(order)).unwrap();
            validate(&back, Some(&triangles)).unwrap();
            prop_assert_eq!(tree_hash(&back), tree_hash(&tree));
            prop_assert_eq!(FlatTree::new(&back), flat);
        }

        #[test]
        fn garbage_is_a_tree_or_has_faults(words in proptest::collection::vec((0u32..12, 0u32..3), 0..12)) {
            let nodes: Vec<FlatNode> =
                words.iter().map(|&(first, count)| FlatNode { first, count, ..FlatNode::default() }).collect();
            match Bvh::from_flat(&nodes, &[0, 1, 2, 3]) {
                Ok(tree) => prop_assert_eq!(FlatTree::new(&tree).nodes.len(), nodes.len()),
                Err(faults) => prop_assert!(!faults.is_empty()),
            }
        }
    }

    fn leaf(first: u32, count: u32) -> FlatNode {
        FlatNode { first, count, ..FlatNode::default() }
    }

    #[test]
    fn positions_in_no_leaf_are_dropped_and_triangles_may_be_in_several() {
        let nodes = [leaf(1, 0), leaf(3, 2), leaf(1, 1)];
        let tree = Bvh::from_flat(&nodes, &[u32::MAX, 5, u32::MAX, 5, 7]).unwrap();
        assert_eq!(tree.triangle_order, [5, 7, 5]);
        let contents: Vec<Content> = tree.nodes[1..].iter().map(|node| node.content).collect();
        assert_eq!(contents, [Content::Leaf { first: 0, count: 2 }, Content::Leaf { first: 2, count: 1 }]);
    }

    #[test]
    fn planted_faults_are_named() {
        let faults = |nodes: &[FlatNode]| Bvh::from_flat(nodes, &[0, 1]).unwrap_err();
        assert_eq!(faults(&[]), [TreeFault::NodeCount { nodes: 0 }]);
        let range = TreeFault::LeafRange { node: 2, first: 1, count: 2, positions: 2 };
        assert_eq!(faults(&[leaf(1, 0), leaf(0, 1), leaf(1, 2)]), [range]);
        let shared = TreeFault::PositionShared { node: 2, other: 1, position: 0 };
        assert_eq!(faults(&[leaf(1, 0), leaf(0, 1), leaf(0, 2)]), [shared]);
        assert!(faults(&[leaf(0, 0), leaf(0, 1)]).contains(&TreeFault::RootIsChild { node: 0 }));
        assert!(faults(&[leaf(u32::MAX, 0)]).len() > 1);
    }
}

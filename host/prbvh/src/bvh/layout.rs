//! The canonical layout of a tree: siblings side by side, 32 bytes a node.
//!
//! Source: Wald 2007, §4. The order depends on nothing but the tree: internal nodes are visited depth-first, left before right, and
//! each visit appends its two children; leaves take their triangles in the same order. So equal trees are equal bytes.

use super::{Bvh, Content, ROOT, without_negative_zeros};
use bytemuck::{Pod, Zeroable};
use prbvh_kernel::aabb::Aabb;

/// A node as the file has it, every word little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct LayoutNode {
    pub(super) min: [u32; 3],
    /// Internal: the left child, whose sibling is the next node. Leaf: its first position in the triangle order.
    pub(super) first: u32,
    pub(super) max: [u32; 3],
    /// Internal: 0. Leaf: its triangles.
    pub(super) count: u32,
}

impl LayoutNode {
    fn new(aabb: Aabb, first: u32, count: u32) -> Self {
        // Equal trees must be equal bytes, also where a device left a -0.0.
        let aabb = without_negative_zeros(aabb);
        let bits = |corner: [f32; 3]| corner.map(|x| x.to_bits().to_le());
        Self { min: bits(aabb.min), first: first.to_le(), max: bits(aabb.max), count: count.to_le() }
    }
}

/// A tree in the canonical layout.
pub(super) struct Layout {
    nodes: Vec<LayoutNode>,
    /// Little-endian.
    order: Vec<u32>,
}

impl Layout {
    /// # Panics
    /// If the links are no tree.
    pub(super) fn new(tree: &Bvh) -> Self {
        let mut nodes = vec![LayoutNode::zeroed(); tree.nodes.len()];
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
                    LayoutNode::new(node.aabb, first, 0)
                }
                Content::Leaf { first, count } => {
                    let start = order.len() as u32;
                    order.extend(tree.triangles_of(first, count).iter().map(|t| t.to_le()));
                    LayoutNode::new(node.aabb, start, count)
                }
            };
        }
        assert_eq!(next as usize, tree.nodes.len(), "the links are no tree");
        Self { nodes, order }
    }

    /// Nodes, then triangle order.
    pub(super) fn bytes(&self) -> [&[u8]; 2] {
        [bytemuck::cast_slice(&self.nodes), bytemuck::cast_slice(&self.order)]
    }
}

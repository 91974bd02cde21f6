//! tinybvh 1.6: the nodes of `BVH` (Wald's 32 bytes) and of `BVH_GPU` (the 64 bytes of Aila & Laine), as its header documents them.
//!
//! Both hold `u32` and `f32` of the machine, so that the slices are the library's own arrays byte for byte: `bvhNode`, and the triangle
//! order as `primIdx`.

use crate::bvh::{Bvh, BvhNode, Content, FlatNode, FlatTree, TreeFault};
use bytemuck::{Pod, Zeroable};
use prbvh_kernel::aabb::Aabb;

/// A node of `BVH`, 32 bytes: `aabbMin`, `leftFirst`, `aabbMax`, `triCount`. It is the node of our own files.
pub type WaldNode = FlatNode;

/// A node of `BVH_GPU`, 64 bytes: the boxes are those of the children.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GpuNode {
    /// Smallest corner of the left child; meaningless in a leaf.
    pub left_min: [f32; 3],
    /// Left child.
    pub left: u32,
    /// Largest corner of the left child.
    pub left_max: [f32; 3],
    /// Right child.
    pub right: u32,
    /// Smallest corner of the right child.
    pub right_min: [f32; 3],
    /// Internal: 0. Leaf: its triangles.
    pub count: u32,
    /// Largest corner of the right child.
    pub right_max: [f32; 3],
    /// Leaf: first position in the triangle order.
    pub first: u32,
}

/// The tree as the nodes of `BVH` and its triangle order. Node 1 is left empty, as tinybvh leaves it, so that siblings share a cache line;
/// a tree of one node is that node alone.
///
/// # Panics
/// If the links are no tree.
#[must_use]
pub fn to_wald(tree: &Bvh) -> (Vec<WaldNode>, Vec<u32>) {
    let FlatTree { mut nodes, order } = FlatTree::new(tree);
    if nodes.len() > 1 {
        // All children move by one.
        nodes.iter_mut().filter(|node| node.count == 0).for_each(|node| node.first += 1);
        nodes.insert(1, WaldNode::default());
    }
    (nodes, order)
}

/// The tree of `BVH`'s nodes, `usedNodes` of them. An even number has the empty node 1 in it, since a binary tree has an odd one.
///
/// # Errors
/// As [`Bvh::from_parts`]; its faults count the nodes without the empty one.
pub fn from_wald(nodes: &[WaldNode], order: &[u32]) -> Result<Bvh, Vec<TreeFault>> {
    match nodes {
        [root, _, rest @ ..] if nodes.len().is_multiple_of(2) => {
            let moved = |node: &WaldNode| match node.count {
                0 => WaldNode { first: node.first.wrapping_sub(1), ..*node },
                _ => *node,
            };
            let nodes: Vec<WaldNode> = std::iter::once(root).chain(rest).map(moved).collect();
            Bvh::from_flat(&nodes, order)
        }
        _ => Bvh::from_flat(nodes, order),
    }
}

/// The tree as the nodes of `BVH_GPU` and its triangle order, children after their parents.
///
/// # Panics
/// If the links are no tree.
#[must_use]
pub fn to_gpu(tree: &Bvh) -> (Vec<GpuNode>, Vec<u32>) {
    let flat = FlatTree::new(tree);
    let node = |node: &FlatNode| match node.content() {
        Content::Internal { left, right } => {
            let [l, r] = [left, right].map(|child| &flat.nodes[child as usize]);
            GpuNode {
                left_min: l.min,
                left,
                left_max: l.max,
                right,
                right_min: r.min,
                count: 0,
                right_max: r.max,
                first: 0,
            }
        }
        Content::Leaf { first, count } => GpuNode { count, first, ..GpuNode::default() },
    };
    (flat.nodes.iter().map(node).collect(), flat.order)
}

/// The tree of `BVH_GPU`'s nodes. That of a single leaf has no box: it is [`Aabb::EMPTY`] until [`Bvh::with_boxes_of`] makes one.
///
/// # Errors
/// As [`Bvh::from_parts`].
pub fn from_gpu(nodes: &[GpuNode], order: &[u32]) -> Result<Bvh, Vec<TreeFault>> {
    let content = |node: &GpuNode| match node.count {
        0 => Content::Internal { left: node.left, right: node.right },
        count => Content::Leaf { first: node.first, count },
    };
    let mut tree = Bvh::from_parts(nodes.iter().map(|node| (Aabb::EMPTY, content(node))), order)?;
    for (v, node) in nodes.iter().enumerate().filter(|(_, node)| node.count == 0) {
        let left = Aabb { min: node.left_min, max: node.left_max };
        let right = Aabb { min: node.right_min, max: node.right_max };
        for (child, aabb) in [(node.left, left), (node.right, right)] {
            tree.nodes[child as usize].aabb = aabb;
        }
        if v == 0 {
            tree.nodes[0] = BvhNode { aabb: left.union(right), ..tree.nodes[0] };
        }
    }
    Ok(tree)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::testing::tree;
    use crate::bvh::{tree_hash, validate};

    #[test]
    fn both_layouts_give_the_tree_back() {
        assert_eq!((size_of::<WaldNode>(), size_of::<GpuNode>()), (32, 64));
        for (n, seed) in [(1, 5), (2, 6), (3, 7), (500, 8)] {
            let (triangles, tree) = tree(n, seed);
            let (nodes, order) = to_wald(&tree);
            let back = from_wald(&nodes, &order).unwrap();
            assert_eq!(tree_hash(&back), tree_hash(&tree));
            // As the library itself numbers its nodes where it does not leave one empty.
            let flat = FlatTree::new(&tree);
            assert_eq!(tree_hash(&from_wald(&flat.nodes, &flat.order).unwrap()), tree_hash(&tree));

            let (nodes, order) = to_gpu(&tree);
            let back = from_gpu(&nodes, &order).unwrap().with_boxes_of(&triangles);
            assert_eq!(tree_hash(&back), tree_hash(&tree));
        }
    }

    #[test]
    fn boxes_come_with_the_nodes() {
        let (triangles, tree) = tree(100, 9);
        let (nodes, order) = to_gpu(&tree);
        validate(&from_gpu(&nodes, &order).unwrap(), Some(&triangles)).unwrap();
    }

    #[test]
    fn siblings_share_a_cache_line() {
        let (nodes, _) = to_wald(&tree(64, 10).1);
        assert_eq!(nodes[1], WaldNode::default());
        assert!(nodes.iter().enumerate().all(|(v, node)| v == 1 || node.count > 0 || node.first % 2 == 0));
    }

    #[test]
    fn planted_faults_are_found() {
        let (_, tree) = tree(20, 11);
        let (mut nodes, order) = to_wald(&tree);
        nodes[0].first = 4;
        assert!(from_wald(&nodes, &order).is_err());
        let (mut nodes, order) = to_gpu(&tree);
        nodes[0].right = nodes[0].left;
        assert!(from_gpu(&nodes, &order).is_err());
        assert!(from_gpu(&[], &order).is_err() && from_wald(&[], &order).is_err());
    }
}

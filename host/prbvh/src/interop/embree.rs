//! Embree 4. It takes no tree from outside through its API: an application has either the nodes that it makes itself in the callbacks of
//! `rtcBuildBVH`, which [`build`](super::build) calls in Embree's place, or it walks nodes of Embree's layout, which [`to_bvh4`] makes.
//!
//! Layout: `kernels/bvh/bvh_node_aabb.h` and `bvh_node_ref.h` of Embree 4; it is internal there and may change.

use crate::bvh::{Bvh, Content, ROOT};
use bytemuck::{Pod, Zeroable};
use prbvh_kernel::aabb::Aabb;

/// `RTCBuildPrimitive`: a box on its way into `rtcBuildBVH`, 32 bytes, which the array must be aligned to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BuildPrimitive {
    /// `lower_x`, `lower_y`, `lower_z`.
    pub lower: [f32; 3],
    /// `geomID`.
    pub geometry: u32,
    /// `upper_x`, `upper_y`, `upper_z`.
    pub upper: [f32; 3],
    /// `primID`.
    pub primitive: u32,
}

impl BuildPrimitive {
    /// Primitive `primitive` of geometry 0.
    #[must_use]
    pub fn new(aabb: Aabb, primitive: u32) -> Self {
        Self { lower: aabb.min, geometry: 0, upper: aabb.max, primitive }
    }

    /// Its box.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        Aabb { min: self.lower, max: self.upper }
    }
}

/// `AABBNode` of `BVH4`, 128 bytes, which the array must be aligned to 16 of: four children, their boxes axis by axis. A place without a
/// child has [`NodeRef::EMPTY`] and the box of nothing, from +∞ to -∞.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node4 {
    /// The children.
    pub children: [NodeRef; 4],
    /// Smallest x of each child.
    pub lower_x: [f32; 4],
    /// Largest x of each child.
    pub upper_x: [f32; 4],
    /// Smallest y of each child.
    pub lower_y: [f32; 4],
    /// Largest y of each child.
    pub upper_y: [f32; 4],
    /// Smallest z of each child.
    pub lower_z: [f32; 4],
    /// Largest z of each child.
    pub upper_z: [f32; 4],
}

impl Node4 {
    /// No children.
    pub const EMPTY: Self = {
        let (lower, upper) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        Self {
            children: [NodeRef::EMPTY; 4],
            lower_x: lower,
            upper_x: upper,
            lower_y: lower,
            upper_y: upper,
            lower_z: lower,
            upper_z: upper,
        }
    };

    /// Box of child `k`, below 4.
    #[must_use]
    pub fn aabb(&self, k: usize) -> Aabb {
        Aabb {
            min: [self.lower_x[k], self.lower_y[k], self.lower_z[k]],
            max: [self.upper_x[k], self.upper_y[k], self.upper_z[k]],
        }
    }

    fn set(&mut self, k: usize, child: NodeRef, aabb: Aabb) {
        self.children[k] = child;
        [self.lower_x[k], self.lower_y[k], self.lower_z[k]] = aabb.min;
        [self.upper_x[k], self.upper_y[k], self.upper_z[k]] = aabb.max;
    }
}

/// `NodeRefPtr`: the address of a node or of a leaf's blocks of primitives, a multiple of 16, with what it is in its low four bits: 0 for
/// a node, 8 and the number of blocks for a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct NodeRef(pub u64);

impl NodeRef {
    /// No child: a leaf of no blocks.
    pub const EMPTY: Self = Self(8);
    /// Most blocks of a leaf.
    pub const MAX_BLOCKS: u32 = 7;

    /// A node at an address, or nothing if that is no multiple of 16.
    #[must_use]
    pub fn node(address: u64) -> Option<Self> {
        address.is_multiple_of(16).then_some(Self(address))
    }

    /// A leaf of `blocks` blocks of primitives from an address on, or nothing if that is no multiple of 16 or there are more than
    /// [`NodeRef::MAX_BLOCKS`].
    #[must_use]
    pub fn leaf(address: u64, blocks: u32) -> Option<Self> {
        let fits = address.is_multiple_of(16) && blocks <= Self::MAX_BLOCKS;
        fits.then(|| Self(address | 8 | u64::from(blocks)))
    }

    /// Address and blocks of a leaf.
    #[must_use]
    pub fn as_leaf(self) -> Option<(u64, u32)> {
        (self.0 & 8 != 0).then_some((self.0 & !15, self.0 as u32 & 7))
    }
}

/// Why a tree has no form in Embree's nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ToBvh4Error {
    /// The nodes would not lie where they can be referred to.
    #[error("nodes at address {address:#x}, but they must be aligned to 16 bytes")]
    Alignment {
        /// The address.
        address: u64,
    },
    /// The caller has no place for a leaf.
    #[error("no reference to the leaf of {count} triangles from position {first} on")]
    Leaf {
        /// First position in the triangle order.
        first: u32,
        /// Triangles.
        count: u32,
    },
}

/// The tree with up to four children a node: of each node the internal child with the largest box is opened, again and again, while there is
/// room. Returns a reference to the root and the nodes, which are to lie at address `nodes_at`; `leaf` gives the reference to a leaf's
/// triangles ([`NodeRef::leaf`]), first position and count.
///
/// # Errors
/// If `nodes_at` is no multiple of 16, or `leaf` returns nothing.
///
/// # Panics
/// If the links are no tree.
pub fn to_bvh4(
    tree: &Bvh,
    nodes_at: u64,
    mut leaf: impl FnMut(u32, u32) -> Option<NodeRef>,
) -> Result<(NodeRef, Vec<Node4>), ToBvh4Error> {
    let base = NodeRef::node(nodes_at).ok_or(ToBvh4Error::Alignment { address: nodes_at })?;
    let mut leaf_ref = |first, count| leaf(first, count).ok_or(ToBvh4Error::Leaf { first, count });
    if let Content::Leaf { first, count } = tree.nodes[ROOT as usize].content {
        return Ok((leaf_ref(first, count)?, Vec::new()));
    }
    let mut nodes = vec![Node4::EMPTY];
    let mut stack = vec![(ROOT, 0)];
    while let Some((v, at)) = stack.pop() {
        assert!(nodes.len() <= tree.nodes.len(), "the links are no tree");
        for (k, child) in opened(tree, v).into_iter().enumerate() {
            let node = &tree.nodes[child as usize];
            let reference = match node.content {
                Content::Leaf { first, count } => leaf_ref(first, count)?,
                Content::Internal { .. } => {
                    stack.push((child, nodes.len()));
                    nodes.push(Node4::EMPTY);
                    NodeRef(base.0 + ((nodes.len() - 1) * size_of::<Node4>()) as u64)
                }
            };
            nodes[at].set(k, reference, node.aabb);
        }
    }
    Ok((base, nodes))
}

/// Up to four nodes that together are an internal node.
fn opened(tree: &Bvh, v: u32) -> Vec<u32> {
    let mut children = vec![v];
    while children.len() < 4 {
        let area = |child: &u32| tree.nodes[*child as usize].aabb.half_area();
        let internal = |child: &u32| matches!(tree.nodes[*child as usize].content, Content::Internal { .. });
        let largest = (0..children.len())
            .filter(|&k| internal(&children[k]))
            .max_by(|&a, &b| area(&children[a]).total_cmp(&area(&children[b])));
        let Some(k) = largest else { break };
        if let Content::Internal { left, right } = tree.nodes[children[k] as usize].content {
            children.splice(k..=k, [left, right]);
        }
    }
    children
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::testing::tree;

    const NODES_AT: u64 = 0x1000;

    /// A leaf's blocks are 16 bytes each, one for a triangle.
    fn leaf(first: u32, count: u32) -> Option<NodeRef> {
        NodeRef::leaf(u64::from(first) * 16, count)
    }

    /// Checks that boxes hold what is below them; the triangles below a node, in order.
    fn below(
        nodes: &[Node4],
        at: NodeRef,
        aabb: Aabb,
        tree: &Bvh,
        triangles: &[prbvh_kernel::setup::Triangle],
    ) -> Vec<u32> {
        if let Some((address, blocks)) = at.as_leaf() {
            let held = &tree.triangle_order[address as usize / 16..][..blocks as usize];
            assert!(held.iter().all(|&t| aabb.contains(triangles[t as usize].aabb())));
            return held.to_vec();
        }
        let node = &nodes[(at.0 - NODES_AT) as usize / size_of::<Node4>()];
        let mut found = Vec::new();
        for k in 0..4 {
            if node.children[k] == NodeRef::EMPTY {
                assert_eq!(node.aabb(k), Aabb::EMPTY);
                continue;
            }
            assert!(aabb.contains(node.aabb(k)));
            found.extend(below(nodes, node.children[k], node.aabb(k), tree, triangles));
        }
        found
    }

    #[test]
    fn every_triangle_is_below_the_root_once() {
        assert_eq!((size_of::<Node4>(), size_of::<BuildPrimitive>()), (128, 32));
        for (n, seed) in [(1, 1), (2, 2), (4, 3), (5, 4), (300, 5)] {
            let (triangles, tree) = tree(n, seed);
            let (root, nodes) = to_bvh4(&tree, NODES_AT, leaf).unwrap();
            let mut found = below(&nodes, root, tree.nodes[0].aabb, &tree, &triangles);
            found.sort_unstable();
            assert!(found.iter().copied().eq(0..n as u32), "{found:?}");
            assert!(nodes.len() < n.max(2) && (n < 5 || nodes.len() < 2 * n / 3), "{} nodes", nodes.len());
        }
    }

    #[test]
    fn what_has_no_form_is_named() {
        let (_, tree) = tree(9, 6);
        assert_eq!(to_bvh4(&tree, 8, leaf).unwrap_err(), ToBvh4Error::Alignment { address: 8 });
        let error = to_bvh4(&tree, 0, |_, _| None).unwrap_err();
        assert!(matches!(error, ToBvh4Error::Leaf { count: 1, .. }), "{error}");
        assert_eq!(NodeRef::leaf(16, 8), None);
        assert_eq!(NodeRef::leaf(16, 7).and_then(NodeRef::as_leaf), Some((16, 7)));
        assert_eq!(NodeRef::leaf(0, 0), Some(NodeRef::EMPTY));
    }

    #[test]
    fn boxes_go_in_and_out() {
        let (triangles, _) = tree(3, 7);
        let primitive = BuildPrimitive::new(triangles[2].aabb(), 2);
        assert_eq!((primitive.aabb(), primitive.primitive), (triangles[2].aabb(), 2));
    }
}

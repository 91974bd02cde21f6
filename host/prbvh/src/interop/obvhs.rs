//! obvhs 0.4: [`Bvh2`], with any leaves, spatial splits included, and [`CwBvh`].

use crate::bvh::{Bvh, Content, FlatTree, SahModel, TreeFault, quality};
use crate::wide::{Layout, NotPacked, PackedNodes, PackedTree, WideBvh, WideFault};
use ::obvhs::aabb::Aabb as PeerAabb;
use ::obvhs::bvh2::node::Bvh2Node;
use ::obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use ::obvhs::cwbvh::CwBvh;
use ::obvhs::cwbvh::node::CwBvhNode;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::trace::wide::CwbvhNode;

/// The tree with the boxes it has.
///
/// # Errors
/// As [`Bvh::from_parts`].
pub fn from_bvh2(tree: &Bvh2) -> Result<Bvh, Vec<TreeFault>> {
    Bvh::from_parts(tree.nodes.iter().map(part), tree.primitive_indices.as_slice())
}

fn part(node: &Bvh2Node) -> (Aabb, Content) {
    let aabb = Aabb { min: node.aabb().min.to_array(), max: node.aabb().max.to_array() };
    let first = node.first_index;
    let content = match node.prim_count {
        0 => Content::Internal { left: first, right: first.wrapping_add(1) },
        count => Content::Leaf { first, count },
    };
    (aabb, content)
}

/// The tree as obvhs has it, children after their parents. It says of itself that it has spatial splits if a triangle is in several leaves.
///
/// # Panics
/// If the links are no tree.
#[must_use]
pub fn to_bvh2(tree: &Bvh) -> Bvh2 {
    let FlatTree { nodes, order } = FlatTree::new(tree);
    let node = |node: &crate::bvh::FlatNode| {
        let aabb = PeerAabb { min: node.min.into(), max: node.max.into() };
        Bvh2Node::new(aabb, node.count, node.first)
    };
    let depth = quality(tree, &SahModel::default()).max_depth as usize;
    Bvh2 {
        nodes: nodes.iter().map(node).collect(),
        uses_spatial_splits: is_any_twice(&order),
        primitive_indices: order,
        children_are_ordered_after_parents: true,
        // Its traversal has a stack of so many entries, and its validator wants one to spare.
        max_depth: DEFAULT_MAX_STACK_DEPTH.max(depth + 1),
        ..Bvh2::default()
    }
}

/// The compressed tree as obvhs has it, byte for byte. Its traversal has a stack of 32 entries, one a level ([`quality`](crate::wide::quality()) has the
/// levels).
///
/// # Errors
/// If a leaf has more than three triangles.
///
/// # Panics
/// If the links are no tree.
pub fn to_cwbvh(tree: &WideBvh) -> Result<CwBvh, NotPacked> {
    let packed = PackedTree::new(tree, Layout::Cwbvh)?;
    let PackedNodes::Cwbvh(nodes) = &packed.nodes else { unreachable!("the layout that was asked for") };
    let around = tree.nodes[0].aabb();
    Ok(CwBvh {
        nodes: nodes.iter().map(|node| bytemuck::cast::<CwbvhNode, CwBvhNode>(*node)).collect(),
        total_aabb: PeerAabb { min: around.min.into(), max: around.max.into() },
        exact_node_aabbs: None,
        uses_spatial_splits: is_any_twice(&packed.order),
        primitive_indices: packed.order,
    })
}

/// The compressed tree of obvhs, with the boxes it has.
///
/// # Errors
/// As [`PackedTree::unpack`].
pub fn from_cwbvh(tree: &CwBvh) -> Result<WideBvh, Vec<WideFault>> {
    let nodes = tree.nodes.iter().map(|node| bytemuck::cast::<CwBvhNode, CwbvhNode>(*node)).collect();
    PackedTree { nodes: PackedNodes::Cwbvh(nodes), order: tree.primitive_indices.clone() }.unpack()
}

fn is_any_twice(order: &[u32]) -> bool {
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).any(|pair| pair[0] == pair[1])
}

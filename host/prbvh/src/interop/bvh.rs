//! The crate `bvh` 0.13: one shape per leaf, boxes in the parents.

use crate::bvh::{Bvh, Content, NO_NODE, ROOT, TreeFault};
use ::bvh::aabb::Aabb as PeerAabb;
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh as PeerBvh, BvhNode as PeerNode};
use prbvh_kernel::aabb::Aabb;

/// The tree with the boxes it has. That of a single leaf has none: its box is [`Aabb::EMPTY`] until [`Bvh::with_boxes_of`] makes one.
///
/// # Errors
/// As [`Bvh::from_parts`]; a link or a shape beyond 32 bits is one out of range.
pub fn from_bvh(tree: &PeerBvh<f32, 3>) -> Result<Bvh, Vec<TreeFault>> {
    let word = |x: usize| u32::try_from(x).unwrap_or(NO_NODE);
    let mut parts = vec![(Aabb::EMPTY, Content::Leaf { first: 0, count: 1 }); tree.nodes.len()];
    let mut order = Vec::new();
    for (v, node) in tree.nodes.iter().enumerate() {
        parts[v].1 = match *node {
            PeerNode::Leaf { shape_index, .. } => {
                order.push(word(shape_index));
                Content::Leaf { first: order.len() as u32 - 1, count: 1 }
            }
            PeerNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
                let (left_box, right_box) = (ours(&child_l_aabb), ours(&child_r_aabb));
                for (child, aabb) in [(child_l_index, left_box), (child_r_index, right_box)] {
                    if let Some((place, _)) = parts.get_mut(child) {
                        *place = aabb;
                    }
                }
                if v == ROOT as usize {
                    parts[v].0 = left_box.union(right_box);
                }
                Content::Internal { left: word(child_l_index), right: word(child_r_index) }
            }
        };
    }
    Bvh::from_parts(parts, order)
}

/// Why a tree has no form in the crate `bvh`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ToBvhError {
    /// A leaf names a shape that is not there.
    #[error("triangle {triangle} of the tree is not among the {shapes} shapes")]
    NoShape {
        /// The triangle.
        triangle: u32,
        /// Shapes there are.
        shapes: usize,
    },
    /// A triangle is in several leaves, as spatial splits have it; a shape knows one node only.
    #[error("triangle {triangle} is in several leaves, but a shape of the crate bvh has one")]
    Twice {
        /// The triangle.
        triangle: u32,
    },
}

/// The tree as the crate `bvh` has it. `shapes[k]` is triangle `k` of the tree and is told its node, as the crate's builder does; leaves of
/// several are halved, in the order they have, until each holds one.
///
/// # Errors
/// If there is no shape for a triangle, or a triangle is in several leaves.
///
/// # Panics
/// If the links are no tree.
pub fn to_bvh<S: BHShape<f32, 3>>(tree: &Bvh, shapes: &mut [S]) -> Result<PeerBvh<f32, 3>, ToBvhError> {
    check(&tree.triangle_order, shapes.len())?;
    let mut nodes: Vec<PeerNode<f32, 3>> = Vec::with_capacity(2 * tree.triangle_order.len());
    // What to make, and of which parent on which side.
    let mut stack = vec![(Part::Node(ROOT), None)];
    while let Some((part, parent)) = stack.pop() {
        let index = nodes.len();
        assert!(index < 2 * tree.triangle_order.len(), "the links are no tree");
        let parent_index = match parent {
            None => 0,
            Some((parent, is_right)) => {
                let node: &mut PeerNode<f32, 3> = &mut nodes[parent];
                *(if is_right { node.child_r_mut() } else { node.child_l_mut() }) = index;
                parent
            }
        };
        let node = match part.children(tree) {
            Err(triangle) => {
                let shape_index = triangle as usize;
                shapes[shape_index].set_bh_node_index(index);
                PeerNode::Leaf { parent_index, shape_index }
            }
            Ok([left, right]) => {
                stack.push((right, Some((index, true))));
                stack.push((left, Some((index, false))));
                let [child_l_aabb, child_r_aabb] = [left, right].map(|child| child.aabb(tree, shapes));
                PeerNode::Node { parent_index, child_l_index: 0, child_l_aabb, child_r_index: 0, child_r_aabb }
            }
        };
        nodes.push(node);
    }
    Ok(PeerBvh { nodes })
}

/// A node, or a part of a leaf.
#[derive(Clone, Copy)]
enum Part {
    Node(u32),
    /// Positions of the triangle order: first, count.
    Triangles(u32, u32),
}

impl Part {
    /// Its children, or the only triangle.
    fn children(self, tree: &Bvh) -> Result<[Self; 2], u32> {
        let (first, count) = match self {
            Self::Triangles(first, count) => (first, count),
            Self::Node(v) => match tree.nodes[v as usize].content {
                Content::Internal { left, right } => return Ok([Self::Node(left), Self::Node(right)]),
                Content::Leaf { first, count } => (first, count),
            },
        };
        match count {
            1 => Err(tree.triangle_order[first as usize]),
            _ => Ok([Self::Triangles(first, count / 2), Self::Triangles(first + count / 2, count - count / 2)]),
        }
    }

    fn aabb<S: BHShape<f32, 3>>(self, tree: &Bvh, shapes: &[S]) -> PeerAabb<f32, 3> {
        match self {
            Self::Node(v) => {
                let Aabb { min, max } = tree.nodes[v as usize].aabb;
                PeerAabb::with_bounds(min.into(), max.into())
            }
            Self::Triangles(first, count) => {
                let held = tree.triangle_order[first as usize..][..count as usize].iter();
                held.fold(PeerAabb::empty(), |aabb, &t| aabb.join(&shapes[t as usize].aabb()))
            }
        }
    }
}

fn ours(aabb: &PeerAabb<f32, 3>) -> Aabb {
    Aabb { min: aabb.min.into(), max: aabb.max.into() }
}

fn check(order: &[u32], shapes: usize) -> Result<(), ToBvhError> {
    let mut seen = vec![false; shapes];
    for &triangle in order {
        match seen.get_mut(triangle as usize) {
            None => return Err(ToBvhError::NoShape { triangle, shapes }),
            Some(true) => return Err(ToBvhError::Twice { triangle }),
            Some(seen) => *seen = true,
        }
    }
    Ok(())
}

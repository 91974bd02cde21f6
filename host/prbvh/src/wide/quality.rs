//! How good a wide tree is.

use super::weight::Weight;
use super::{WideBvh, WideContent};
use crate::bvh::SahModel;

/// Quality of a wide tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct WideQuality {
    /// `(c_traversal · Σ area(node) + c_intersect · Σ area(leaf) · triangles) / area(root)`, unitless; the root is a node. In f64, as
    /// [`Quality::sah_cost`](crate::bvh::Quality::sah_cost). Costs of different widths have different units: they say which of two trees of one width is better.
    pub sah_cost: f64,
    /// Most nodes on a way from the root to a leaf, the root among them; as many groups wait on the stack of a traversal at most.
    pub levels: u32,
    /// Nodes, leaves not among them.
    pub nodes: u32,
    /// Leaves.
    pub leaves: u32,
    /// Triangles.
    pub triangles: u32,
    /// Mean number of children of a node.
    pub children_per_node: f64,
    /// Whether the root's box has no area, so that every ratio counts as 1.
    pub is_root_flat: bool,
}

/// Measures a valid tree.
///
/// # Panics
/// If the links are no tree.
#[must_use]
pub fn quality(tree: &WideBvh, model: &SahModel) -> WideQuality {
    let weight = Weight::of(&tree.nodes[0].aabb());
    let (mut nodes, mut leaves) = (0.0, 0.0);
    let mut measured = WideQuality { is_root_flat: weight.is_flat(), ..WideQuality::default() };
    let mut children = 0u64;
    let mut stack = vec![(0u32, 1, 1.0)];
    while let Some((v, level, ratio)) = stack.pop() {
        assert!((measured.nodes as usize) < tree.nodes.len(), "the links are no tree");
        measured.nodes += 1;
        measured.levels = measured.levels.max(level);
        nodes += ratio;
        for child in tree.nodes[v as usize].children().rev() {
            children += 1;
            let ratio = weight.ratio(&child.aabb);
            match child.content {
                WideContent::Node(node) => stack.push((node, level + 1, ratio)),
                WideContent::Leaf { count, .. } => {
                    leaves += ratio * f64::from(count);
                    measured.leaves += 1;
                    measured.triangles += count;
                }
            }
        }
    }
    measured.sah_cost = model.c_traversal * nodes + model.c_intersect * leaves;
    measured.children_per_node = children as f64 / f64::from(measured.nodes);
    measured
}

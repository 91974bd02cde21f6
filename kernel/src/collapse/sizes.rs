//! Sizes and costs of subtrees, bottom-up.
//!
//! Kind: [`climb`](mod@crate::climb). Areas are those of f32 in one fixed order, so that every device decides alike.

use super::area::{area_scale, relative_area};
use super::{COST, HEIGHT, LEAF, REMAINING, SIZE, word};
use crate::climb::climb;
use crate::math::umax;
use crate::mem::AtomicU32;
use crate::node::{Node, ROOT};
use bytemuck::{Pod, Zeroable};

/// Push constants of [`sizes`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CollapseParams {
    /// Invocations: one per leaf, `n`.
    pub count: u32,
    /// Cost of a step of the traversal.
    pub c_traversal: f32,
    /// Cost of a test against a triangle.
    pub c_intersect: f32,
    /// Most triangles of a leaf.
    pub max_leaf: u32,
}

/// Invocation `i` climbs from leaf `i`. Reads `nodes[2n-1]`, whose boxes are right; writes `subtrees[2n-1]` of
/// [`SUBTREE_WORDS`](super::SUBTREE_WORDS) words and `arrivals[n-1]`, which starts as 0.
#[inline(always)]
pub fn sizes(i: u32, params: &CollapseParams, nodes: &[Node], subtrees: &[AtomicU32], arrivals: &[AtomicU32]) {
    let scale = area_scale(nodes[ROOT as usize].aabb().half_area());
    let leaf = params.count - 1 + i;
    subtrees[word(leaf, SIZE)].store(1 | LEAF);
    subtrees[word(leaf, REMAINING)].store(1);
    subtrees[word(leaf, COST)].store_f32(params.c_intersect * relative_area(&nodes[leaf as usize], scale));
    subtrees[word(leaf, HEIGHT)].store(0);
    let CollapseParams { count, c_traversal, c_intersect, max_leaf } = *params;
    climb(i, count, nodes, arrivals, move |p, left, right| {
        let size = (subtrees[word(left, SIZE)].load() & !LEAF) + (subtrees[word(right, SIZE)].load() & !LEAF);
        let remaining = 1 + subtrees[word(left, REMAINING)].load() + subtrees[word(right, REMAINING)].load();
        let below = subtrees[word(left, COST)].load_f32() + subtrees[word(right, COST)].load_f32();
        let (left_height, right_height) = (subtrees[word(left, HEIGHT)].load(), subtrees[word(right, HEIGHT)].load());
        let area = relative_area(&nodes[p as usize], scale);
        let as_node = c_traversal * area + below;
        let as_leaf = c_intersect * area * size as f32;
        let is_leaf = size <= max_leaf && as_leaf < as_node;
        subtrees[word(p, SIZE)].store(if is_leaf { size | LEAF } else { size });
        subtrees[word(p, REMAINING)].store(if is_leaf { 1 } else { remaining });
        subtrees[word(p, COST)].store_f32(if is_leaf { as_leaf } else { as_node });
        subtrees[word(p, HEIGHT)].store(1 + umax(left_height, right_height));
    });
}

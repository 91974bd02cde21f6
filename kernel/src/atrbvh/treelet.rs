//! The leaves of a treelet, whatever becomes of them, and its new links.
//!
//! Source: Karras & Aila 2013 (formation of treelets), which ATRBVH takes over.

use crate::forest::Forest;
use crate::node::{AtomicNode, Links, RIGHT};
use bytemuck::{Pod, Zeroable};

/// A sum of areas must fall by this part of it. Two sums of 30 areas are each off by no more than 36 roundings of 2^-24.
pub const RELATIVE_THRESHOLD: f32 = 1.0 / (1 << 17) as f32;

/// Push constants of the kernels that restructure.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct RestructureParams {
    /// Invocations: one per treelet.
    pub count: u32,
    /// Where the treelet roots begin in the order.
    pub first: u32,
    /// Most leaves of a treelet, at least 3.
    pub treelet: u32,
    /// Internal nodes of the tree, `n-1`.
    pub internal: u32,
}

/// Finds the leaves of the treelet below `root`: its children, of which the one with the largest area is replaced by its children, again and
/// again; the first of equals. Returns the sum of the half areas of the nodes that it opened, which it lists in `opened`, the root left out.
#[inline(always)]
pub(super) fn open<const N: usize>(
    root: u32,
    params: &RestructureParams,
    nodes: &[AtomicNode],
    leaves: &mut Forest<N>,
    opened: &mut [u32; N],
) -> f32 {
    // Negative where there is nothing to open.
    let mut areas = [-1.0f32; N];
    let mut sum = 0.0f32;
    let mut slot = 0;
    let mut node = root;
    let mut count = 0;
    for step in 1..params.treelet {
        if step > 1 {
            let mut largest = -1.0f32;
            for k in 0..count {
                if areas[k as usize] > largest {
                    largest = areas[k as usize];
                    slot = k;
                }
            }
            if largest < 0.0 {
                break;
            }
            node = leaves.node(slot);
            opened[(step - 2) as usize] = node;
            sum += largest;
        }
        let first = nodes.down(node);
        areas[slot as usize] = put(slot, first, params.internal, nodes, leaves);
        let second = nodes.up(first);
        areas[step as usize] = put(step, second, params.internal, nodes, leaves);
        count = step + 1;
    }
    leaves.count = count;
    sum
}

/// Puts node `v` into `slot`. Returns its half area, at least 0, or -1 if it is a leaf of the tree.
#[inline(always)]
fn put<const N: usize>(slot: u32, v: u32, internal: u32, nodes: &[AtomicNode], leaves: &mut Forest<N>) -> f32 {
    let aabb = nodes[v as usize].aabb();
    leaves.put(slot, v, aabb);
    let area = aabb.half_area();
    if v >= internal {
        -1.0
    } else if area > 0.0 {
        area
    } else {
        0.0
    }
}

/// Makes `left` and `right` the children of `node`, whose box follows unless it is the treelet's root: that one keeps its box.
#[inline(always)]
pub(super) fn link(node: u32, left: u32, right: u32, root: u32, nodes: &[AtomicNode]) {
    nodes[node as usize].set_down(left);
    nodes[left as usize].set_up(right);
    nodes[right as usize].set_up(node | RIGHT);
    if node != root {
        nodes[node as usize].set_aabb(nodes[left as usize].aabb().union(nodes[right as usize].aabb()));
    }
}

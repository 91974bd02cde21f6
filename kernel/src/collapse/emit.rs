//! The collapsed tree in depth-first order.
//!
//! Kind: scatter with one writer per element: remaining nodes have places of their own, and so have triangles.

use super::{LEAF, Place, REMAINING, SIZE, word};
use crate::mem::Slot;
use crate::node::{Links, Node};
use bytemuck::{Pod, Zeroable};

/// A node of a collapsed tree, 32 bytes. The left child of node `v` is node `v + 1`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CompactNode {
    /// Smallest coordinates of the box.
    pub min: [f32; 3],
    /// Internal: the right child. Leaf: its first position in the order of the triangles.
    pub first: u32,
    /// Largest coordinates of the box.
    pub max: [f32; 3],
    /// Internal: 0. Leaf: its triangles.
    pub count: u32,
}

/// Push constants of [`emit`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct EmitParams {
    /// Invocations: one per node, `2n-1`.
    pub count: u32,
}

/// Invocation `v` writes node `v` if it remains, and its triangle if it was a leaf. Reads `nodes[2n-1]`, `subtrees` and the
/// finished `places[2n-1]`; writes `compact` (as many as remain) and `order[n]`.
#[inline(always)]
pub fn emit(
    v: u32,
    params: &EmitParams,
    nodes: &[Node],
    subtrees: &[u32],
    places: &[Place],
    compact: &[Slot<CompactNode>],
    order: &[Slot<u32>],
) {
    let node = nodes[v as usize];
    let place = places[v as usize];
    if v >= params.count / 2 {
        order[place.triangles as usize].set(node.down);
    }
    if place.hidden == 0 {
        let size = subtrees[word(v, SIZE)];
        let mut first = place.triangles;
        let mut count = size & !LEAF;
        if size & LEAF == 0 {
            first = place.nodes + 1 + subtrees[word(nodes.down(v), REMAINING)];
            count = 0;
        }
        compact[place.nodes as usize].set(CompactNode { min: node.min, first, max: node.max, count });
    }
}

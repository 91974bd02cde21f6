//! Depth-first positions of nodes and triangles, top-down by pointer jumping.
//!
//! Source: pointer jumping, Wyllie 1979 (list ranking). A node's position is the sum of the steps on its way down from the root; each
//! round doubles the length of the way that a node knows, so that a tree of depth `d` needs `ceil(log2 d)` rounds whatever its
//! shape.

use super::{LEAF, REMAINING, SIZE, word};
use crate::mem::Slot;
use crate::node::{Links, NO_NODE, Node};
use bytemuck::{Pod, Zeroable};

/// Where a node stands, counted from the ancestor `from`, 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Place {
    /// The ancestor that the steps start from; [`NO_NODE`] once they start from the root.
    pub from: u32,
    /// Remaining nodes that come before in depth-first order.
    pub nodes: u32,
    /// Triangles that come before in depth-first order.
    pub triangles: u32,
    /// Whether one of the ancestors below `from`, or `from` itself, becomes a leaf: 0 or 1.
    pub hidden: u32,
}

/// Push constants of [`places`] and [`jump`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PlacesParams {
    /// Invocations: one per node, `2n-1`.
    pub count: u32,
}

/// Invocation `v` writes the step to node `v` from its parent. Reads `nodes[2n-1]` and `subtrees`, writes `places[2n-1]`.
#[inline(always)]
pub fn places(v: u32, nodes: &[Node], subtrees: &[u32], places: &[Slot<Place>]) {
    let parent = nodes.parent(v);
    let mut place = Place { from: NO_NODE, nodes: 0, triangles: 0, hidden: 0 };
    if parent != NO_NODE {
        place.from = parent;
        place.nodes = 1;
        place.hidden = subtrees[word(parent, SIZE)] >> 31;
        let left = nodes.down(parent);
        if left != v {
            place.nodes += subtrees[word(left, REMAINING)];
            place.triangles = subtrees[word(left, SIZE)] & !LEAF;
        }
    }
    places[v as usize].set(place);
}

/// Invocation `v` joins the way of node `v` to that of the node where it starts. Reads `places[2n-1]`, writes `longer[2n-1]`.
#[inline(always)]
pub fn jump(v: u32, places: &[Place], longer: &[Slot<Place>]) {
    let mut place = places[v as usize];
    if place.from != NO_NODE {
        let before = places[place.from as usize];
        place.from = before.from;
        // A hidden node has no number, and the sum of its steps no meaning.
        place.nodes = place.nodes.wrapping_add(before.nodes);
        place.triangles = place.triangles.wrapping_add(before.triangles);
        place.hidden |= before.hidden;
    }
    longer[v as usize].set(place);
}

//! Keeping the best tree: its links, 8 bytes a node; the boxes follow by a refit.
//!
//! Kind: map (save), scatter with one writer per word (restore).

use crate::mem::Slot;
use crate::node::{AtomicNode, Node};
use bytemuck::{Pod, Zeroable};

/// Links of a node; see [`crate::node`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct NodeLinks {
    /// [`Node::up`]
    pub up: u32,
    /// [`Node::down`]
    pub down: u32,
}

/// Push constants of [`save`] and [`restore`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SnapshotParams {
    /// Invocations: one per node, `2n-1`.
    pub count: u32,
}

/// Invocation `i` copies the links of node `i` to `links[i]`.
#[inline(always)]
pub fn save(i: u32, nodes: &[Node], links: &[Slot<NodeLinks>]) {
    let node = nodes[i as usize];
    links[i as usize].set(NodeLinks { up: node.up, down: node.down });
}

/// Invocation `i` copies `links[i]` back to node `i`, whose box is stale until the next refit.
#[inline(always)]
pub fn restore(i: u32, links: &[NodeLinks], nodes: &[AtomicNode]) {
    let NodeLinks { up, down } = links[i as usize];
    nodes[i as usize].set_up(up);
    nodes[i as usize].set_down(down);
}

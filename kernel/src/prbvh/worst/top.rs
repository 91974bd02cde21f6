//! The top of a tree for the host: nodes of a list, each with its children.
//!
//! Kind: map.

use super::books::LIST_LENGTH;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Links, Node};
use bytemuck::{Pod, Zeroable};

/// An internal node with its children.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TopNode {
    /// Its number.
    pub v: u32,
    /// Numbers of the children.
    pub children: [u32; 2],
    /// The node.
    pub node: Node,
    /// The left child.
    pub left: Node,
    /// The right child.
    pub right: Node,
}

/// Push constants of [`top`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TopParams {
    /// Invocations.
    pub count: u32,
    /// Place on the list of the first of them.
    pub first: u32,
}

/// Invocation `i` writes node `list[first + i]`, if the list is so long, to `top[i]`. Reads `nodes[2n-1]`.
#[inline(always)]
pub fn top(i: u32, params: &TopParams, nodes: &[Node], list: &[u32], books: &[AtomicU32], top: &[Slot<TopNode>]) {
    let place = params.first + i;
    if place < books[LIST_LENGTH].load() {
        let v = list[place as usize];
        let left = nodes.down(v);
        let right = nodes.up(left);
        top[i as usize].set(TopNode {
            v,
            children: [left, right],
            node: nodes[v as usize],
            left: nodes[left as usize],
            right: nodes[right as usize],
        });
    }
}

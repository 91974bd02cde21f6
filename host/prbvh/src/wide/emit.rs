//! From what becomes of each node of a binary tree to the wide tree.

use super::{SLOTS, WideBvh, WideChild, WideContent, WideNode, Width};
use crate::bvh::{Bvh, Content, ROOT};

/// What becomes of a node of the binary tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Fate {
    /// It goes: its children are children of the node above it, or its triangles are in a leaf above it.
    #[default]
    Gone,
    /// It becomes a node.
    Node,
    /// All below it becomes a leaf.
    Leaf,
}

/// The wide tree. A root that is to be a leaf is a node with that one child. Siblings lie side by side, as do the triangles of their leaves; what lies below the
/// first of them comes first.
pub(super) fn emit(tree: &Bvh, width: Width, fates: &[Fate]) -> WideBvh {
    let mut wide = WideBvh {
        width,
        nodes: vec![WideNode::default()],
        triangle_order: Vec::with_capacity(tree.triangle_order.len()),
    };
    let mut stack = vec![(ROOT, 0u32)];
    while let Some((from, to)) = stack.pop() {
        let mut below = [0; SLOTS];
        let count = children(tree, fates, from, width, &mut below);
        let waiting = stack.len();
        for (slot, &child) in below[..count].iter().enumerate() {
            let content = if fates[child as usize] == Fate::Leaf {
                let first = wide.triangle_order.len() as u32;
                push_triangles(tree, child, &mut wide.triangle_order);
                WideContent::Leaf { first, count: wide.triangle_order.len() as u32 - first }
            } else {
                let node = wide.nodes.len() as u32;
                wide.nodes.push(WideNode::default());
                stack.push((child, node));
                WideContent::Node(node)
            };
            let aabb = tree.nodes[child as usize].aabb;
            wide.nodes[to as usize].slots[slot] = Some(WideChild { aabb, content });
        }
        stack[waiting..].reverse();
    }
    wide
}

/// The nodes of the binary tree that become children of `v`, from left to right.
fn children(tree: &Bvh, fates: &[Fate], v: u32, width: Width, below: &mut [u32; SLOTS]) -> usize {
    let mut count = 0;
    // No more than the width wait at a time: each of them becomes a child at least.
    let mut stack = Vec::with_capacity(SLOTS);
    match tree.nodes[v as usize].content {
        Content::Internal { left, right } if fates[v as usize] == Fate::Node => stack.extend([right, left]),
        _ => stack.push(v),
    }
    while let Some(u) = stack.pop() {
        match (fates[u as usize], tree.nodes[u as usize].content) {
            (Fate::Gone, Content::Internal { left, right }) => stack.extend([right, left]),
            _ => {
                assert!(count < width.get(), "more children than the width");
                below[count] = u;
                count += 1;
            }
        }
    }
    count
}

/// Appends the triangles below `v`, from left to right.
fn push_triangles(tree: &Bvh, v: u32, order: &mut Vec<u32>) {
    let mut stack = vec![v];
    while let Some(u) = stack.pop() {
        match tree.nodes[u as usize].content {
            Content::Internal { left, right } => stack.extend([right, left]),
            Content::Leaf { first, count } => {
                order.extend_from_slice(&tree.triangle_order[first as usize..][..count as usize]);
            }
        }
    }
}

//! Leaves that are larger than allowed become several.

use crate::bvh::{Bvh, BvhNode, Content};
use std::borrow::Cow;

/// The tree with no leaf of more than `most` triangles. The halves of a leaf keep its box, for nothing is known of the triangles.
pub(super) fn within(tree: &Bvh, most: u32) -> Cow<'_, Bvh> {
    let is_large = |node: &BvhNode| matches!(node.content, Content::Leaf { count, .. } if count > most);
    if !tree.nodes.iter().any(is_large) {
        return Cow::Borrowed(tree);
    }
    let mut tree = tree.clone();
    let mut v = 0;
    // New leaves come at the end and are looked at in their turn.
    while v < tree.nodes.len() {
        let node = tree.nodes[v];
        if let Content::Leaf { first, count } = node.content
            && count > most
        {
            let left = tree.nodes.len() as u32;
            let half = count / 2;
            let leaf = |first, count| BvhNode { parent: v as u32, content: Content::Leaf { first, count }, ..node };
            tree.nodes.extend([leaf(first, half), leaf(first + half, count - half)]);
            tree.nodes[v].content = Content::Internal { left, right: left + 1 };
        }
        v += 1;
    }
    Cow::Owned(tree)
}

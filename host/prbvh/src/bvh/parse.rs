//! From the bytes of the canonical layout to the tree.

use super::layout::FlatNode;
use super::{Bvh, BvhNode, Content, NO_NODE, ROOT};
use prbvh_kernel::aabb::Aabb;

/// Bytes of a [`FlatNode`].
pub(super) const NODE_BYTES: usize = size_of::<FlatNode>();

/// Why bytes are no canonical layout.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct LayoutError {
    /// Byte, counted from the start of the nodes.
    pub(super) offset: usize,
    /// What the number there is.
    pub(super) what: &'static str,
    /// What it is instead of `need`.
    pub(super) value: u32,
    /// What is allowed there.
    pub(super) need: String,
}

/// The tree in `nodes[32 · node_count]` and `order[4 · triangle_count]`; `splits_of`: the triangles of the scene, where one may be in several leaves. All links and triangle ids are checked; boxes are not.
pub(super) fn parse(nodes: &[u8], order: &[u8], splits_of: Option<u32>) -> Result<Bvh, LayoutError> {
    let node_count = nodes.len() / NODE_BYTES;
    let triangle_order = parse_order(order, nodes.len(), splits_of)?;
    let empty = BvhNode { aabb: Aabb::EMPTY, parent: NO_NODE, content: Content::Leaf { first: 0, count: 0 } };
    let mut parsed = vec![empty; node_count];
    let (mut next_node, mut next_position) = (ROOT + 1, 0u32);
    let mut stack = vec![(ROOT, NO_NODE)];
    while let Some((v, parent)) = stack.pop() {
        let at = v as usize * NODE_BYTES;
        let words: [u32; NODE_BYTES / 4] = bytemuck::pod_read_unaligned(&nodes[at..at + NODE_BYTES]);
        let node: FlatNode = bytemuck::cast(words.map(u32::from_le));
        let (first, count) = (node.first, node.count);
        let expected = if count == 0 { next_node } else { next_position };
        if first != expected {
            let what = if count == 0 { "left child" } else { "first position" };
            return Err(LayoutError { offset: at + 12, what, value: first, need: expected.to_string() });
        }
        let content = if count == 0 {
            if node_count - (next_node as usize) < 2 {
                let need = format!("none: all {node_count} nodes are taken, so this is a leaf of at least 1 triangle");
                return Err(LayoutError { offset: at + 12, what: "left child", value: first, need });
            }
            next_node += 2;
            stack.push((first + 1, v));
            stack.push((first, v));
            Content::Internal { left: first, right: first + 1 }
        } else {
            let left = (triangle_order.len() - next_position as usize) as u32;
            if count > left {
                let need = format!("at most {left}");
                return Err(LayoutError { offset: at + 28, what: "triangles of a leaf", value: count, need });
            }
            next_position += count;
            Content::Leaf { first, count }
        };
        parsed[v as usize] = BvhNode { aabb: node.aabb(), parent, content };
    }
    if (next_node as usize) < node_count {
        let need = format!("{next_node}, as many as the root leads to");
        return Err(LayoutError {
            offset: next_node as usize * NODE_BYTES,
            what: "nodes",
            value: node_count as u32,
            need,
        });
    }
    if (next_position as usize) < triangle_order.len() {
        let offset = nodes.len() + next_position as usize * 4;
        let need = format!("{next_position}, as many as the leaves hold");
        return Err(LayoutError { offset, what: "triangles", value: triangle_order.len() as u32, need });
    }
    Ok(Bvh { nodes: parsed, triangle_order })
}

/// The triangle ids, each of which must be there once, with splits at least once; `base` is where they start.
fn parse_order(order: &[u8], base: usize, splits_of: Option<u32>) -> Result<Vec<u32>, LayoutError> {
    let words = order.chunks_exact(4);
    let count = splits_of.map_or(words.len(), |triangles| triangles as usize);
    let mut seen = vec![false; count];
    let mut ids = Vec::with_capacity(words.len());
    for (position, word) in words.enumerate() {
        let id = u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
        let offset = base + position * 4;
        match seen.get_mut(id as usize) {
            None => {
                return Err(LayoutError { offset, what: "triangle", value: id, need: format!("below {count}") });
            }
            Some(true) if splits_of.is_none() => {
                let need = "one that has not been before".to_owned();
                return Err(LayoutError { offset, what: "triangle", value: id, need });
            }
            Some(seen) => *seen = true,
        }
        ids.push(id);
    }
    if let Some(missing) = seen.iter().position(|&seen| !seen) {
        let need = format!("triangle {missing} too: each of {count} is in a leaf");
        let value = ids.last().copied().unwrap_or(0);
        return Err(LayoutError { offset: base + order.len() - 4, what: "triangle", value, need });
    }
    Ok(ids)
}

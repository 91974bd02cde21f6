//! The usual collapse: a node takes the children of its child with the largest box until it is full.
//!
//! Source: Wald, Benthin & Boulos 2008, §3.1. Leaves are those of a binary tree of least cost with the same costs (MacDonald & Booth 1990).

use super::SLOTS;
use super::emit::Fate;
use super::settings::WideSettings;
use super::weight::Weight;
use crate::bvh::{Bvh, Content, ROOT};

/// What becomes of each node.
pub(super) fn fates(tree: &Bvh, settings: &WideSettings) -> Vec<Fate> {
    let weight = Weight::of(&tree.nodes[ROOT as usize].aabb);
    let ratio = |v: u32| weight.ratio(&tree.nodes[v as usize].aabb);
    let mut fates = leaves(tree, settings, ratio);
    let mut stack = vec![ROOT];
    while let Some(v) = stack.pop() {
        if fates[v as usize] == Fate::Leaf {
            continue;
        }
        fates[v as usize] = Fate::Node;
        let mut open = vec![v];
        let mut width = 1;
        while width < settings.width.get() {
            // The first of the largest; the node itself is opened in any case.
            let can_open = |u: u32| matches!(tree.nodes[u as usize].content, Content::Internal { .. });
            let candidates = open.iter().enumerate().filter(|&(_, &u)| fates[u as usize] != Fate::Leaf && can_open(u));
            let largest = candidates.map(|(k, &u)| (k, ratio(u))).reduce(|a, b| if b.1 > a.1 { b } else { a });
            let Some((k, _)) = largest else { break };
            if let Content::Internal { left, right } = tree.nodes[open[k] as usize].content {
                open.splice(k..=k, [left, right]);
                width += 1;
            }
        }
        debug_assert!(open.len() <= SLOTS);
        stack.extend(open.into_iter().rev());
    }
    fates
}

/// The leaves; all else is gone yet.
fn leaves(tree: &Bvh, settings: &WideSettings, ratio: impl Fn(u32) -> f64) -> Vec<Fate> {
    let (model, most) = (settings.costs(), u64::from(settings.most_of_a_leaf()));
    let mut is_leaf = vec![false; tree.nodes.len()];
    let mut below: Vec<(f64, u64)> = Vec::new();
    let order = tree.preorder();
    for &v in order.iter().rev() {
        let costs = match tree.nodes[v as usize].content {
            Content::Leaf { count, .. } => {
                is_leaf[v as usize] = true;
                (model.c_intersect * ratio(v) * f64::from(count), u64::from(count))
            }
            Content::Internal { .. } => {
                let (Some(left), Some(right)) = (below.pop(), below.pop()) else {
                    unreachable!("children come before their parent")
                };
                let triangles = left.1 + right.1;
                let leaf = model.c_intersect * ratio(v) * triangles as f64;
                let node = model.c_traversal * ratio(v) + left.0 + right.0;
                is_leaf[v as usize] = triangles <= most && leaf <= node;
                (if is_leaf[v as usize] { leaf } else { node }, triangles)
            }
        };
        below.push(costs);
    }
    let mut fates = vec![Fate::Gone; tree.nodes.len()];
    let mut stack = vec![ROOT];
    while let Some(v) = stack.pop() {
        match tree.nodes[v as usize].content {
            _ if is_leaf[v as usize] => fates[v as usize] = Fate::Leaf,
            Content::Internal { left, right } => stack.extend([right, left]),
            Content::Leaf { .. } => {}
        }
    }
    fates
}

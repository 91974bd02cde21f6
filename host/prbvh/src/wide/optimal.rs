//! The wide tree of least cost that a binary tree can become.
//!
//! Source: Ylitie, Karras & Laine 2017, §3.1. Of each subtree, from the leaves up, is known what it costs at least as a forest of at most `i` roots: equation
//! (1) is [`Costs::at_most`], (2) the leaf, (3) the node and (4) the two forests side by side of which either is made.

use super::SLOTS;
use super::emit::Fate;
use super::settings::WideSettings;
use super::weight::Weight;
use crate::bvh::{Bvh, Content, ROOT};

/// What a subtree costs at least.
#[derive(Clone, Copy)]
struct Costs {
    /// As a forest of at most `i` roots, at `i - 1`.
    at_most: [f64; SLOTS],
    /// As a leaf; infinite if it is too large for one.
    leaf: f64,
    /// As children of one node.
    opened: f64,
    triangles: u64,
}

/// How a subtree comes to its least cost.
#[derive(Clone, Copy, Default)]
struct Choice {
    /// Whether a single root is a leaf.
    is_leaf: bool,
    /// Roots that the left child gets, at `i - 1` of a forest of `i` roots; 0: a forest of one root less is as good. At 0 those of the children of one node.
    left: [u8; SLOTS],
}

/// What becomes of each node.
pub(super) fn fates(tree: &Bvh, settings: &WideSettings) -> Vec<Fate> {
    let width = settings.width.get();
    let (choices, root) = choices(tree, settings);
    let mut fates = vec![Fate::Gone; tree.nodes.len()];
    // The root is a node in any case, which pays when its children cost less than a leaf in it.
    fates[ROOT as usize] = if root.leaf <= root.opened { Fate::Leaf } else { Fate::Node };
    let mut stack = Vec::new();
    let open = |stack: &mut Vec<(u32, usize)>, v: u32, roots: usize, left_roots: u8| {
        if let Content::Internal { left, right } = tree.nodes[v as usize].content {
            stack.extend([(right, roots - usize::from(left_roots)), (left, usize::from(left_roots))]);
        }
    };
    if fates[ROOT as usize] == Fate::Node {
        open(&mut stack, ROOT, width, choices[ROOT as usize].left[0]);
    }
    while let Some((v, mut roots)) = stack.pop() {
        let choice = &choices[v as usize];
        while roots > 1 && choice.left[roots - 1] == 0 {
            roots -= 1;
        }
        match roots {
            1 if choice.is_leaf => fates[v as usize] = Fate::Leaf,
            1 => {
                fates[v as usize] = Fate::Node;
                open(&mut stack, v, width, choice.left[0]);
            }
            _ => open(&mut stack, v, roots, choice.left[roots - 1]),
        }
    }
    fates
}

/// The choices of all nodes and the costs of the root.
fn choices(tree: &Bvh, settings: &WideSettings) -> (Vec<Choice>, Costs) {
    let (width, model) = (settings.width.get(), settings.costs());
    let most = u64::from(settings.most_of_a_leaf());
    let weight = Weight::of(&tree.nodes[ROOT as usize].aabb);
    let mut choices = vec![Choice::default(); tree.nodes.len()];
    let mut below: Vec<Costs> = Vec::new();
    // Backward, children come before their parents, and the right one before the left one.
    for &v in tree.preorder().iter().rev() {
        let ratio = weight.ratio(&tree.nodes[v as usize].aabb);
        let choice = &mut choices[v as usize];
        let costs = match tree.nodes[v as usize].content {
            Content::Leaf { count, .. } => {
                choice.is_leaf = true;
                let leaf = model.c_intersect * ratio * f64::from(count);
                Costs { at_most: [leaf; SLOTS], leaf, opened: f64::INFINITY, triangles: count.into() }
            }
            Content::Internal { .. } => {
                let (Some(left), Some(right)) = (below.pop(), below.pop()) else {
                    unreachable!("children come before their parent")
                };
                let triangles = left.triangles + right.triangles;
                let leaf = if triangles <= most { model.c_intersect * ratio * triangles as f64 } else { f64::INFINITY };
                let (opened, left_roots) = side_by_side(&left, &right, width);
                choice.left[0] = left_roots;
                let node = model.c_traversal * ratio + opened;
                choice.is_leaf = leaf <= node;
                let mut at_most = [if choice.is_leaf { leaf } else { node }; SLOTS];
                for roots in 2..width {
                    let (cost, left_roots) = side_by_side(&left, &right, roots);
                    let fewer = at_most[roots - 2];
                    (at_most[roots - 1], choice.left[roots - 1]) =
                        if cost < fewer { (cost, left_roots) } else { (fewer, 0) };
                }
                Costs { at_most, leaf, opened, triangles }
            }
        };
        below.push(costs);
    }
    (choices, below.pop().expect("a tree has a root"))
}

/// The least cost of two forests of `roots` roots together, and how many of them are the left one's.
fn side_by_side(left: &Costs, right: &Costs, roots: usize) -> (f64, u8) {
    let mut best = (f64::INFINITY, 1);
    for left_roots in 1..roots {
        let cost = left.at_most[left_roots - 1] + right.at_most[roots - left_roots - 1];
        if cost < best.0 {
            best = (cost, left_roots as u8);
        }
    }
    best
}

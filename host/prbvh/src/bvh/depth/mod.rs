//! A bound on the depth: what reaches too deep is built anew, and nothing else.
//!
//! Where triangles lie in each other or share a corner, the tree of least cost takes them off one by one and is as deep as they are
//! many; a traversal with a stack of fixed length fails on it. That the last levels gain next to nothing is what a bound lives on.
//!
//! | step | where |
//! |---|---|
//! | levels and heights, a subtree as a range | [`shape`] |
//! | which subtrees are built anew: the set that raises the cost least, of ancestors that lie low | [`choose`] |
//! | one of them, over subtrees that stay whole where that is cheapest, by sweeps of the SAH that leave levels enough | [`rebuild`] |
//!
//! All of it works on places of the depth-first order and in f64, so that the result depends neither on the numbers of the nodes nor on
//! the threads, and a scene times a power of two has the same.

mod choose;
mod rebuild;
mod shape;

use super::quality::{Quality, SahModel, quality};
use super::{Bvh, Content, ROOT, TreeFault};
use rebuild::Rebuilt;
use shape::Shape;
use std::fmt;
use std::str::FromStr;

/// Most links between the root and a leaf, or no bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(from = "Option<u32>", into = "Option<u32>")
)]
pub struct MaxDepth(Option<u32>);

impl From<Option<u32>> for MaxDepth {
    fn from(links: Option<u32>) -> Self {
        links.map_or(Self::OFF, Self::new)
    }
}

impl From<MaxDepth> for Option<u32> {
    fn from(depth: MaxDepth) -> Self {
        depth.get()
    }
}

impl MaxDepth {
    /// A tree may be as deep as it has leaves.
    pub const OFF: Self = Self(None);

    /// At most so many links; 0 is [`MaxDepth::OFF`].
    #[must_use]
    pub const fn new(links: u32) -> Self {
        if links == 0 { Self::OFF } else { Self(Some(links)) }
    }

    /// The links; none without a bound.
    #[must_use]
    pub fn get(self) -> Option<u32> {
        self.0
    }

    /// Whether a tree may be so deep.
    #[must_use]
    pub fn allows(self, depth: u32) -> bool {
        self.0.is_none_or(|most| depth <= most)
    }

    /// Whether a binary tree over so many leaves can keep to it.
    ///
    /// # Errors
    /// If it is below ⌈log₂ `leaves`⌉.
    pub fn check(self, leaves: usize) -> Result<(), TooShallow> {
        let least = ceil_log2(leaves.max(1) as u128);
        match self.0 {
            Some(max_depth) if max_depth < least => Err(TooShallow { max_depth, leaves, least }),
            _ => Ok(()),
        }
    }

    /// The first leaf in depth-first order that lies too deep. The tree is valid otherwise.
    ///
    /// # Panics
    /// If the links are no tree.
    #[must_use]
    pub fn fault(self, tree: &Bvh) -> Option<TreeFault> {
        let max_depth = self.0?;
        let mut stack = vec![(ROOT, 0)];
        let mut visited = 0;
        while let Some((node, depth)) = stack.pop() {
            assert!(visited < tree.nodes.len(), "the links are no tree");
            visited += 1;
            match tree.nodes[node as usize].content {
                Content::Internal { left, right } => stack.extend([(right, depth + 1), (left, depth + 1)]),
                Content::Leaf { .. } if depth > max_depth => {
                    return Some(TreeFault::TooDeep { node, depth, max_depth });
                }
                Content::Leaf { .. } => {}
            }
        }
        None
    }
}

impl Default for MaxDepth {
    /// At most 63 links. Stacks of 64 entries are the usual ones (PBRT's `nodesToVisit`, tinybvh, the kernels of Aila & Laine 2009,
    /// `trace_64` here). An ordered traversal needs an entry per link ([`Quality::stack`]); the 64th is for a mark at the bottom, as
    /// Aila & Laine have it, or for a traversal that pushes both children and takes one off again.
    fn default() -> Self {
        Self::new(63)
    }
}

/// As on the command line.
impl fmt::Display for MaxDepth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(links) => links.fmt(f),
            None => f.write_str("off"),
        }
    }
}

/// A text that is no [`MaxDepth`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("neither a number of levels nor off")]
pub struct NoMaxDepth;

impl FromStr for MaxDepth {
    type Err = NoMaxDepth;

    /// A number, or `off`, `none` or 0 for no bound.
    fn from_str(text: &str) -> Result<Self, NoMaxDepth> {
        match text {
            "off" | "none" => Ok(Self::OFF),
            _ => text.parse().map(Self::new).map_err(|_| NoMaxDepth),
        }
    }
}

/// A bound that no tree over so many leaves can keep to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no tree over {leaves} triangles has a depth of at most {max_depth}: the least is {least}")]
#[non_exhaustive]
pub struct TooShallow {
    /// The bound.
    pub max_depth: u32,
    /// Leaves, of one triangle each.
    pub leaves: usize,
    /// ⌈log₂ `leaves`⌉.
    pub least: u32,
}

/// Rise of the SAH cost, as a part of it, beyond which a bound on the depth is said to be expensive.
pub const SAH_BUDGET: f64 = 0.1;

/// What a bound on the depth changed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct DepthBound {
    /// The bound: most links between the root and a leaf.
    pub max_depth: u32,
    /// Depth without it.
    pub depth_before: u32,
    /// Depth with it.
    pub depth_after: u32,
    /// SAH cost without it, unitless.
    pub cost_before: f64,
    /// SAH cost with it, unitless.
    pub cost_after: f64,
    /// Subtrees that were built anew.
    pub subtrees: u32,
    /// Internal nodes of them that are new; all others are as before.
    pub nodes: u32,
}

impl DepthBound {
    /// Rise of the cost, as a part of it.
    #[must_use]
    pub fn rise(&self) -> f64 {
        self.cost_after / self.cost_before - 1.0
    }
}

impl fmt::Display for DepthBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { depth_before, depth_after, cost_before, cost_after, subtrees, .. } = self;
        let plural = if *subtrees == 1 { "" } else { "s" };
        let percent = 100.0 * self.rise();
        write!(
            f,
            "depth {depth_before} to {depth_after}, {subtrees} subtree{plural} built anew, SAH cost {cost_before:.3} to {cost_after:.3} ({percent:+.2} %)"
        )
    }
}

/// Brings the depth of a valid tree within the bound. A tree that is within it stays as it is, bit for bit.
///
/// Leaves stay, and so do the boxes of all nodes that are not built anew; new ones have the union of their children's. The cost is that of
/// [`quality()`] with `model`.
///
/// # Errors
/// If no tree over so many leaves can keep to the bound.
///
/// # Panics
/// If the links are no tree.
pub fn bound_depth(tree: &mut Bvh, max_depth: MaxDepth, model: &SahModel) -> Result<Option<DepthBound>, TooShallow> {
    let before: Quality = quality(tree, model);
    let Some(most) = max_depth.get().filter(|&most| before.max_depth > most) else { return Ok(None) };
    max_depth.check(before.leaves as usize)?;
    let shape = Shape::of(tree, most);
    let rebuilt: Vec<Rebuilt> = choose::choose(&shape).iter().map(|&place| Rebuilt::of(&shape, place)).collect();
    for subtree in &rebuilt {
        subtree.apply(tree);
    }
    let after = quality(tree, model);
    Ok(Some(DepthBound {
        max_depth: most,
        depth_before: before.max_depth,
        depth_after: after.max_depth,
        cost_before: before.sah_cost,
        cost_after: after.sah_cost,
        subtrees: rebuilt.len() as u32,
        nodes: rebuilt.iter().map(Rebuilt::nodes).sum(),
    }))
}

/// The least `k` with 2^`k` at least `x`, which is not 0.
fn ceil_log2(x: u128) -> u32 {
    u128::BITS - (x - 1).leading_zeros()
}

#[cfg(test)]
mod tests;

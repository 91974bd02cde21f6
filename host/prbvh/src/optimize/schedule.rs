//! Which nodes are searched when, and when to stop.

use super::{Limits, Strategy};
use std::time::Duration;

/// A change of the SAH cost that counts as none.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(from = "super::written::Epsilon", into = "super::written::Epsilon")
)]
#[non_exhaustive]
pub enum Epsilon {
    /// As a part of the initial cost.
    Relative(f64),
    /// In the unit of the cost; the paper has 0.1.
    Absolute(f64),
}

/// Which nodes are searched first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Order {
    /// Those that look worst, few at first and then ever more of them; both children of each move ([`prbvh_kernel::prbvh::worst`]).
    #[default]
    WorstFirst,
    /// All in turn, as published (Meister & Bittner 2018, §4.4.2); single subtrees move.
    Published,
}

/// As on the command line.
impl std::fmt::Display for Order {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::WorstFirst => "worst-first",
            Self::Published => "published",
        })
    }
}

/// How [`Order::WorstFirst`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct WorstFirst {
    /// Nodes of the first round.
    pub first: u32,
    /// Each round has so many times the nodes of the one before.
    pub growth: f64,
    /// Most nodes of a round, as a part of all internal nodes.
    pub most_part: f64,
    /// Rounds of locks over the same tree, at least 1.
    pub lock_rounds: u32,
    /// Levels that a search climbs above the first ancestor that keeps its box without the input.
    pub climb: u32,
    /// The climb ends where no place can be better by this part of the child's area than the best so far.
    pub slack: f32,
    /// A new best tree counts if its cost is lower by this part.
    pub settles: f64,
    /// Rounds over the most nodes, without a new best tree that counts, that end the search.
    pub patience: u32,
    /// Nodes of a round of the tail, in which all nodes are searched again, each child first, and to the root; 0 for no tail.
    pub tail_part: f64,
    /// Nodes of the top of the tree, about, that is built anew before the tail, with several beginnings, at most an eighth of all; 0 for never.
    pub top: u32,
}

/// Sizes of the tops that are built anew, one after another, as parts of the largest.
const TOPS: [u32; 3] = [2, 8, 1];
/// As many times the nodes of the largest top a tree has, at least.
const TOP_OF: u32 = 8;
/// Fewest nodes of the largest top that is worth it.
const SMALLEST_TOP: u32 = 256;

impl WorstFirst {
    /// Sizes of the tops that are built anew in a tree of so many internal nodes.
    pub(crate) fn tops(&self, internal: u32) -> Vec<u32> {
        let largest = self.top.min(internal / TOP_OF);
        if largest < SMALLEST_TOP { Vec::new() } else { TOPS.map(|part| largest / part).to_vec() }
    }
}

impl Default for WorstFirst {
    fn default() -> Self {
        Self {
            first: 8,
            growth: 1.3,
            most_part: 0.02,
            lock_rounds: 2,
            climb: 8,
            slack: 0.1,
            settles: 1e-5,
            patience: 2,
            tail_part: 0.02,
            top: 8000,
        }
    }
}

/// Whoever waits for news, or wants an end, waits no longer.
const NEWS: Duration = Duration::from_millis(20);

/// Settings of the optimiser.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct PrbvhSettings {
    /// Which nodes are searched first.
    pub order: Order,
    /// Of [`Order::WorstFirst`].
    pub worst_first: WorstFirst,
    /// Of [`Order::Published`]: when a reinsertion may run beside others.
    pub strategy: Strategy,
    /// Of [`Order::Published`]: every `mu`-th node is searched, another set each iteration; at least 1. Falls to 1 as the cost settles.
    pub mu: u32,
    /// Of [`Order::Published`]: a smaller change of the cost ends the search with this `mu`.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub epsilon: Epsilon,
    /// What ends it early.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub limits: Limits,
    /// Of [`Order::Published`]: iterations without a new best tree, by more than `epsilon`, that end the search with this `mu`: the published rule can
    /// cycle for ever.
    pub patience: u32,
    /// Iterations run on the device without a word from the host for about this long. 0: each by itself, so that an observer finds the tree of its row;
    /// else it finds that of another one. Has no influence on the tree.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub news: Duration,
}

impl Default for PrbvhSettings {
    fn default() -> Self {
        Self {
            order: Order::default(),
            worst_first: WorstFirst::default(),
            strategy: Strategy::default(),
            mu: 9,
            epsilon: Epsilon::Relative(1e-4),
            limits: Limits::iterations(1000),
            patience: 20,
            news: NEWS,
        }
    }
}

impl PrbvhSettings {
    /// The published order with the paper's settings.
    #[must_use]
    pub fn published() -> Self {
        Self { order: Order::Published, ..Self::default() }
    }
}

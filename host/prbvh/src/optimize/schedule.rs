//! Which nodes are searched when, and when to stop.

use super::{IterationRow, Limits, StopReason, Strategy};
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
    /// Whether the host looks at every round by itself: then an observer finds the tree of its row. Else the first rounds run together.
    pub row_by_row: bool,
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
            row_by_row: false,
        }
    }
}

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

/// The state of the published rule (Meister & Bittner 2018, §4.4).
#[derive(Debug)]
pub(super) struct Schedule {
    epsilon: f64,
    patience: u32,
    limits: Limits,
    mu: u32,
    cost: f64,
    best: f64,
    since_best: u32,
}

impl Schedule {
    pub(super) fn new(settings: &PrbvhSettings, initial_cost: f64) -> Self {
        let epsilon = match settings.epsilon {
            Epsilon::Relative(part) => part * initial_cost,
            Epsilon::Absolute(change) => change,
        };
        Self {
            epsilon,
            patience: settings.patience.max(1),
            limits: settings.limits.clone(),
            mu: settings.mu.max(1),
            cost: initial_cost,
            best: initial_cost,
            since_best: 0,
        }
    }

    /// Every `mu`-th node is searched next.
    pub(super) fn mu(&self) -> u32 {
        self.mu
    }

    /// Whether a limit forbids another iteration.
    pub(super) fn limit(&self, iterations: u32, elapsed: Duration) -> Option<StopReason> {
        if self.limits.is_target(self.cost) {
            return Some(StopReason::Target);
        }
        self.limits.used_up(iterations, elapsed)
    }

    /// Takes note of an iteration; says whether it was the last.
    pub(super) fn note(&mut self, row: &IterationRow) -> Option<StopReason> {
        let change = (self.cost - row.cost).abs();
        self.cost = row.cost;
        if self.limits.is_target(self.cost) {
            return Some(StopReason::Target);
        }
        self.since_best += 1;
        if row.cost < self.best - self.epsilon {
            self.since_best = 0;
            self.best = row.cost;
        }
        // Written so that a NaN settles.
        let settled =
            change.partial_cmp(&self.epsilon) != Some(std::cmp::Ordering::Greater) || self.since_best >= self.patience;
        if self.mu == 1 && (settled || row.applied == 0) {
            return Some(StopReason::Converged);
        }
        if settled {
            self.mu -= 1;
            self.since_best = 0;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(cost: f64, applied: u32) -> IterationRow {
        IterationRow { cost, found: applied, owned: applied, applied, ..IterationRow::default() }
    }

    fn schedule(mu: u32, epsilon: Epsilon, patience: u32) -> Schedule {
        Schedule::new(&PrbvhSettings { mu, epsilon, patience, ..PrbvhSettings::default() }, 100.0)
    }

    #[test]
    fn mu_falls_by_one_when_the_cost_settles_and_the_end_comes_at_one() {
        let mut rule = schedule(3, Epsilon::Absolute(0.1), 20);
        assert_eq!(rule.note(&row(90.0, 5)), None);
        assert_eq!(rule.mu(), 3);
        assert_eq!(rule.note(&row(89.95, 5)), None);
        assert_eq!(rule.mu(), 2);
        assert_eq!(rule.note(&row(89.95, 0)), None);
        assert_eq!(rule.mu(), 1);
        assert_eq!(rule.note(&row(80.0, 5)), None);
        assert_eq!(rule.note(&row(79.95, 5)), Some(StopReason::Converged));
    }

    #[test]
    fn epsilon_may_be_a_part_of_the_initial_cost() {
        let mut rule = schedule(1, Epsilon::Relative(1e-2), 20);
        assert_eq!(rule.note(&row(98.9, 1)), None);
        assert_eq!(rule.note(&row(98.0, 1)), Some(StopReason::Converged));
    }

    #[test]
    fn a_limit_cycle_ends() {
        let mut rule = schedule(2, Epsilon::Absolute(0.1), 6);
        let ended = (0..100).find(|k| rule.note(&row(if k % 2 == 0 { 99.0 } else { 100.0 }, 2)).is_some());
        assert!(ended.is_some_and(|k| k < 20), "{ended:?}");
    }

    #[test]
    fn a_cost_that_is_no_number_ends() {
        let mut rule = schedule(2, Epsilon::Absolute(0.1), 6);
        assert_eq!(rule.note(&row(f64::NAN, 2)), None);
        assert_eq!(rule.note(&row(f64::NAN, 2)), Some(StopReason::Converged));
    }

    #[test]
    fn limits_are_asked_before_an_iteration() {
        let settings = PrbvhSettings {
            limits: Limits { max_time: Some(Duration::from_secs(1)), ..Limits::iterations(3) },
            ..PrbvhSettings::default()
        };
        let rule = Schedule::new(&settings, 1.0);
        assert_eq!(rule.limit(2, Duration::from_millis(999)), None);
        assert_eq!(rule.limit(3, Duration::ZERO), Some(StopReason::MaxIterations));
        assert_eq!(rule.limit(0, Duration::from_secs(1)), Some(StopReason::MaxTime));
    }

    #[test]
    fn the_target_ends_a_run_before_any_other_reason() {
        let settings = PrbvhSettings {
            limits: Limits { target_cost: Some(90.0), ..Limits::iterations(1) },
            mu: 1,
            ..PrbvhSettings::default()
        };
        let mut rule = Schedule::new(&settings, 100.0);
        assert_eq!(rule.limit(0, Duration::ZERO), None);
        assert_eq!(rule.note(&row(90.5, 1)), None);
        assert_eq!(rule.note(&row(90.0, 0)), Some(StopReason::Target));
        assert_eq!(rule.limit(9, Duration::ZERO), Some(StopReason::Target));
        assert_eq!(Schedule::new(&settings, 89.0).limit(0, Duration::ZERO), Some(StopReason::Target), "initial tree");
        let mut rule = Schedule::new(&settings, 100.0);
        assert_eq!(rule.note(&row(f64::NAN, 1)), Some(StopReason::Converged), "no number is no target");
    }
}

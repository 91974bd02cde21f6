//! When to pick nodes at random, and when to stop.

use super::super::{IterationRow, Limits, StopReason};
use super::RbvhSettings;
use std::time::Duration;

/// How the nodes of a batch are picked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// The most inefficient ones.
    Worst,
    /// Any.
    Random,
}

/// The state of the rule.
#[derive(Debug)]
pub(super) struct Schedule {
    epsilon: f64,
    random_after: u32,
    patience: u32,
    limits: Limits,
    /// Of all trees so far, where `best` only counts what is better by more than epsilon.
    lowest: f64,
    best: f64,
    since_best: u32,
}

impl Schedule {
    pub(super) fn new(settings: &RbvhSettings, initial_cost: f64) -> Self {
        Self {
            epsilon: settings.epsilon,
            random_after: settings.random_after,
            patience: settings.patience.max(1),
            limits: settings.limits.clone(),
            lowest: initial_cost,
            best: initial_cost,
            since_best: 0,
        }
    }

    /// How to pick the next batch.
    pub(super) fn source(&self) -> Source {
        if self.since_best >= self.random_after { Source::Random } else { Source::Worst }
    }

    /// Whether there is no further batch.
    pub(super) fn stop(&self, batches: u32, elapsed: Duration) -> Option<StopReason> {
        if self.limits.is_target(self.lowest) {
            Some(StopReason::Target)
        } else if self.since_best >= self.patience {
            Some(StopReason::Converged)
        } else {
            self.limits.used_up(batches, elapsed)
        }
    }

    /// Takes note of a batch. `is_undone` says that what was not applied left no trace.
    pub(super) fn note(&mut self, row: &IterationRow, is_undone: bool) {
        let cost = row.cost;
        self.lowest = self.lowest.min(cost);
        if is_undone && row.applied == 0 && self.source() == Source::Worst {
            // The tree is what it was: the batches up to the random one would all be this one again.
            self.since_best = self.random_after.min(self.patience);
            return;
        }
        self.since_best += 1;
        // Not if it is no number.
        if cost < self.best * (1.0 - self.epsilon) {
            self.best = cost;
            self.since_best = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(cost: f64, applied: u32) -> IterationRow {
        IterationRow { cost, found: 9, owned: 9, applied, ..IterationRow::default() }
    }

    #[test]
    fn random_after_five_idle_batches_and_the_end_after_ten() {
        let mut rule = Schedule::new(&RbvhSettings::default(), 100.0);
        for idle in 1..=9 {
            rule.note(&row(100.0, 1), false);
            assert_eq!(rule.source(), if idle < 5 { Source::Worst } else { Source::Random }, "{idle}");
            assert_eq!(rule.stop(idle, Duration::ZERO), None);
        }
        rule.note(&row(99.0, 1), false);
        assert_eq!((rule.source(), rule.stop(10, Duration::ZERO)), (Source::Worst, None));
        (0..10).for_each(|_| rule.note(&row(99.5, 1), false));
        assert_eq!(rule.stop(20, Duration::ZERO), Some(StopReason::Converged));
    }

    #[test]
    fn a_batch_that_leaves_no_trace_is_not_repeated() {
        let mut rule = Schedule::new(&RbvhSettings::default(), 100.0);
        rule.note(&row(100.0, 0), true);
        assert_eq!(rule.source(), Source::Random);
        for _ in 0..5 {
            assert_eq!(rule.stop(1, Duration::ZERO), None);
            rule.note(&row(100.0, 0), true);
        }
        assert_eq!(rule.stop(6, Duration::ZERO), Some(StopReason::Converged));
    }

    #[test]
    fn an_improvement_within_epsilon_is_none() {
        let settings = RbvhSettings { epsilon: 1e-3, patience: 3, ..RbvhSettings::default() };
        let mut rule = Schedule::new(&settings, 100.0);
        rule.note(&row(99.8, 1), true);
        (1..=3).for_each(|k| rule.note(&row(99.8 - 0.01 * f64::from(k), 1), true));
        assert_eq!(rule.stop(4, Duration::ZERO), Some(StopReason::Converged));
        let mut rule = Schedule::new(&settings, 100.0);
        (0..3).for_each(|_| rule.note(&row(f64::NAN, 1), false));
        assert_eq!(rule.stop(3, Duration::ZERO), Some(StopReason::Converged));
    }

    #[test]
    fn the_target_ends_a_run() {
        let mut settings = RbvhSettings { patience: 1, ..RbvhSettings::default() };
        settings.limits.target_cost = Some(99.9999);
        let mut rule = Schedule::new(&settings, 100.0);
        assert_eq!(rule.stop(0, Duration::ZERO), None);
        rule.note(&row(f64::NAN, 1), true);
        assert_eq!(rule.stop(1, Duration::ZERO), Some(StopReason::Converged));
        rule.note(&row(99.9999, 1), true);
        assert_eq!(rule.stop(2, Duration::ZERO), Some(StopReason::Target), "also within epsilon");
        assert_eq!(Schedule::new(&settings, 99.0).stop(0, Duration::ZERO), Some(StopReason::Target));
    }

    #[test]
    fn limits() {
        let settings = RbvhSettings {
            limits: Limits { max_time: Some(Duration::from_secs(1)), ..Limits::iterations(3) },
            ..RbvhSettings::default()
        };
        let rule = Schedule::new(&settings, 1.0);
        assert_eq!(rule.stop(2, Duration::from_millis(999)), None);
        assert_eq!(rule.stop(3, Duration::ZERO), Some(StopReason::MaxIterations));
        assert_eq!(rule.stop(0, Duration::from_secs(1)), Some(StopReason::MaxTime));
    }
}

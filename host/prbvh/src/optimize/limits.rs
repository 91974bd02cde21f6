//! When and why an optimiser stops.

use crate::stop::Stop;
use std::time::Duration;

/// What ends an optimiser early. An iteration is a batch of RBVH.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Limits {
    /// Most iterations.
    pub max_iterations: u32,
    /// No iteration starts after this wall time since the optimiser began; of a [pipeline](crate::pipeline) since that began. A tree that is being built by
    /// then is built: it is the least that can be handed out.
    #[cfg_attr(feature = "serde", serde(rename = "max_time_s", with = "crate::written::seconds"))]
    pub max_time: Option<Duration>,
    /// No iteration starts once a tree has this cost or less; unitless, as [`IterationRow::cost`](super::IterationRow::cost).
    pub target_cost: Option<f64>,
    /// No iteration starts once this is asked for; a new top that is being made is the last. A [pipeline](crate::pipeline) that is asked before there is a
    /// tree ends soon without one, with an error.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub stop: Option<Stop>,
}

impl Limits {
    /// So many iterations, in any time and to any cost, whoever asks.
    #[must_use]
    pub const fn iterations(max_iterations: u32) -> Self {
        Self { max_iterations, max_time: None, target_cost: None, stop: None }
    }

    /// Whether the cost is as low as was asked for.
    pub(super) fn is_target(&self, cost: f64) -> bool {
        self.target_cost.is_some_and(|target| cost <= target)
    }

    /// Whether the caller wants an end.
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.as_ref().is_some_and(Stop::is_asked)
    }

    /// Whether the caller wants an end, or iterations or time are used up.
    pub(crate) fn used_up(&self, iterations: u32, elapsed: Duration) -> Option<StopReason> {
        if self.is_stopped() {
            Some(StopReason::Cancelled)
        } else if iterations >= self.max_iterations {
            Some(StopReason::MaxIterations)
        } else if self.max_time.is_some_and(|limit| elapsed >= limit) {
            Some(StopReason::MaxTime)
        } else {
            None
        }
    }
}

/// Why the optimiser stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum StopReason {
    /// The cost no longer changes by more than epsilon with µ = 1, or nothing moves.
    Converged,
    /// The most iterations were done.
    MaxIterations,
    /// The time was up.
    MaxTime,
    /// The cost is as low as was asked for.
    Target,
    /// The caller asked to stop.
    Cancelled,
    /// There was no optimiser to run.
    NoOptimizer,
}

impl std::fmt::Display for StopReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::MaxIterations => "iteration limit",
            Self::MaxTime => "time limit",
            Self::Target => "target cost reached",
            Self::Cancelled => "cancelled",
            Self::NoOptimizer => "no optimiser",
        })
    }
}

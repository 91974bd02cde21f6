//! When an optimiser stops though it has not converged.

use super::StopReason;
use serde::Serialize;
use std::time::Duration;

/// What ends an optimiser early. An iteration is a batch of RBVH.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Limits {
    /// Most iterations.
    pub max_iterations: u32,
    /// No iteration starts after this wall time.
    pub max_time: Option<Duration>,
    /// No iteration starts once a tree has this cost or less; unitless, as [`IterationRow::cost`](super::IterationRow::cost).
    pub target_cost: Option<f64>,
}

impl Limits {
    /// So many iterations, in any time and to any cost.
    #[must_use]
    pub const fn iterations(max_iterations: u32) -> Self {
        Self { max_iterations, max_time: None, target_cost: None }
    }

    /// Whether the cost is as low as was asked for.
    pub(super) fn is_target(&self, cost: f64) -> bool {
        self.target_cost.is_some_and(|target| cost <= target)
    }

    /// Whether iterations or time are used up.
    pub(super) fn used_up(&self, iterations: u32, elapsed: Duration) -> Option<StopReason> {
        if iterations >= self.max_iterations {
            Some(StopReason::MaxIterations)
        } else if self.max_time.is_some_and(|limit| elapsed >= limit) {
            Some(StopReason::MaxTime)
        } else {
            None
        }
    }
}

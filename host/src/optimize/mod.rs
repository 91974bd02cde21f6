//! The optimiser: PRBVH iterations until nothing is gained, the best tree kept.

mod prbvh;
mod schedule;

pub use prbvh::{Outcome, prbvh};
pub use schedule::{Epsilon, PrbvhSettings, StopReason};

use serde::Serialize;

/// What one iteration did. Row 0 is the initial tree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IterationRow {
    /// Number of the iteration, from 1; 0 is the initial tree.
    pub iteration: u32,
    /// Every `mu`-th node was searched.
    pub mu: u32,
    /// Wall time since the start of the optimisation, seconds.
    pub time_s: f64,
    /// Time on the device since the start of the optimisation, seconds.
    pub device_s: f64,
    /// SAH cost after the iteration, one triangle per leaf, from f32 areas.
    pub cost: f64,
    /// Reinsertions found.
    pub found: u32,
    /// Reinsertions that owned their locks.
    pub owned: u32,
    /// Reinsertions that changed the tree.
    pub applied: u32,
    /// Most steps of a single search.
    pub most_steps: u32,
}

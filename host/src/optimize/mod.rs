//! The optimiser: PRBVH iterations until nothing is gained, the best tree kept.

mod moves;
mod prbvh;
mod row;
mod schedule;

pub use moves::Strategy;
pub use prbvh::{Outcome, prbvh};
pub use schedule::{Epsilon, PrbvhSettings, StopReason};

pub use row::IterationRow;
pub(crate) use row::set_relative_errors;

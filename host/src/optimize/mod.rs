//! The optimiser: PRBVH iterations until nothing is gained, the best tree kept.

mod prbvh;
mod row;
mod schedule;

pub use prbvh::{Outcome, prbvh};
pub use schedule::{Epsilon, PrbvhSettings, StopReason};

pub use row::IterationRow;
pub(crate) use row::set_relative_errors;

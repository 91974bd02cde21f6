//! The optimisers: rounds of PRBVH until nothing is gained, and sequential RBVH to compare with; the best tree is kept.

mod areas;
mod current;
mod limits;
mod moves;
mod new_top;
mod prbvh;
mod published;
mod rbvh;
mod row;
mod schedule;
mod worst_first;

pub use areas::{TreeAreas, measure};
pub use current::{CurrentTree, DualRound};
pub use limits::Limits;
pub use moves::Strategy;
pub use prbvh::{Outcome, prbvh, prbvh_from};
pub(crate) use rbvh::rbvh_of;
pub use rbvh::{RbvhSettings, RbvhTree, rbvh};
pub use schedule::{Epsilon, Order, PrbvhSettings, StopReason, WorstFirst};

pub use row::IterationRow;
pub(crate) use row::set_relative_errors;

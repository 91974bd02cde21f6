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
mod session;
mod worst_first;
#[cfg(feature = "serde")]
mod written;

pub use areas::{TreeAreas, measure};
pub use current::{CurrentTree, DualRound};
pub use limits::{Limits, StopReason};
pub use moves::Strategy;
pub use prbvh::{prbvh, prbvh_from};
pub(crate) use rbvh::rbvh_of;
pub use rbvh::{RbvhSettings, RbvhTree, rbvh};
pub use schedule::{Epsilon, Order, PrbvhSettings, WorstFirst};
pub use session::Outcome;

pub use row::{IterationRow, set_relative_errors};

//! The optimisers: rounds of PRBVH until nothing is gained, and sequential RBVH to compare with; the best tree is kept. And the builders that are made of
//! RBVH's moves.

mod areas;
mod check;
mod contenders;
mod current;
mod error;
mod insertion;
mod ledger;
mod limits;
mod lists;
mod moves;
mod new_top;
mod pace;
mod prbvh;
mod published;
mod rbvh;
mod reoptimize;
mod rotations;
mod row;
mod run;
mod schedule;
mod search;
mod session;
mod worst_first;
#[cfg(feature = "serde")]
mod written;

#[doc(hidden)]
pub use areas::measure_unchecked;
pub use areas::{TreeAreas, measure};
pub use current::{CurrentTree, DualRound};
pub use error::OptimizeError;
pub use insertion::{InsertionSettings, OnlineSettings, insertion, online};
pub(crate) use insertion::{insertion_until, online_until};
pub use limits::{Limits, StopReason};
pub(crate) use lists::later_kernels;
pub use moves::Strategy;
#[doc(hidden)]
pub use prbvh::prbvh_unchecked;
pub use prbvh::{prbvh, prbvh_from};
pub(crate) use rbvh::rbvh_of;
pub use rbvh::{RbvhSettings, RbvhTree, rbvh};
pub use reoptimize::{Budget, ReoptimizeError, Reoptimizer, Shapes, Step};
#[doc(hidden)]
pub use rotations::rotations_unchecked;
pub use rotations::{RotationSettings, refit_rotating, rotations};
pub use schedule::{Epsilon, Order, PrbvhSettings, WorstFirst};
pub use session::Outcome;

pub use row::{IterationRow, set_relative_errors};

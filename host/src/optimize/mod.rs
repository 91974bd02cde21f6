//! The optimisers: PRBVH iterations until nothing is gained, and sequential RBVH to compare with; the best tree is kept.

mod current;
mod descent;
mod dual;
mod limits;
mod moves;
mod prbvh;
mod rbvh;
mod row;
mod schedule;
mod searching;

pub use current::CurrentTree;
pub use dual::MoveKind;
pub use limits::Limits;
pub use moves::Strategy;
pub use prbvh::{Outcome, prbvh};
pub(crate) use rbvh::rbvh_of;
pub use rbvh::{RbvhSettings, RbvhTree, rbvh};
pub use schedule::{Epsilon, Order, PrbvhSettings, StopReason};

pub use row::IterationRow;
pub(crate) use row::set_relative_errors;
pub(crate) use searching::kernels_of_list;

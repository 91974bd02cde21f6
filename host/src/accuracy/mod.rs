//! How far the numbers of a run are from the truth: every iteration against a referee in f64 on the host.
//!
//! Four things are compared, `docs/numerics.md` says why and what comes out: the cost from f32 areas with the cost of the downloaded
//! tree; the fall of the cost with the fall that the search predicted; what a walk of the search added up with what is computed from
//! the definition ("drift"); and that with the same in f64.

mod checker;
mod exact;
mod offers;
mod report;
mod rows;
mod spread;

pub use checker::NumericsCheck;
pub use exact::area_decrease;
pub use offers::{Candidate, Offer, Walk, kernel_walk, offers};
pub use report::table;
pub use rows::{AccuracyReport, AccuracyRow, Breach, BreachKind, SearchAccuracy};
pub use spread::Spread;

use prbvh_kernel::cost::COST_CHUNK;

/// Largest relative error of a device's f32 cost, in all cases and on all devices: roundings of 2^-24, of which a half area has 5 at
/// most, a sum over a chunk of areas one per term, and the division by the root's half area 5 again. Areas are not
/// negative, so that no sum cancels; 1 more than covers all products of roundings and the sums in f64.
pub const F32_COST_BOUND: f64 = (COST_CHUNK - 1 + 5 + 5 + 1) as f64 / (1u32 << 24) as f64;

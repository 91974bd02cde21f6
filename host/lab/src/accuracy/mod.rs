//! How far the numbers of a run are from the truth: every iteration against a referee in f64 on the host.
//!
//! Compared are the cost from f32 areas with the cost of the downloaded tree; the fall of the cost with the fall that the search
//! predicted; and what the search promised with what is computed from the definition, in f32 ("drift" of the walk) and in f64.
//! `docs/numerics.md` says why and what comes out.

mod checker;
mod dual;
mod exact;
mod offers;
mod report;
mod round;
mod rows;
mod spread;

pub use checker::NumericsCheck;
pub use dual::dual_area_decrease;
pub use exact::area_decrease;
pub use offers::{Candidate, Offer, Walk, kernel_walk, offers};
pub use report::table;
pub use rows::{AccuracyReport, AccuracyRow, Breach, BreachKind, SearchAccuracy};
pub use spread::Spread;

use prbvh::bvh::SahModel;
use prbvh_kernel::cost::COST_ADDITIONS;
use prbvh_kernel::sum::DIGITS;

/// Largest relative error of one f32 rounding.
const ROUNDING: f64 = 1.0 / (1u32 << 24) as f64;

/// Roundings in a cost beside those of its sums: 5 of a half area, 5 of the root's, and 1 that covers all products of roundings and
/// the sums in f64.
const AREA_ROUNDINGS: f64 = (5 + 5 + 1) as f64;

/// Largest relative error of a device's f32 cost that is measured on the whole tree, in all cases and on all devices: roundings of
/// 2^-24, of which a half area has 5 at most, a sum over a chunk of areas one per level of its tree, and the division by the root's half area 5
/// again. Areas are not negative, so that no sum cancels.
pub const F32_COST_BOUND: f64 = (COST_ADDITIONS as f64 + AREA_ROUNDINGS) * ROUNDING;

/// What a tree went through whose cost is that of the first tree less all changes of areas since
/// ([`prbvh_kernel::prbvh::worst`]). Costs are unitless.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Changes {
    /// Cost of the first tree.
    pub initial: f64,
    /// What the changes of all nodes are worth in all, up or down.
    pub cost: f64,
    /// Most changes of a node's area there can have been.
    pub count: u64,
}

impl Changes {
    /// Largest relative error of the f32 cost of a tree of this cost. The sums over chunks are those of the first tree; the areas in
    /// them and in the changes cancel as they are the same bits, so that those of the last tree are left. Each change is a
    /// difference of f32 numbers, rounded once and cut to units of a [`Sum`](prbvh_kernel::sum::Sum).
    #[must_use]
    pub fn cost_bound(&self, cost: f64) -> f64 {
        let sums = f64::from(COST_ADDITIONS) * ROUNDING * self.initial + ROUNDING * self.cost;
        // A unit is at most 2 of 2^-44 of the root's area.
        let cuts = SahModel::default().c_traversal * self.count as f64 * 2.0 * (-f64::from(DIGITS)).exp2();
        // Where all is 0 nothing can be off.
        AREA_ROUNDINGS * ROUNDING + if cost > 0.0 { (sums + cuts) / cost } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_of_a_changed_tree_is_that_of_the_first_and_what_the_changes_add() {
        assert_eq!(F32_COST_BOUND, 21.0 * ROUNDING);
        let unchanged = Changes { initial: 100.0, cost: 0.0, count: 0 };
        assert!((unchanged.cost_bound(100.0) / F32_COST_BOUND - 1.0).abs() < 1e-12);
        let changed = Changes { cost: 300.0, ..unchanged };
        assert!((changed.cost_bound(50.0) / ROUNDING - (2.0 * 10.0 + 6.0 + 11.0)).abs() < 1e-6);
        let cut = Changes { count: 1 << 30, ..changed };
        assert!(cut.cost_bound(50.0) > changed.cost_bound(50.0));
        assert_eq!(Changes::default().cost_bound(0.0), AREA_ROUNDINGS * ROUNDING);
    }
}

//! The cost of a tree from what its areas have lost: the device sums up, in integers ([`prbvh_kernel::sum`]).

use super::{Limits, TreeAreas};
use crate::bvh::SahModel;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::status::{GREW, REPORT_WORDS, SHRUNK};
use prbvh_kernel::sum::{scale_of, to_f64};

/// A row of the report of a device.
pub(super) type Report = [u32; REPORT_WORDS as usize];

/// No tree has lost as much.
const NEVER: i64 = i64::MAX;

/// What a run has gained so far.
#[derive(Debug)]
pub(super) struct Ledger {
    pub(super) areas: TreeAreas,
    references: u32,
    /// Units of a sum in an area.
    pub(super) scale: f32,
    /// Area that the tree has lost so far.
    lost: f64,
    /// The same of the best tree, and its cost.
    most_lost: f64,
    pub(super) best_cost: f64,
}

impl Ledger {
    /// Of a tree with these areas.
    pub(super) fn new(areas: TreeAreas, references: u32) -> Self {
        let best_cost = areas.cost(references);
        Self { areas, references, scale: scale_of(areas.root), lost: 0.0, most_lost: 0.0, best_cost }
    }

    /// Cost of the tree as it is now.
    pub(super) fn cost(&self) -> f64 {
        TreeAreas { internal: self.areas.internal - self.lost, ..self.areas }.cost(self.references)
    }

    /// Takes note of a round; returns the cost after it.
    pub(super) fn note(&mut self, report: &Report) -> f64 {
        let change = |word| to_f64(report[word], report[word + 1], self.scale);
        self.lost += change(SHRUNK) - change(GREW);
        self.note_best()
    }

    /// Takes note of what the best tree has lost beside the rounds; returns the cost after it.
    pub(super) fn note_beside(&mut self, decrease: f64) -> f64 {
        self.lost = self.most_lost + decrease;
        self.note_best()
    }

    fn note_best(&mut self) -> f64 {
        let cost = self.cost();
        if cost < self.best_cost {
            self.best_cost = cost;
            self.most_lost = self.lost;
        }
        cost
    }

    /// What all rounds have in common.
    pub(super) fn params(&self, limits: &Limits) -> RoundParams {
        let SahModel { c_traversal, c_intersect } = SahModel::default();
        let scale = f64::from(self.scale);
        let total = self.areas.internal + self.areas.leaves * (c_intersect / c_traversal);
        let at_target = |cost: f64| ((total - cost * self.areas.root / c_traversal) * scale).ceil() as i64;
        let target = limits.target_cost.filter(|_| self.areas.root > 0.0).map_or(NEVER, at_target);
        RoundParams {
            root_area: self.areas.root as f32,
            scale: self.scale,
            total: (total * scale) as f32,
            target: [target as u32, (target >> 32) as u32],
            ..bytemuck::Zeroable::zeroed()
        }
    }

    /// A change of the cost in the unit of the sums.
    pub(super) fn units(&self, change: f64) -> f32 {
        (change * self.areas.root / SahModel::default().c_traversal * f64::from(self.scale)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh_kernel::sum::Sum;

    const AREAS: TreeAreas = TreeAreas { root: 4.0, leaves: 6.0, internal: 20.0 };

    #[test]
    fn the_cost_falls_with_the_sum_of_the_areas() {
        let mut ledger = Ledger::new(AREAS, 5);
        assert_eq!(ledger.cost(), 18.0);
        let unit = ledger.scale;
        let mut row = Report::default();
        row[SHRUNK + 1] = (4.0 * unit / 4_294_967_296.0) as u32;
        assert_eq!(ledger.note(&row), 15.0);
        row.swap(SHRUNK + 1, GREW + 1);
        assert_eq!(ledger.note(&row), 18.0);
        assert_eq!(ledger.best_cost, 15.0);
        assert_eq!(ledger.note_beside(0.0), 15.0);
        assert_eq!(ledger.units(3.0), 4.0 * unit);
    }

    #[test]
    fn the_device_knows_the_target_in_its_own_unit() {
        let ledger = Ledger::new(AREAS, 5);
        let lost = |area: f32| Sum::of(area, ledger.scale);
        let params = |target_cost| ledger.params(&Limits { target_cost, ..Limits::iterations(1) });
        let at = Sum::from_words(params(Some(15.0)).target);
        assert!(!at.exceeds(lost(4.0)) && at.exceeds(lost(3.9999)));
        assert!(Sum::from_words(params(None).target).exceeds(lost(2e4)));
        assert!(Sum::ZERO.exceeds(Sum::from_words(params(Some(99.0)).target)), "reached from the beginning");
        assert_eq!(params(None).total, 24.0 * ledger.scale);
        let flat = Ledger::new(TreeAreas { root: 0.0, leaves: 0.0, internal: 0.0 }, 5);
        let never = flat.params(&Limits { target_cost: Some(15.0), ..Limits::iterations(1) }).target;
        assert!(Sum::from_words(never).exceeds(lost(2e4)));
    }
}

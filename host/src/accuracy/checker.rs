//! The check of a run, fed with its iterations.

use super::{AccuracyReport, AccuracyRow, Breach, BreachKind, F32_COST_BOUND, Offer, SearchAccuracy};
use super::{kernel_walk, offers};
use crate::bvh::{self, Bvh, SahModel, quality};
use crate::device::DeviceError;
use crate::optimize::{CurrentTree, IterationRow, Order, Strategy};
use crate::pipeline::{Optimizer, Settings};
use crate::scene::Scene;
use prbvh_kernel::node::{Node, ROOT};
use prbvh_kernel::prbvh::PrbvhParams;
use std::ops::ControlFlow;

/// Largest relative error of one f32 rounding.
const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

/// Roundings in a predicted decrease beside those of its terms: 2 of the sum, 5 of the root's area, the rest for their products.
const PREDICTION_ROUNDINGS: f64 = 8.0;

/// Compares every iteration of a run with the referee. It downloads the tree and repeats the search on the host, so the times of a
/// checked run are not those of another.
#[derive(Debug)]
pub struct NumericsCheck<'a> {
    scene: &'a Scene,
    /// None where another optimiser than PRBVH runs, or searches that one set of parameters does not describe.
    strategy: Option<Strategy>,
    before: Option<(Vec<Node>, f64)>,
    report: AccuracyReport,
    failure: Option<DeviceError>,
}

impl<'a> NumericsCheck<'a> {
    /// Of a run over `scene` with these settings.
    #[must_use]
    pub fn new(scene: &'a Scene, settings: &Settings) -> Self {
        // Only the published order searches with one set of parameters in an iteration.
        let is_single = settings.optimizer == Optimizer::Prbvh && settings.prbvh.order == Order::Published;
        let strategy = is_single.then_some(settings.prbvh.strategy);
        let report =
            AccuracyReport { cost_bound: F32_COST_BOUND, search: None, breaches: Vec::new(), rows: Vec::new() };
        Self { scene, strategy, before: None, report, failure: None }
    }

    /// Takes the next iteration, from row 0 on, and the tree after it. Breaks where the device fails.
    pub fn observe(&mut self, row: &IterationRow, mut tree: CurrentTree<'_>) -> ControlFlow<()> {
        let nodes = match tree.nodes() {
            Ok(nodes) => nodes,
            Err(error) => {
                self.failure = Some(error);
                return ControlFlow::Break(());
            }
        };
        let triangles = &self.scene.triangles;
        let cost = |tree: Bvh| quality(&tree.with_boxes_of(triangles), &SahModel::default()).sah_cost;
        let decoded = tree.on_host(|| Bvh::from_device(&nodes).map(cost));
        let exact_cost = match decoded {
            Ok(cost) => cost,
            Err(faults) => {
                self.breach(row, BreachKind::Tree, format!("no tree: {}", bvh::summary(&faults)));
                // Nothing can be said of an iteration that starts from it.
                self.before = None;
                return ControlFlow::Continue(());
            }
        };
        let mut checked = AccuracyRow {
            iteration: row.iteration,
            time_s: row.time_s,
            exact_cost,
            // Both may be 0.
            cost_error: if row.cost == exact_cost { 0.0 } else { (row.cost / exact_cost - 1.0).abs() },
            predicted_decrease: row.predicted_decrease,
            measured_decrease: 0.0,
            prediction_bound: None,
            search: None,
        };
        if !is_at_most(checked.cost_error, F32_COST_BOUND) {
            let what = format!("the cost is {}, {exact_cost} in f64: {:.1e} off", row.cost, checked.cost_error);
            self.breach(row, BreachKind::Cost, format!("{what}, {F32_COST_BOUND:.1e} is allowed"));
        }
        if let Some((before, cost_before)) = self.before.take() {
            checked.measured_decrease = cost_before - exact_cost;
            if let Some(strategy) = self.strategy {
                let params = searched(row, &before);
                let found = tree.on_host(|| offers(&before, &params, &kernel_walk));
                self.search(row, &mut checked, &params, &found);
                if strategy == Strategy::Conservative {
                    self.prediction(row, &mut checked, &before, &found);
                }
            }
        }
        self.before = Some((nodes, exact_cost));
        self.report.rows.push(checked);
        ControlFlow::Continue(())
    }

    /// What was found.
    ///
    /// # Errors
    /// If the device failed on the way.
    pub fn finish(self) -> Result<AccuracyReport, DeviceError> {
        match self.failure {
            Some(error) => Err(error),
            None => Ok(self.report),
        }
    }

    fn breach(&mut self, row: &IterationRow, kind: BreachKind, what: String) {
        self.report.breaches.push(Breach { iteration: row.iteration, kind, what });
    }

    fn search(&mut self, row: &IterationRow, checked: &mut AccuracyRow, params: &PrbvhParams, found: &[Offer]) {
        let search = SearchAccuracy::of(params.count, found);
        if search.offered != u64::from(row.found) {
            let what = format!("the search found {} moves, and {} on the host", row.found, search.offered);
            self.breach(row, BreachKind::Search, what);
        }
        self.report.search.get_or_insert_default().merge(&search);
        checked.search = Some(search);
    }

    /// Reinsertions that do not meet take off the cost what they take off alone: only the roundings of what was offered are left.
    fn prediction(&mut self, row: &IterationRow, checked: &mut AccuracyRow, before: &[Node], found: &[Offer]) {
        let taken = found.iter().filter(|offer| offer.direct > 0.0);
        let of_terms: f64 = taken.map(|offer| (f64::from(offer.direct) - offer.exact).abs()).sum();
        let root = f64::from(before[ROOT as usize].aabb().half_area());
        let of_terms = if root > 0.0 { SahModel::default().c_traversal * of_terms / root } else { 0.0 };
        let of_sums = PREDICTION_ROUNDINGS * ROUNDING * row.predicted_decrease;
        // Both costs are sums over all nodes.
        let of_costs = f64::EPSILON * before.len() as f64 * (checked.exact_cost + checked.measured_decrease.abs());
        let bound = of_terms + of_sums + of_costs;
        checked.prediction_bound = Some(bound);
        let apart = (checked.measured_decrease - row.predicted_decrease).abs();
        if !is_at_most(apart, bound) {
            let (measured, predicted) = (checked.measured_decrease, row.predicted_decrease);
            let what = format!("the cost fell by {measured}, not by {predicted}: {apart:.1e} apart");
            self.breach(row, BreachKind::Prediction, format!("{what}, roundings allow {bound:.1e}"));
        }
    }
}

/// A NaN is at most nothing.
fn is_at_most(value: f64, bound: f64) -> bool {
    value <= bound
}

/// Which nodes the iteration of a row searched.
fn searched(row: &IterationRow, before: &[Node]) -> PrbvhParams {
    let nodes = before.len() as u32;
    let mu = row.mu.max(1);
    let first = row.iteration.saturating_sub(1) % mu;
    PrbvhParams::every(mu, first, nodes)
}

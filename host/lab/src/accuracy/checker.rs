//! The check of a run, fed with its iterations.

use super::round::check_round;
use super::{
    AccuracyReport, AccuracyRow, Breach, BreachKind, Changes, F32_COST_BOUND, Offer, ROUNDING, SearchAccuracy,
    kernel_walk, offers,
};
use prbvh::bvh::{self, Bvh, SahModel, quality};
use prbvh::device::DeviceError;
use prbvh::optimize::{CurrentTree, DualRound, IterationRow, Order, Strategy};
use prbvh::pipeline::{Optimizer, Settings};
use prbvh::scene::Scene;
use prbvh_kernel::node::{Node, ROOT};
use prbvh_kernel::prbvh::PrbvhParams;
use std::ops::ControlFlow;

/// Roundings in a predicted decrease beside those of its terms: 2 of the sum, 5 of the root's area, the rest for their products.
const PREDICTION_ROUNDINGS: f64 = 8.0;

/// What searches on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Searches {
    /// Nothing: another optimiser runs, or none.
    None,
    /// The published order.
    Published(Strategy),
    /// Rounds of dual moves.
    WorstFirst,
}

impl Searches {
    fn of(settings: &Settings) -> Self {
        match (&settings.optimizer, settings.prbvh.order) {
            (Optimizer::Prbvh, Order::Published) => Self::Published(settings.prbvh.strategy),
            (Optimizer::Prbvh, Order::WorstFirst) => Self::WorstFirst,
            _ => Self::None,
        }
    }
}

/// Compares every iteration of a run with the referee. It downloads the tree and repeats the search on the host, so the times of a
/// checked run are not those of another.
#[derive(Debug)]
pub struct NumericsCheck<'a> {
    scene: &'a Scene,
    searches: Searches,
    before: Option<(Vec<Node>, f64)>,
    changes: Changes,
    report: AccuracyReport,
    failure: Option<DeviceError>,
}

impl<'a> NumericsCheck<'a> {
    /// Of a run over `scene` with these settings.
    #[must_use]
    pub fn new(scene: &'a Scene, settings: &Settings) -> Self {
        let report = AccuracyReport { search: None, breaches: Vec::new(), rows: Vec::new() };
        let searches = Searches::of(settings);
        Self { scene, searches, before: None, changes: Changes::default(), report, failure: None }
    }

    /// Takes the next iteration, from row 0 on, and the tree after it. Breaks where the device fails.
    pub fn observe(&mut self, row: &IterationRow, mut tree: CurrentTree<'_>) -> ControlFlow<()> {
        // The device adds up what changed.
        let adds_up = self.searches != Searches::None && row.iteration > 0;
        // A new top is none.
        let is_round = self.searches == Searches::WorstFirst && row.iteration > 0 && row.searched > 0;
        let round = if is_round { tree.dual_round(row.searched) } else { Ok(None) };
        let (nodes, round) = match (tree.nodes(), round) {
            (Ok(nodes), Ok(round)) => (nodes, round),
            (Err(error), _) | (_, Err(error)) => {
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
        if row.iteration == 0 {
            self.changes.initial = exact_cost;
        } else if let (true, Some((before, _))) = (adds_up, &self.before) {
            let (cost, count) = tree.on_host(|| changed(before, &nodes));
            self.changes =
                Changes { cost: self.changes.cost + cost, count: self.changes.count + count, ..self.changes };
        }
        let cost_bound = if adds_up { self.changes.cost_bound(exact_cost) } else { F32_COST_BOUND };
        let mut checked = AccuracyRow {
            iteration: row.iteration,
            time_s: row.time_s,
            exact_cost,
            // Both may be 0.
            cost_error: if row.cost == exact_cost { 0.0 } else { (row.cost / exact_cost - 1.0).abs() },
            cost_bound,
            predicted_decrease: row.predicted_decrease,
            measured_decrease: 0.0,
            prediction_bound: None,
            search: None,
        };
        if !is_at_most(checked.cost_error, cost_bound) {
            let what = format!("the cost is {}, {exact_cost} in f64: {:.1e} off", row.cost, checked.cost_error);
            self.breach(row, BreachKind::Cost, format!("{what}, {cost_bound:.1e} is allowed"));
        }
        if let Some((before, cost_before)) = self.before.take() {
            checked.measured_decrease = cost_before - exact_cost;
            match self.searches {
                Searches::None => {}
                Searches::WorstFirst if !is_round => self.new_top(row, &mut checked),
                Searches::WorstFirst => self.round(row, &mut checked, &before, round.as_ref(), &tree),
                Searches::Published(strategy) => {
                    let params = searched(row, &before);
                    let found = tree.on_host(|| offers(&before, &params, &kernel_walk));
                    self.search(row, &mut checked, &params, &found);
                    if strategy == Strategy::Conservative {
                        self.prediction(row, &mut checked, &before, &found);
                    }
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

    fn round(
        &mut self,
        row: &IterationRow,
        checked: &mut AccuracyRow,
        before: &[Node],
        round: Option<&DualRound>,
        tree: &CurrentTree<'_>,
    ) {
        let Some(round) = round else {
            self.breach(row, BreachKind::Search, "nobody took note of the search".to_owned());
            return;
        };
        let (search, faults) = tree.on_host(|| check_round(before, row, round));
        for (kind, what) in faults {
            self.breach(row, kind, what);
        }
        self.report.search.get_or_insert_default().merge(&search);
        checked.search = Some(search);
    }

    /// What a new top is worth is the difference of two sums; nothing is searched that could promise more.
    fn new_top(&mut self, row: &IterationRow, checked: &mut AccuracyRow) {
        let bound = checked.cost_bound * (2.0 * checked.exact_cost + checked.measured_decrease.abs());
        checked.prediction_bound = Some(bound);
        self.predicted(row, checked, bound);
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
        self.predicted(row, checked, bound);
    }

    fn predicted(&mut self, row: &IterationRow, checked: &AccuracyRow, bound: f64) {
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

/// What the changes of the areas of internal nodes are worth in all, and how many nodes have another.
fn changed(before: &[Node], after: &[Node]) -> (f64, u64) {
    let area = |node: &Node| f64::from(node.aabb().half_area());
    let pairs = before.iter().zip(after).take(before.len() / 2);
    let changes = pairs.map(|(before, after)| (area(before) - area(after)).abs()).filter(|change| *change != 0.0);
    let (sum, count) = changes.fold((0.0, 0), |(sum, count), change| (sum + change, count + 1));
    let root = before.first().map_or(0.0, area);
    (if root > 0.0 { SahModel::default().c_traversal * sum / root } else { 0.0 }, count)
}

/// Which nodes the iteration of a row searched.
fn searched(row: &IterationRow, before: &[Node]) -> PrbvhParams {
    let nodes = before.len() as u32;
    let mu = row.mu.max(1);
    let first = row.iteration.saturating_sub(1) % mu;
    PrbvhParams::every(mu, first, nodes)
}

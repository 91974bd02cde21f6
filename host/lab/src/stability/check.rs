//! One method on one case on one device: the runs, and what is wrong with them.

use super::ready::Ready;
use super::row::{Property, Row};
use super::subject::{RunError, Subject, working_nodes};
use super::{Lane, Method, rays};
use crate::accuracy::{self, F32_COST_BOUND};
use crate::render::TracedTree;
use prbvh::bvh::{self, Bvh, SahModel, quality, topology_hash, tree_hash};
use prbvh::device::Device;
use prbvh::optimize::{Limits, Order, PrbvhSettings, StopReason};
use prbvh::pipeline::{Optimized, Optimizer, Settings};
use prbvh_kernel::prbvh::dual::MAX_ROUNDS;
use prbvh_kernel::prbvh::search::MAX_STEPS;

/// Largest relative change of an optimised cost after the axes changed places. The initial tree is the same and costs the same, but a
/// half area is rounded in another way (`dy (dx + dz) + dz dx` is not symmetric), so that a tie may fall to another side and the
/// search may end in another local minimum. The bound is the default of [`PrbvhSettings::epsilon`], a change that counts as none; it is
/// not derived, as a greedy search may turn one rounding into any cost. Where nothing is rounded the topology must be the same.
pub const AXES_BOUND: f64 = 1e-4;

/// The same for dual moves, which leave more minima behind and so have more to end in: twice the largest change of the table.
pub const DUAL_AXES_BOUND: f64 = 2e-3;

/// Largest coordinate of a scene below which the planes that pieces end at may be denormal, though its corners are not.
const LEAST_FOR_PLANES: f32 = f32::from_bits((127 - 100) << 23);

/// Part of a cost that sums in f64 may lose.
const F64_BOUND: f64 = 1e-12;

/// Everything about one row but the comparison of devices. `is_first`: the lane on which all variants are run; on the others
/// the first scaled scene stands for them.
pub(super) fn check(ready: &Ready<'_>, method: &Method, lane: &mut Lane, is_first: bool, subject: &dyn Subject) -> Row {
    let mut row = Row {
        case: ready.case.name.to_owned(),
        method: method.name.to_owned(),
        device: lane.name.clone(),
        triangles: ready.scene.triangles.len() as u32,
        left_out: ready.left_out,
        ..Row::default()
    };
    if let Some(fault) = &ready.screening {
        row.breach(Property::Screened, fault);
    }
    let result = match subject.run(&ready.scene, &method.settings, &mut *lane.device) {
        Ok(result) => result,
        Err(error) => {
            let is_tree = matches!(error, RunError::InvalidTree(_))
                || matches!(error, RunError::Pipeline(prbvh::pipeline::PipelineError::InvalidTree { .. }));
            row.breach(if is_tree { Property::Valid } else { Property::Runs }, error.to_string());
            return row;
        }
    };
    ended(&mut row, method, &result);
    costs(&mut row, method, &result);
    match bvh::validate_tree(&result.tree, &ready.scene.triangles) {
        Ok(_) => row.valid = true,
        Err(faults) => {
            // Nothing below can walk it.
            row.breach(Property::Valid, bvh::summary(&faults));
            return row;
        }
    }
    row.depth = Some(quality(&result.tree, &SahModel::default()).max_depth);
    if let Some(fault) = method.settings.max_depth.fault(&result.tree) {
        row.breach(Property::Depth, fault.to_string());
    }
    row.tree_hash = Some(tree_hash(&result.tree));
    let variants = Variants { ready, method, subject, result: &result };
    if let Err(error) = variants.run(&mut row, lane, is_first) {
        row.breach(Property::Runs, error.to_string());
    }
    row
}

fn ended(row: &mut Row, method: &Method, result: &Optimized) {
    row.iterations = result.outcome.rows.last().map_or(0, |row| row.iteration);
    row.most_steps = result.outcome.rows.iter().map(|row| row.most_steps).max().unwrap_or(0);
    // RBVH opens nodes in the order of what they promise; its bound is the tree.
    let is_bounded = method.settings.optimizer == Optimizer::Prbvh;
    let most = match method.settings.prbvh.order {
        Order::Published => MAX_STEPS,
        _ => MAX_ROUNDS,
    };
    if is_bounded && row.most_steps > most {
        row.breach(Property::Steps, format!("a search took {} steps of {most}", row.most_steps));
    }
    let stop = result.outcome.stop;
    if method.optimizes {
        row.stop = stop.to_string();
    }
    let by_itself = if method.optimizes { StopReason::Converged } else { StopReason::MaxIterations };
    if stop != by_itself {
        row.breach(Property::Ends, format!("{stop} after {} iterations", row.iterations));
    }
}

fn costs(row: &mut Row, method: &Method, result: &Optimized) {
    let (before, single) = (result.initial.sah_cost, result.quality.sah_cost);
    let after = result.adaptive.map_or(single, |quality| quality.sah_cost);
    (row.cost_before, row.cost_after) = (Some(before), Some(after));
    let device = result.outcome.rows.iter().map(|row| row.cost);
    row.finite = [before, single, after].into_iter().chain(device).all(f64::is_finite);
    if !row.finite {
        let bad = result.outcome.rows.iter().find(|row| !row.cost.is_finite());
        let place = bad.map_or_else(String::new, |row| format!(", iteration {}: {}", row.iteration, row.cost));
        row.breach(Property::Finite, format!("costs {before}, {single}, {after}{place}"));
    }
    // Written so that a NaN is a breach.
    let is_at_most = |a: f64, b: f64| a <= b;
    // A bound on the depth may cost something.
    let optimized = result.optimized_cost();
    // Equal trees over pieces may be added up in another order.
    let rounding = if method.settings.splits() { F64_BOUND } else { 0.0 };
    if !is_at_most(optimized, before * (1.0 + rounding)) {
        row.breach(Property::NotWorse, format!("{optimized:e} above the initial {before:e}"));
    }
    // The same leaves may be added up in another order.
    if !is_at_most(after, single * (1.0 + F64_BOUND)) {
        row.breach(Property::NotWorse, format!("{after:e} with adaptive leaves, {single:e} without"));
    }
    let Some(first) = result.outcome.rows.first() else {
        row.breach(Property::Runs, format!("{} has no row of its initial tree", method.name));
        return;
    };
    let error = |device: f64, referee: f64| (device / referee - 1.0).abs();
    let errors = [error(first.cost, before), error(result.outcome.best().cost, optimized)];
    let largest = if errors.iter().any(|error| error.is_nan()) { f64::NAN } else { errors[0].max(errors[1]) };
    row.f32_error = Some(largest);
    if !is_at_most(largest, F32_COST_BOUND) {
        let what = format!("{:.1e} before and {:.1e} after, {F32_COST_BOUND:.1e} is allowed", errors[0], errors[1]);
        row.breach(Property::F32Cost, what);
    }
}

/// Other runs that must agree with the first.
struct Variants<'a> {
    ready: &'a Ready<'a>,
    method: &'a Method,
    subject: &'a dyn Subject,
    result: &'a Optimized,
}

impl Variants<'_> {
    fn run(&self, row: &mut Row, lane: &mut Lane, is_first: bool) -> Result<(), RunError> {
        let scaled = if is_first { self.ready.scaled.len() } else { 1 };
        for (exponent, scene) in self.ready.scaled.iter().take(scaled) {
            if self.method.settings.splits() && scene.census.largest_coordinate < LEAST_FOR_PLANES {
                continue;
            }
            let other = self.subject.run(scene, &self.method.settings, &mut *lane.device)?;
            let costs = [&other, self.result].map(|result| result.quality.sah_cost.to_bits());
            if topology_hash(&other.tree) != topology_hash(&self.result.tree) || costs[0] != costs[1] {
                let costs = costs.map(f64::from_bits);
                row.breach(Property::Scale, format!("times 2^{exponent}: costs {costs:?} and another topology"));
            } else {
                row.scaled_by.push(*exponent);
            }
        }
        if is_first {
            for (name, device) in &mut lane.witnesses {
                self.repeats(row, name, &mut **device)?;
            }
            if lane.witnesses.is_empty() {
                self.repeats(row, "again", &mut *lane.device)?;
            }
            if self.method.has_moves() {
                self.axes_and_moves(row, &mut *lane.device)?;
            }
        }
        if !self.ready.rays.is_empty() {
            self.rays(row, &mut *lane.device);
        }
        Ok(())
    }

    fn repeats(&self, row: &mut Row, name: &str, device: &mut dyn Device) -> Result<(), RunError> {
        let other = self.subject.run(&self.ready.scene, &self.method.settings, device)?;
        if tree_hash(&other.tree) == tree_hash(&self.result.tree) {
            row.repeated.push(name.to_owned());
        } else {
            row.breach(Property::Repeats, format!("{name}: another tree, cost {}", other.quality.sah_cost));
        }
        Ok(())
    }

    fn axes_and_moves(&self, row: &mut Row, device: &mut dyn Device) -> Result<(), RunError> {
        let Settings { initial, morton_bits, prbvh, max_depth, .. } = &self.method.settings;
        let builder = Settings::default().with(|s| {
            s.initial = initial.clone();
            s.morton_bits = *morton_bits;
            s.prbvh = prbvh.clone().with(|s| s.limits = Limits::iterations(0));
            s.max_depth = *max_depth;
        });
        let initial = self.subject.run(&self.ready.scene, &builder, device)?.tree;
        self.moves(row, &[&initial, &self.result.tree], prbvh.order, device)?;
        self.axes(row, &initial, prbvh, device)
    }

    fn axes(
        &self,
        row: &mut Row,
        initial: &Bvh,
        prbvh: &PrbvhSettings,
        device: &mut dyn Device,
    ) -> Result<(), RunError> {
        let cost = |tree: &Bvh| quality(tree, &SahModel::default()).sah_cost;
        // Not the row's tree: what goes through the host comes back with its nodes in another order.
        let plain = self.subject.improve(&self.ready.scene, initial, prbvh, device)?;
        let mut largest = 0.0f64;
        for (axes, scene) in &self.ready.turned {
            let start = initial.clone().with_boxes_of(&scene.triangles);
            let start_change = (cost(&start) / cost(initial) - 1.0).abs();
            if start_change > F64_BOUND {
                row.breach(Property::Axes, format!("{axes:?}: the cost of one tree changed by {start_change:e}"));
            }
            let turned = self.subject.improve(scene, &start, prbvh, device)?;
            let change = (cost(&turned) / cost(&plain) - 1.0).abs();
            largest = largest.max(change);
            if self.ready.case.is_exact && topology_hash(&turned) != topology_hash(&plain) {
                row.breach(Property::Axes, format!("{axes:?}: another topology though nothing is rounded"));
            }
            // Written so that a NaN is a breach.
            let bound = match prbvh.order {
                Order::Published => AXES_BOUND,
                _ => DUAL_AXES_BOUND,
            };
            if change.partial_cmp(&bound) != Some(std::cmp::Ordering::Less) {
                row.breach(Property::Axes, format!("{axes:?}: the optimised cost changed by {change:e}"));
            }
        }
        row.axes_change = Some(largest);
        Ok(())
    }

    fn moves(&self, row: &mut Row, trees: &[&Bvh], order: Order, device: &mut dyn Device) -> Result<(), RunError> {
        let mut count = 0;
        for (tree, which) in trees.iter().zip(["initial", "final"]) {
            let nodes = working_nodes(&self.ready.scene, tree)?;
            let mut noise = Vec::new();
            for found in self.subject.search(&nodes, order, device)? {
                if found.output == bvh::NO_NODE {
                    continue;
                }
                count += 1;
                let decrease = match order {
                    Order::Published => Some(accuracy::area_decrease(&nodes, found.input(), found.output)),
                    _ => accuracy::dual_area_decrease(&nodes, &found),
                };
                // Written so that a NaN is a breach, and so is what is no move.
                if decrease.is_none_or(|decrease| decrease.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater)) {
                    noise.push(format!("{found:?}, in f64 {decrease:?}"));
                }
            }
            if let Some(first) = noise.first() {
                let what = format!("{} moves in the {which} tree lower no cost, such as {first}", noise.len());
                row.breach(Property::Moves, what);
            }
        }
        row.moves = Some(count);
        Ok(())
    }

    fn rays(&self, row: &mut Row, device: &mut dyn Device) {
        let Ready { scene, rays: cast, hits: expected, .. } = self.ready;
        let wide = self.result.wide.as_ref().map(|wide| TracedTree::Wide(&wide.tree));
        let tree = wide.unwrap_or(TracedTree::Binary(&self.result.tree));
        match rays::through(tree, &scene.triangles, cast, device) {
            Err(error) => row.breach(Property::Rays, error.to_string()),
            Ok(hits) => match rays::first_difference(&hits, expected) {
                Some(k) => {
                    let what = format!("ray {k} hits {:?}, without a tree {:?}", hits.get(k), expected.get(k));
                    row.breach(Property::Rays, what);
                }
                None => row.rays = hits.len() as u32,
            },
        }
        let Some(eye) = self.ready.case.inside else { return };
        match rays::indoors(tree, scene, eye, device) {
            Err(error) => row.breach(Property::Rays, error.to_string()),
            Ok([left, hit]) if left == 0 || hit < left => {
                row.breach(Property::Rays, format!("{hit} of {left} rays that leave a wall of a closed room hit one"));
            }
            Ok(_) => {}
        }
    }
}

//! One scene through the pipeline, as `prbvh optimize` runs it: limits, progress, checks, report, files.

use super::check_max_depth;
use super::interrupt::{Held, Interrupt};
use super::log::Log;
use super::optimize_args::OptimizeArgs;
use anyhow::Context;
use clap::ValueEnum;
use prbvh::bvh::{self, DepthBound, SAH_BUDGET, SahModel};
use prbvh::device::{Device, Meter};
use prbvh::optimize::{Epsilon, IterationRow, Limits, Order};
use prbvh::pipeline::{self, Initial, Optimized, Optimizer, Settings};
use prbvh::plan::{DeviceCode, Plan};
use prbvh::scene::Scene;
use prbvh_lab::accuracy::{AccuracyReport, NumericsCheck};
use prbvh_lab::reference::{ReferenceCost, ReferenceCosts};
use prbvh_lab::report::{self, Machine, Memory, PhaseTimes, Program, QualityReport, RunReport, SceneReport};
use std::ops::ControlFlow;
use std::path::Path;

/// Files of a run in its folder.
pub(super) const OUTPUTS: [&str; 5] = {
    let [report, iterations, convergence, accuracy] = RunReport::FILES;
    [TREE, report, iterations, convergence, accuracy]
};

const TREE: &str = "tree.bvh";

/// What a run reads beside its scenes.
pub(super) fn other_inputs<'a>(args: &'a OptimizeArgs, settings: &'a Settings) -> impl Iterator<Item = &'a Path> {
    let initial = match &settings.initial {
        Initial::File(path) => Some(&**path),
        _ => None,
    };
    initial.into_iter().chain(args.scenes.list())
}

/// The settings for a scene, with the cost at which its run may end, and the lowest cost known.
pub(super) fn settings_for(
    args: &OptimizeArgs,
    settings: &Settings,
    scene: &Scene,
) -> anyhow::Result<(Settings, Option<ReferenceCost>)> {
    let mut settings = settings.clone();
    check_max_depth(settings.max_depth, scene)?;
    let known = known_cost(scene)?;
    args.target.apply(&mut settings, scene, known.as_ref())?;
    Ok((settings, known))
}

/// An optimised scene.
pub(super) struct Done<'a> {
    pub(super) result: Optimized,
    pub(super) report: RunReport,
    /// Since the first tree, until all is written.
    pub(super) held: Option<Held<'a>>,
}

/// Runs the pipeline. A signal ends it with the best tree so far; before the first tree it ends the program.
pub(super) fn optimized<'a>(
    args: &OptimizeArgs,
    settings: &Settings,
    scene: &Scene,
    known: Option<&ReferenceCost>,
    device: &mut dyn Device,
    (log, interrupt): (&Log, &'a Interrupt),
) -> anyhow::Result<Done<'a>> {
    let device = &mut Meter::new(device);
    let mut stoppable = settings.clone();
    stoppable.limits_mut().stop = Some(interrupt.stop());
    tracing::info!("{}: {} triangles, on {}", scene.name, scene.triangles.len(), device.info().name);

    let bar = log.bar(limits(settings).map_or(0, |limits| limits.max_iterations));
    let plan = Plan::of(scene, device.info(), settings, &[])?;
    let mut check = args.check_numerics.then(|| NumericsCheck::new(scene, settings));
    let mut held = None;
    let mut seen = |row: &IterationRow| {
        held.get_or_insert_with(|| interrupt.hold());
        bar.set_position(u64::from(row.iteration));
        bar.set_message(format!("cost {:.3}", row.cost));
        if args.scenes.in_a_row() {
            tracing::debug!("{}", row_text(row));
        } else {
            tracing::info!("{}", row_text(row));
        }
        if interrupt.pressed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    // Only the check wants the tree of each row, and pays for it.
    let result = match &mut check {
        None => pipeline::optimize_by(plan, scene, device, &stoppable, &mut |row| seen(row)),
        Some(check) => pipeline::optimize_watched(plan, scene, device, &stoppable, &mut |row, tree| match seen(row) {
            ControlFlow::Continue(()) => check.observe(row, tree),
            stop => stop,
        }),
    };
    log.end_bar();
    let result = result?;
    if let Some(bound) = &result.bound {
        tell(bound);
    }
    let mut report = report(args, scene, device, settings, &result);
    report.set_reference(known);
    report.accuracy = check.map(NumericsCheck::finish).transpose()?;
    Ok(Done { result, report, held })
}

/// Says what the bound on the depth changed, louder where it costs something.
fn tell(bound: &DepthBound) {
    const WORTH_A_WARNING: f64 = 0.01;
    let DepthBound { max_depth, .. } = bound;
    if bound.rise() > SAH_BUDGET {
        let budget = 100.0 * SAH_BUDGET;
        tracing::warn!("--max-depth {max_depth} costs more than {budget:.0} %: {bound}; a larger one costs less");
    } else if bound.rise() > WORTH_A_WARNING {
        tracing::warn!("--max-depth {max_depth}: {bound}");
    } else {
        tracing::info!("--max-depth {max_depth}: {bound}");
    }
}

/// # Errors
/// If the numbers of the run were checked and are not as they must be.
pub(super) fn judge(accuracy: Option<&AccuracyReport>) -> anyhow::Result<()> {
    match accuracy.and_then(AccuracyReport::verdict) {
        Some(wrong) => anyhow::bail!(wrong),
        None => Ok(()),
    }
}

/// What the reference file has for the scene.
fn known_cost(scene: &Scene) -> anyhow::Result<Option<ReferenceCost>> {
    let costs = ReferenceCosts::embedded().context("the reference costs in this program")?;
    Ok(costs.get(&scene.hash, &SahModel::default()).cloned())
}

pub(super) fn write(folder: &Path, scene: &Scene, result: &Optimized, report: &RunReport) -> anyhow::Result<()> {
    // The tree first: it is what the time was spent on.
    let tree = folder.join(TREE);
    bvh::file::write(&tree, &result.tree, &scene.hash)?;
    tracing::info!("wrote {}", tree.display());
    for path in report.write(folder)? {
        tracing::info!("wrote {}", path.display());
    }
    Ok(())
}

fn row_text(row: &IterationRow) -> String {
    let IterationRow { iteration, time_s, cost, searched, found, owned, applied, .. } = row;
    format!(
        "iteration {iteration:3}  {time_s:8.3} s  cost {cost:9.3}  searched {searched:7}  found {found:7}  owned {owned:7}  applied {applied:7}"
    )
}

fn report(
    args: &OptimizeArgs,
    scene: &Scene,
    device: &dyn Device,
    settings: &Settings,
    result: &Optimized,
) -> RunReport {
    let triangles = u32::try_from(scene.triangles.len()).unwrap_or(u32::MAX);
    let mut phases = PhaseTimes::default();
    phases.add(&result.build_timings);
    phases.add(&result.outcome.timings);
    phases.add(&result.collapse_timings);
    let (epsilon, epsilon_relative) = match settings.prbvh.epsilon {
        Epsilon::Relative(part) => (part, true),
        Epsilon::Absolute(change) => (change, false),
    };
    let iterations = result.outcome.rows.last().map_or(0, |row| row.iteration);
    let handed_out = result.adaptive.unwrap_or(result.quality);
    RunReport {
        schema: report::SCHEMA,
        scene: scene.name.clone(),
        triangles,
        device: device.info().name.clone(),
        initial_cost: result.initial.sah_cost,
        final_cost: result.quality.sah_cost,
        reference: None,
        adaptive_cost: result.adaptive.map(|quality| quality.sah_cost),
        leaves: handed_out.leaves,
        depth: handed_out.max_depth,
        bound: result.bound,
        iterations,
        time_s: result.optimize_s,
        tree_hash: bvh::tree_hash(&result.tree),
        phases: phases.phases(),
        build_s: result.build_s,
        stop_reason: result.outcome.stop.to_string(),
        plan: result.plan.lines(),
        plan_items: result.plan.items.clone(),
        code: DeviceCode::of(&result.ran, device.info()),
        settings: report::Settings {
            initial: settings.initial.to_string(),
            radius: match settings.initial {
                Initial::Ploc { radius } => Some(radius.get()),
                _ => None,
            },
            treelet: match settings.initial {
                Initial::Atrbvh { treelet } => Some(treelet.get()),
                _ => None,
            },
            strategy: settings.prbvh.strategy.to_string(),
            order: settings.prbvh.order.to_string(),
            worst_first: (settings.prbvh.order == Order::WorstFirst).then_some(settings.prbvh.worst_first),
            optimizer: settings.optimizer.to_string(),
            fold_duplicates: settings.fold_duplicates,
            max_depth: settings.max_depth,
            rbvh: match &settings.optimizer {
                Optimizer::Rbvh(settings) => Some(settings.clone()),
                _ => None,
            },
            mu: settings.prbvh.mu,
            epsilon,
            epsilon_relative,
            max_iterations: limits(settings).map(|limits| limits.max_iterations),
            max_time_s: args.max_time,
            target_cost: limits(settings).and_then(|limits| limits.target_cost),
            preset: args.preset.map(value_name),
            threads: u32::try_from(args.threads).ok().filter(|&threads| threads > 0),
            sah: SahModel::default(),
            adaptive: settings.adaptive,
        },
        memory: Memory::new(device.memory().peak_bytes, triangles),
        quality: QualityReport { initial: result.initial, last: handed_out },
        scene_details: SceneReport {
            source: scene.source.clone(),
            hash: scene.hash.clone(),
            census: serde_json::to_value(&scene.census).unwrap_or_default(),
            notes: scene.notes.clone(),
        },
        device_details: device.info().clone(),
        machine: Machine::current(),
        program: Program::current(),
        accuracy: None,
        rows: result.outcome.rows.clone(),
    }
}

/// None without an optimiser.
fn limits(settings: &Settings) -> Option<&Limits> {
    (settings.optimizer != Optimizer::None).then(|| settings.limits())
}

fn value_name<T: ValueEnum>(value: T) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh_lab::accuracy::{Breach, BreachKind};

    #[test]
    fn wrong_numbers_are_an_error() {
        let mut accuracy = AccuracyReport { search: None, breaches: Vec::new(), rows: Vec::new() };
        assert!(judge(None).is_ok() && judge(Some(&accuracy)).is_ok());
        let what = "the cost is 3, 2 in f64".to_owned();
        accuracy.breaches.push(Breach { iteration: 7, kind: BreachKind::Cost, what });
        let error = judge(Some(&accuracy)).unwrap_err().to_string();
        assert!(error.contains("iteration 7: the cost is 3, 2 in f64"), "{error}");
    }
}

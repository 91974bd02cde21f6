//! `prbvh optimize`, and `prbvh` alone.

use super::args::OptimizeArgs;
use super::interrupt::Interrupt;
use super::log::Log;
use super::{load_scene, print};
use anyhow::Context;
use clap::ValueEnum;
use prbvh::accuracy::{self, AccuracyReport, NumericsCheck};
use prbvh::bvh::{self, SahModel};
use prbvh::device::{self, Device};
use prbvh::optimize::{Epsilon, IterationRow, Limits, Order, StopReason};
use prbvh::pipeline::{self, Initial, Optimized, Optimizer, Settings};
use prbvh::plan::{DeviceCode, Plan};
use prbvh::reference::{ReferenceCost, ReferenceCosts};
use prbvh::report::{self, Machine, Memory, PhaseTimes, Program, QualityReport, RunReport, SceneReport};
use prbvh::scene::Scene;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;

/// Columns where the width of the terminal is not known.
pub(super) const DEFAULT_COLUMNS: u16 = 100;

pub(super) fn run(args: &OptimizeArgs, log: &Log) -> anyhow::Result<ExitCode> {
    let mut settings = args.settings()?;
    let interrupt = Interrupt::listen();
    let mut device = device::open(args.device, args.threads, args.validate)?;
    let scene = load_scene(&args.scene, args.triangles, &args.read)?;
    let known = known_cost(&scene)?;
    args.target.apply(&mut settings, &scene, known.as_ref())?;
    if let Some(folder) = &args.out {
        check_folder(folder)?;
    }
    tracing::info!("{}: {} triangles, on {}", scene.name, scene.triangles.len(), device.info().name);

    let bar = log.bar(limits(&settings).map_or(0, |limits| limits.max_iterations));
    let plan = Plan::of(&scene, device.info(), &settings, &[])?;
    let mut check = args.check_numerics.then(|| NumericsCheck::new(&scene, &settings));
    let seen = |row: &IterationRow| {
        bar.set_position(u64::from(row.iteration));
        bar.set_message(format!("cost {:.3}", row.cost));
        log_row(row);
        if interrupt.pressed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    // Only the check wants the tree of each row, and pays for it.
    let result = match &mut check {
        None => pipeline::optimize_by(plan, &scene, &mut *device, &settings, &mut |row| seen(row)),
        Some(check) => {
            pipeline::optimize_watched(plan, &scene, &mut *device, &settings, &mut |row, tree| match seen(row) {
                ControlFlow::Continue(()) => check.observe(row, tree),
                stop => stop,
            })
        }
    };
    log.end_bar();
    let result = result?;
    let mut report = report(args, &scene, &*device, &settings, &result);
    report.set_reference(known.as_ref());
    report.accuracy = check.map(NumericsCheck::finish).transpose()?;

    let written = args.out.as_deref().map_or(Ok(()), |folder| write(folder, &scene, &result, &report));
    if args.json {
        print(&serde_json::to_string_pretty(&report).context("report as JSON")?);
    } else {
        let columns = console::Term::stdout().size_checked().map_or(DEFAULT_COLUMNS, |(_, columns)| columns);
        print(&report::table(&report, columns));
        if let Some(accuracy) = &report.accuracy {
            print(accuracy::table(accuracy, columns).trim_end());
        }
    }
    // Not before: where the disk is full the user has at least the outcome.
    written?;
    if let StopReason::Fault(_) = result.outcome.stop {
        anyhow::bail!("{}; the best tree before it was kept", result.outcome.stop);
    }
    judge(report.accuracy.as_ref())?;
    Ok(ExitCode::SUCCESS)
}

/// # Errors
/// If the numbers were checked and are not as they must be.
fn judge(accuracy: Option<&AccuracyReport>) -> anyhow::Result<()> {
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

/// Makes the folder of the outputs and tries whether files can be made in it, before any time is spent on what is to go there.
pub(super) fn check_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .and_then(|()| tempfile::tempfile_in(folder))
        .with_context(|| format!("--out {}: no files can be made there", folder.display()))?;
    Ok(())
}

fn write(folder: &Path, scene: &Scene, result: &Optimized, report: &RunReport) -> anyhow::Result<()> {
    // The tree first: it is what the time was spent on.
    let tree = folder.join("tree.bvh");
    bvh::file::write(&tree, &result.tree, &scene.hash)?;
    tracing::info!("wrote {}", tree.display());
    for path in report.write(folder)? {
        tracing::info!("wrote {}", path.display());
    }
    Ok(())
}

fn log_row(row: &IterationRow) {
    let IterationRow { iteration, time_s, cost, searched, found, owned, applied, .. } = row;
    tracing::info!(
        "iteration {iteration:3}  {time_s:8.3} s  cost {cost:9.3}  searched {searched:7}  found {found:7}  owned {owned:7}  applied {applied:7}"
    );
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
    use prbvh::accuracy::{Breach, BreachKind};

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

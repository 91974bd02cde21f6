//! `prbvh optimize`, and `prbvh` alone.

use super::args::{OptimizeArgs, StrategyArg};
use super::interrupt::Interrupt;
use super::log::Log;
use super::{load_scene, print};
use anyhow::Context;
use clap::ValueEnum;
use prbvh::bvh::{self, SahModel};
use prbvh::device::{self, Device};
use prbvh::optimize::{Epsilon, IterationRow, StopReason};
use prbvh::pipeline::{self, Initial, Optimized, Optimizer, Settings};
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
    let scene = load_scene(&args.scene, args.triangles)?;
    let known = known_cost(&scene)?;
    args.target.apply(&mut settings, &scene, known.as_ref())?;
    if let Some(folder) = &args.out {
        check_folder(folder)?;
    }
    tracing::info!("{}: {} triangles, on {}", scene.name, scene.triangles.len(), device.info().name);

    let bar = log.bar(max_iterations(&settings).unwrap_or(0));
    let result = pipeline::optimize(&scene, &mut *device, &settings, &mut |row| {
        bar.set_position(u64::from(row.iteration));
        bar.set_message(format!("cost {:.3}", row.cost));
        log_row(row);
        if interrupt.pressed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    log.end_bar();
    let result = result?;
    let mut report = report(args, &scene, &*device, &settings, &result);
    report.set_reference(known.as_ref());

    let written = args.out.as_deref().map_or(Ok(()), |folder| write(folder, &scene, &result, &report));
    if args.json {
        print(&serde_json::to_string_pretty(&report).context("report as JSON")?);
    } else {
        let columns = console::Term::stdout().size_checked().map_or(DEFAULT_COLUMNS, |(_, columns)| columns);
        print(&report::table(&report, columns));
    }
    // Not before: where the disk is full the user has at least the outcome.
    written?;
    if let StopReason::Fault(_) = result.outcome.stop {
        anyhow::bail!("{}; the best tree before it was kept", result.outcome.stop);
    }
    Ok(ExitCode::SUCCESS)
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
    let IterationRow { iteration, mu, time_s, cost, found, owned, applied, .. } = row;
    tracing::info!(
        "iteration {iteration:3}  {time_s:8.3} s  cost {cost:9.3}  found {found:7}  owned {owned:7}  applied {applied:7}  µ {mu}"
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
            strategy: value_name::<StrategyArg>(args.strategy),
            moves: settings.prbvh.moves.to_string(),
            optimizer: settings.optimizer.to_string(),
            rbvh: match &settings.optimizer {
                Optimizer::Rbvh(settings) => Some(settings.clone()),
                _ => None,
            },
            mu: settings.prbvh.mu,
            epsilon,
            epsilon_relative,
            max_iterations: max_iterations(settings),
            max_time_s: args.max_time,
            target_cost: target_cost(settings),
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
        },
        device_details: device.info().clone(),
        machine: Machine::current(),
        program: Program::current(),
        rows: result.outcome.rows.clone(),
    }
}

fn target_cost(settings: &Settings) -> Option<f64> {
    match &settings.optimizer {
        Optimizer::Prbvh => settings.prbvh.target_cost,
        Optimizer::Rbvh(settings) => settings.target_cost,
        Optimizer::None => None,
    }
}

fn max_iterations(settings: &Settings) -> Option<u32> {
    match &settings.optimizer {
        Optimizer::Prbvh => Some(settings.prbvh.max_iterations),
        Optimizer::Rbvh(settings) => Some(settings.max_iterations),
        Optimizer::None => None,
    }
}

fn value_name<T: ValueEnum>(value: T) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

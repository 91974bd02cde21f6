//! One scene through the pipeline, as `prbvh optimize` runs it: limits, progress, checks, report, files.

use super::check_max_depth;
use super::interrupt::{Held, Interrupt};
use super::log::Log;
use super::optimize_args::OptimizeArgs;
use anyhow::Context;
use prbvh::bvh::{self, DepthBound, SAH_BUDGET, SahModel};
use prbvh::device::{Device, Meter};
use prbvh::optimize::{IterationRow, Limits};
use prbvh::pipeline::{self, Initial, Optimized, Optimizer, Settings};
use prbvh::plan::Plan;
use prbvh::scene::Scene;
use prbvh_lab::accuracy::{AccuracyReport, NumericsCheck};
use prbvh_lab::reference::{ReferenceCost, ReferenceCosts};
use prbvh_lab::report::{RunReport, RunSettings};
use std::ops::ControlFlow;
use std::path::Path;

/// Files of a run in its folder.
pub(super) const OUTPUTS: [&str; 6] = {
    let [report, iterations, convergence, accuracy] = RunReport::FILES;
    [TREE, WIDE_TREE, report, iterations, convergence, accuracy]
};

const TREE: &str = "tree.bvh";
const WIDE_TREE: &str = "wide.bvh";

/// What a run reads beside its scenes.
pub(super) fn other_inputs<'a>(args: &'a OptimizeArgs, settings: &'a Settings) -> impl Iterator<Item = &'a Path> {
    let initial = match &settings.initial {
        Initial::File { path } => Some(&**path),
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
    let asked = RunSettings {
        preset: args.preset,
        threads: u32::try_from(args.threads).ok().filter(|&threads| threads > 0),
        ..RunSettings::from(settings.clone())
    };
    let mut report = RunReport::of(scene, device, asked, &result);
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
    if let Some(wide) = &result.wide {
        let path = folder.join(WIDE_TREE);
        prbvh::wide::file::write(&path, &wide.tree, &scene.hash)?;
        tracing::info!("wrote {}", path.display());
    }
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

/// None without an optimiser.
fn limits(settings: &Settings) -> Option<&Limits> {
    (settings.optimizer != Optimizer::None).then(|| settings.limits())
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

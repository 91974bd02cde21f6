//! Whole runs under the check: predicted against measured decreases, drift, and the error of the cost.

use super::document::Block;
use super::{device, markdown, part, texts};
use prbvh::optimize::{PrbvhSettings, RbvhSettings, Strategy};
use prbvh::pipeline::{self, Optimizer, PipelineError, Settings};
use prbvh::plan::Plan;
use prbvh::scene::{Scene, built_in};
use prbvh_lab::accuracy::{AccuracyReport, NumericsCheck, SearchAccuracy};

/// Runs the pipeline under the check.
///
/// # Errors
/// As [`pipeline::optimize`].
pub fn checked(
    scene: &Scene,
    device: &mut dyn prbvh::device::Device,
    settings: &Settings,
) -> Result<AccuracyReport, PipelineError> {
    let plan = Plan::of(scene, device.info(), settings, &[])?;
    let mut check = NumericsCheck::new(scene, settings);
    pipeline::optimize_watched(plan, scene, device, settings, &mut |row, tree| check.observe(row, tree))?;
    Ok(check.finish()?)
}

/// The built-in scene in two sizes.
///
/// # Panics
/// If a number is not as it must be.
#[must_use]
pub fn block() -> Block {
    table("runs", &[built_in(5_000), built_in(50_000)])
}

/// Scenes of files.
///
/// # Panics
/// If a number is not as it must be.
#[must_use]
pub fn block_of(scenes: &[Scene]) -> Block {
    table("scenes", scenes)
}

fn table(name: &str, scenes: &[Scene]) -> Block {
    let header = [
        "scene, triangles",
        "optimiser",
        "iterations",
        "error of the cost",
        "predicted",
        "measured",
        "part",
        "moves offered",
        "noise refused",
        "noise offered",
        "drift: 99 %",
        "all",
        "decrease against f64: 99 %",
        "all",
    ];
    let mut rows = vec![texts(&header)];
    let published =
        |strategy| Settings::default().with(|s| s.prbvh = PrbvhSettings::published().with(|s| s.strategy = strategy));
    let methods = [
        ("worst first", Settings::default()),
        ("aggressive", published(Strategy::Aggressive)),
        ("conservative", published(Strategy::Conservative)),
        ("rbvh", Settings::default().with(|s| s.optimizer = Optimizer::Rbvh(RbvhSettings::default()))),
    ];
    for scene in scenes {
        for (method, settings) in &methods {
            let report = checked(scene, &mut *device(), settings).expect("the CPU optimises");
            assert!(report.is_green(), "{}, {method}: {:?}", scene.name, report.breaches);
            let mut row = vec![format!("{}, {}", scene.name, scene.triangles.len()), (*method).to_owned()];
            row.extend(cells(&report));
            rows.push(row);
        }
    }
    Block::new(name, markdown(&rows))
}

fn cells(report: &AccuracyReport) -> Vec<String> {
    let worst = report.worst_cost().map_or(0.0, |row| row.cost_error);
    let mut cells = vec![(report.rows.len() - 1).to_string(), part(worst)];
    let Some(search) = &report.search else {
        let (_, measured) = report.decreases();
        cells.extend(["-".to_owned(), format!("{measured:.4}")]);
        cells.resize(12, "-".to_owned());
        return cells;
    };
    let (predicted, measured) = report.decreases();
    let SearchAccuracy { offered, refused_noise, raising, drift, decrease_error, .. } = search;
    cells.extend([predicted, measured].map(|value| format!("{value:.4}")));
    cells.push(format!("{:.2} %", 100.0 * measured / predicted));
    cells.extend([offered, refused_noise, raising].map(u64::to_string));
    cells.extend([drift.bound_of(0.99), drift.max, decrease_error.bound_of(0.99), decrease_error.max].map(part));
    cells
}

//! Runs as curves, and what they are called.

use super::Value;
use super::chart::{Curve, Point};
use super::style::Style;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::optimize::IterationRow;
use crate::report::format;

/// `sponza, 262,267 triangles`.
pub(super) fn subject(scene: &SceneComparison) -> String {
    format!("{}, {} triangles", format::shortened(&scene.name, 80), format::count(scene.triangles.into()))
}

/// Method, and µ where it has one.
pub(super) fn method(method: &str, mu: Option<u32>) -> String {
    match mu {
        Some(mu) if mu > 0 => format!("{method} µ = {mu}"),
        _ => method.to_owned(),
    }
}

/// Whether the runs are of several devices, so that names must tell them.
pub(super) fn devices_differ(runs: &[&OptimizerRun]) -> bool {
    runs.windows(2).any(|pair| pair[0].device != pair[1].device)
}

/// Name of a run among others; the device only where they differ.
pub(super) fn name(run: &OptimizerRun, with_device: bool) -> String {
    with_device_name(method(&run.method, Some(run.mu)), run, with_device)
}

/// The name, and the device in parentheses.
pub(super) fn with_device_name(name: String, run: &OptimizerRun, with_device: bool) -> String {
    if with_device { format!("{name} ({})", format::shortened(&run.device, 14)) } else { name }
}

/// Seconds from triangles to the end of the row.
pub(super) fn seconds(run: &OptimizerRun, row: &IterationRow) -> f64 {
    run.build_s + row.time_s
}

/// Columns of the points of [`curve`].
pub(super) const COLUMNS: [&str; 3] = ["iteration", "time (s)", "SAH cost"];

/// Cost against what `x` says.
pub(super) fn curve(
    run: &OptimizerRun,
    name: String,
    style: usize,
    x: impl Fn(&OptimizerRun, &IterationRow) -> f64,
) -> Curve {
    let point = |row: &IterationRow| Point {
        x: x(run, row),
        y: row.cost,
        values: vec![Value::Count(row.iteration.into()), Value::Number(seconds(run, row)), Value::Number(row.cost)],
    };
    Curve { name, style: Style(style), joined: run.rows.len() > 1, points: run.rows.iter().map(point).collect() }
}

/// The runs of a purpose, and those of other figures that differ from one of them in nothing but `differs`, and add a value of it.
/// None unless there are two values to compare.
pub(super) fn counterparts<'a, S: PartialEq, D: PartialEq>(
    scene: &'a SceneComparison,
    purpose: Purpose,
    same: impl Fn(&'a OptimizerRun) -> S,
    differs: impl Fn(&'a OptimizerRun) -> D,
) -> Option<Vec<&'a OptimizerRun>> {
    let has_rows = |run: &&OptimizerRun| !run.rows.is_empty();
    let mut runs: Vec<&OptimizerRun> =
        scene.runs.iter().filter(|run| run.purpose == purpose).filter(has_rows).collect();
    for other in [Purpose::Table, Purpose::Mu, Purpose::Strategy, Purpose::Initial] {
        for run in scene.runs.iter().filter(|run| run.purpose == other && other != purpose).filter(has_rows) {
            let alike = runs.iter().filter(|known| same(known) == same(run)).copied().collect::<Vec<_>>();
            if !alike.is_empty() && alike.iter().all(|known| differs(known) != differs(run)) {
                runs.push(run);
            }
        }
    }
    runs.windows(2).any(|pair| differs(pair[0]) != differs(pair[1])).then_some(runs)
}

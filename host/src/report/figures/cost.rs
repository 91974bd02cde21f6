//! Cost against time, a curve per method, as in Meister & Bittner 2018.

use super::Figure;
use super::chart::{Chart, Names, Panel};
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::report::axis::Axis;
use crate::report::plot::PlotError;

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    let all: Vec<&OptimizerRun> = scene.runs.iter().filter(|run| run.purpose == Purpose::Table).collect();
    let names = runs::names(&all, |run| runs::method(&run.method, Some(run.mu)));
    let curve = |(k, (run, name)): (usize, (&&OptimizerRun, String))| runs::curve(run, name, k, runs::seconds);
    let curves: Vec<_> = all.iter().zip(names).enumerate().map(curve).collect();
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let panel = Panel {
        heading: String::new(),
        x: Axis::log_time(points().map(|point| point.x)),
        y: Axis::around(points().map(|point| point.y)),
        x_title: "time from triangles (s, logarithmic)".to_owned(),
        y_title: "SAH cost (no unit)".to_owned(),
        x_ticks: None,
        y_ticks: None,
        names: Names::Beside,
        curves,
    };
    let chart = Chart {
        name: "cost-time",
        heading: "SAH cost against time".to_owned(),
        subject: runs::subject(scene),
        caption: "Cost of the tree (lower is better) against the wall time from triangles to it. An optimiser is a curve that begins with \
                  its initial tree; a builder is a point."
            .to_owned(),
        note: String::new(),
        height: 900,
        columns: &runs::COLUMNS,
        panels: vec![panel],
    };
    chart.draw()
}

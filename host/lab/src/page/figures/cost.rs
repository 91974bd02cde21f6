//! Cost against time, a curve per method, as in Meister & Bittner 2018.

use super::Figure;
use super::chart::Chart;
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::report::plot::PlotError;

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    let all: Vec<&OptimizerRun> = scene.runs.iter().filter(|run| run.purpose == Purpose::Table).collect();
    let names = runs::names(&all, |run| runs::method(&run.method, Some(run.mu)));
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
        panels: vec![runs::cost_over_time(&all, names)],
    };
    chart.draw()
}

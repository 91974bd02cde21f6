//! Cost against time, a curve per method, as in Meister & Bittner 2018.

use super::figure::Figure;
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    let all: Vec<&OptimizerRun> = scene.runs.iter().filter(|run| run.purpose == Purpose::Table).collect();
    let names = runs::names(&all, |run| runs::method(&run.method, Some(run.mu)));
    let figure = Figure {
        name: "cost-time",
        title: "SAH cost against time".to_owned(),
        subject: runs::subject(scene),
        caption: "Cost of the tree (lower is better) against the wall time from triangles to it. An optimiser is a curve that begins with \
                  its initial tree; a builder is a point."
            .to_owned(),
        columns: runs::COLUMNS.into(),
        panels: vec![runs::cost_over_time("", &all, &names)],
        ..Figure::default()
    };
    figure.finished()
}

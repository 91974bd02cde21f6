//! The same optimisation from different initial trees, as in Meister & Bittner 2018.

use super::chart::{Chart, Names, Panel};
use super::{Figure, runs};
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::report::axis::Axis;
use crate::report::plot::PlotError;

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    let same = |run: &OptimizerRun| (run.strategy.clone(), run.mu, run.device.clone());
    let runs = runs::counterparts(scene, Purpose::Initial, same, |run| run.initial.clone()).unwrap_or_default();
    let several_mu = runs.windows(2).any(|pair| pair[0].mu != pair[1].mu);
    let names = runs::names(&runs, |run| runs::method(&format!("from {}", run.initial), several_mu.then_some(run.mu)));
    let curve = |(k, (run, name)): (usize, (&&OptimizerRun, String))| runs::curve(run, name, k, runs::seconds);
    let curves: Vec<_> = runs.iter().zip(names).enumerate().map(curve).collect();
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
        name: "initial",
        heading: "PRBVH from different initial trees".to_owned(),
        subject: runs::subject(scene),
        caption:
            "A better initial tree takes longer to build and leaves less to do. The time of the initial tree counts."
                .to_owned(),
        note: String::new(),
        height: 720,
        columns: &runs::COLUMNS,
        panels: vec![panel],
    };
    chart.draw()
}

//! Aggressive against conservative: the strategies of Meister & Bittner 2018, §4.3.

use super::chart::Chart;
use super::panel::{Curve, Names, Panel};
use super::{Figure, runs};
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::report::axis::Axis;
use crate::report::plot::PlotError;
use prbvh::optimize::IterationRow;

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    let same = |run: &OptimizerRun| (run.initial.clone(), run.mu, run.device.clone());
    let runs = runs::counterparts(scene, Purpose::Strategy, same, |run| run.strategy.clone());
    // A builder has no strategy to compare.
    let runs: Vec<_> = runs.unwrap_or_default().into_iter().filter(|run| !run.strategy.is_empty()).collect();
    let chart = Chart {
        name: "strategy",
        heading: "Aggressive against conservative locking".to_owned(),
        subject: runs::subject(scene),
        caption: "The conservative strategy also locks the nodes whose boxes a reinsertion changes: the decreases of all that it makes add \
                  up. The aggressive one locks the nodes at both ends only: it makes more of them per iteration, and its cost may rise \
                  for an iteration. The same runs against time and against iteration."
            .to_owned(),
        note: String::new(),
        height: 640,
        columns: &runs::COLUMNS,
        panels: panels(&runs),
    };
    chart.draw()
}

/// Cost against time on the left and against iteration on the right.
fn panels(runs: &[&OptimizerRun]) -> Vec<Panel> {
    let several_mu = runs.windows(2).any(|pair| pair[0].mu != pair[1].mu);
    let names = runs::names(runs, |run| runs::method(&run.strategy, several_mu.then_some(run.mu)));
    let curves = |x: fn(&OptimizerRun, &IterationRow) -> f64| -> Vec<Curve> {
        runs.iter().zip(&names).enumerate().map(|(k, (run, name))| runs::curve(run, name.clone(), k, x)).collect()
    };
    let panel = |heading: &str, x_title: &str, curves: Vec<Curve>, x_axis: fn(std::vec::IntoIter<f64>) -> Axis| {
        let points = || curves.iter().flat_map(|curve| &curve.points);
        Panel {
            heading: heading.to_owned(),
            x: x_axis(points().map(|point| point.x).collect::<Vec<_>>().into_iter()),
            y: Axis::around(points().map(|point| point.y)),
            x_title: x_title.to_owned(),
            y_title: "SAH cost (no unit)".to_owned(),
            x_ticks: None,
            y_ticks: None,
            names: Names::Beside,
            curves,
        }
    };
    vec![
        panel("against time", "time from triangles (s, logarithmic)", curves(runs::seconds), Axis::log_time),
        panel("against iteration", "iteration", curves(|_, row| row.iteration.into()), Axis::from_zero),
    ]
}

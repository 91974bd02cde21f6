//! Aggressive against conservative: the strategies of Meister & Bittner 2018, §4.3.

use super::figure::{Figure, Fit};
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    let same = |run: &OptimizerRun| (run.initial.clone(), run.mu, run.device.clone());
    let runs = runs::counterparts(scene, Purpose::Strategy, same, |run| run.strategy.clone());
    // A builder has no strategy to compare.
    let runs: Vec<_> = runs.unwrap_or_default().into_iter().filter(|run| !run.strategy.is_empty()).collect();
    let several_mu = runs.windows(2).any(|pair| pair[0].mu != pair[1].mu);
    let names = runs::names(&runs, |run| runs::method(&run.strategy, several_mu.then_some(run.mu)));
    let figure = Figure {
        name: "strategy",
        title: "Aggressive against conservative locking".to_owned(),
        subject: runs::subject(scene),
        caption: "The conservative strategy also locks the nodes whose boxes a reinsertion changes: the decreases of all that it makes add \
                  up. The aggressive one locks the nodes at both ends only: it makes more of them per iteration, and its cost may rise \
                  for an iteration. The same runs against time and against iteration."
            .to_owned(),
        columns: runs::COLUMNS.into(),
        panels: vec![
            runs::cost_over_time("against time", &runs, &names),
            runs::cost_over("against iteration", ("iteration", Fit::FromZero), &runs, &names, |_, row| row.iteration.into()),
        ],
        ..Figure::default()
    };
    figure.finished()
}

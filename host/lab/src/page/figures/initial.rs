//! The same optimisation from different initial trees, as in Meister & Bittner 2018.

use super::figure::Figure;
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};

/// The same optimisation from several trees.
pub(super) fn runs(scene: &SceneComparison) -> Vec<&OptimizerRun> {
    let same = |run: &OptimizerRun| (run.strategy.clone(), run.mu, run.device.clone());
    runs::counterparts(scene, Purpose::Initial, same, |run| run.initial.clone()).unwrap_or_default()
}

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    let runs = runs(scene);
    let several_mu = runs.windows(2).any(|pair| pair[0].mu != pair[1].mu);
    let names = runs::names(&runs, |run| runs::method(&format!("from {}", run.initial), several_mu.then_some(run.mu)));
    let figure = Figure {
        name: "initial",
        title: "PRBVH from different initial trees".to_owned(),
        subject: runs::subject(scene),
        caption:
            "A better initial tree takes longer to build and leaves less to do. The time of the initial tree counts."
                .to_owned(),
        columns: runs::COLUMNS.into(),
        panels: vec![runs::cost_over_time("", &runs, &names)],
        ..Figure::default()
    };
    figure.finished()
}

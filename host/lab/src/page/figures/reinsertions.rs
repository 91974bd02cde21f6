//! Reinsertions found, owned and applied per iteration, as in Meister & Bittner 2018.

use super::figure::{Figure, Fit, Kind, Panel, Point, Series, Value};
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use prbvh::optimize::IterationRow;

type Count = fn(&IterationRow) -> u32;

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    // Row 0 is the initial tree, for which nothing was searched; of a builder there is nothing else.
    let searched = |run: &&OptimizerRun| run.rows.iter().skip(1).any(|row| row.found > 0);
    let largest = |purpose| {
        let runs = scene.runs.iter().filter(|run| run.purpose == purpose && run.mu > 0).filter(searched);
        // The first of equals: the last would be that of another device.
        runs.reduce(|best, run| if run.mu > best.mu { run } else { best })
    };
    let run = largest(Purpose::Table).or_else(|| largest(Purpose::Strategy))?;
    let kinds: [(&str, Count); 3] =
        [("found", |row| row.found), ("owned all locks", |row| row.owned), ("applied", |row| row.applied)];
    let series = |(name, count): &(&str, Count)| {
        let point = |row: &IterationRow| {
            let values = [row.iteration, row.mu, row.found, row.owned, row.applied].map(|v| Value::Count(v.into()));
            Point::new(row.iteration.into(), count(row).into(), values)
        };
        Series::new(*name, Kind::Line, run.rows.iter().filter(|row| row.iteration > 0).map(point))
    };
    let panel = Panel::new(
        "",
        ("iteration", Fit::FromZero),
        ("reinsertions (logarithmic)", Fit::Decades),
        kinds.iter().map(series).collect(),
    );
    let figure = Figure {
        name: "reinsertions",
        title: format!("Reinsertions per iteration, {}", runs::method(&run.method, Some(run.mu))),
        subject: format!("{}, {}", runs::subject(scene), run.device),
        caption: "Reinsertions that the search found, those of them that owned all the locks they need, and those that were made. They rise \
                  where µ shrinks, as more nodes are searched."
            .to_owned(),
        columns: vec!["iteration", "µ", "found", "owned", "applied"],
        panels: vec![panel],
        ..Figure::default()
    };
    figure.finished()
}

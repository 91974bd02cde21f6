//! Reinsertions found, owned and applied per iteration, as in Meister & Bittner 2018.

use super::chart::Chart;
use super::panel::{Curve, Names, Panel, Point};
use super::style::Style;
use super::{Figure, Value, runs};
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::report::axis::Axis;
use crate::report::plot::PlotError;
use prbvh::optimize::IterationRow;

type Count = fn(&IterationRow) -> u32;

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    // Row 0 is the initial tree, for which nothing was searched; of a builder there is nothing else.
    let searched = |run: &&OptimizerRun| run.rows.iter().skip(1).any(|row| row.found > 0);
    let largest = |purpose| {
        let runs = scene.runs.iter().filter(|run| run.purpose == purpose && run.mu > 0).filter(searched);
        // The first of equals: the last would be that of another device.
        runs.reduce(|best, run| if run.mu > best.mu { run } else { best })
    };
    let Some(run) = largest(Purpose::Table).or_else(|| largest(Purpose::Strategy)) else { return Ok(None) };
    let kinds: [(&str, Count); 3] =
        [("found", |row| row.found), ("owned all locks", |row| row.owned), ("applied", |row| row.applied)];
    let rows = || run.rows.iter().filter(|row| row.iteration > 0);
    let point = |row: &IterationRow, count: u32| Point {
        x: row.iteration.into(),
        y: count.into(),
        values: [row.iteration, row.mu, row.found, row.owned, row.applied].map(|v| Value::Count(v.into())).into(),
    };
    let curves = kinds.iter().enumerate().map(|(k, (name, count))| Curve {
        name: (*name).to_owned(),
        style: Style(k),
        joined: true,
        points: rows().map(|row| point(row, count(row))).collect(),
    });
    let panel = Panel {
        heading: String::new(),
        x: Axis::from_zero(rows().map(|row| row.iteration.into())),
        y: Axis::log(rows().flat_map(|row| [row.found, row.owned, row.applied]).map(f64::from)),
        x_title: "iteration".to_owned(),
        y_title: "reinsertions (logarithmic)".to_owned(),
        x_ticks: None,
        y_ticks: None,
        names: Names::Beside,
        curves: curves.collect(),
    };
    let chart = Chart {
        name: "reinsertions",
        heading: format!("Reinsertions per iteration, {}", runs::method(&run.method, Some(run.mu))),
        subject: format!("{}, {}", runs::subject(scene), run.device),
        caption: "Reinsertions that the search found, those of them that owned all the locks they need, and those that were made. They rise \
                  where µ shrinks, as more nodes are searched."
            .to_owned(),
        note: String::new(),
        height: 720,
        columns: &["iteration", "µ", "found", "owned", "applied"],
        panels: vec![panel],
    };
    chart.draw()
}

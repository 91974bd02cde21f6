//! Device time per kernel, a column of bars per run.

use super::bars::{Bar, Bars, Column};
use super::{Figure, Value, runs};
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::report::plot::PlotError;
use prbvh::format;

/// Runs beside one another.
const COLUMNS: usize = 4;
/// Kernels of a block; the rest is added up.
const MOST: usize = 14;
const REST: &str = "all others";

/// A run and what it is called among the others.
type Named<'a> = (&'a OptimizerRun, String);

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    let timed = |run: &&OptimizerRun| total(run) > 0.0;
    let of = |purpose| scene.runs.iter().filter(move |run| run.purpose == purpose).filter(timed).collect::<Vec<_>>();
    let mut all = of(Purpose::Table);
    if all.is_empty() {
        all = of(Purpose::Strategy);
    }
    let name = |run: &OptimizerRun| runs::method(&run.method, Some(run.mu));
    let names = runs::names(&all, name);
    let named: Vec<Named<'_>> = all.iter().copied().zip(names).collect();
    // Optimisers and builders have different kernels: each kind for itself.
    let (optimisers, builders): (Vec<_>, Vec<_>) = named.into_iter().partition(|(run, _)| run.rows.len() > 1);
    let blocks = [optimisers, builders];
    let blocks = blocks.iter().flat_map(|runs| runs.chunks(COLUMNS)).map(block).collect();
    let bars = Bars {
        name: "kernels",
        heading: "Device time per kernel".to_owned(),
        subject: runs::subject(scene),
        caption: "Seconds that the kernels of a run took on the device, that of the initial tree included, and their share of all. The bars of \
                  a row of runs have one scale."
            .to_owned(),
        columns: &["run", "time (s)", "calls", "share (%)"],
        blocks,
    };
    bars.draw()
}

fn total(run: &OptimizerRun) -> f64 {
    run.phases.iter().map(|phase| phase.seconds).sum()
}

fn block(all: &[Named<'_>]) -> Vec<Column> {
    let mut labels: Vec<(&str, f64)> = Vec::new();
    for phase in all.iter().flat_map(|(run, _)| &run.phases) {
        match labels.iter_mut().find(|(label, _)| *label == phase.label) {
            Some((_, seconds)) => *seconds += phase.seconds,
            None => labels.push((&phase.label, phase.seconds)),
        }
    }
    labels.sort_by(|a, b| b.1.total_cmp(&a.1));
    let rest: Vec<(&str, f64)> = if labels.len() > MOST { labels.split_off(MOST - 1) } else { Vec::new() };
    let column = |(run, name): &Named<'_>| {
        let total = total(run);
        let bar = |label: &str, of: &[&str]| {
            let phases = run.phases.iter().filter(|phase| of.contains(&phase.label.as_str()));
            let (seconds, calls) = phases.fold((0.0, 0), |(s, c), phase| (s + phase.seconds, c + phase.calls));
            let share = 100.0 * seconds / total;
            Bar {
                name: label.to_owned(),
                value: seconds,
                text: if calls == 0 { "–".to_owned() } else { format!("{}, {share:.0} %", format::seconds(seconds)) },
                values: vec![
                    Value::Text(name.clone()),
                    Value::Number(seconds),
                    Value::Count(calls),
                    Value::Number(share),
                ],
            }
        };
        let mut bars: Vec<Bar> = labels.iter().map(|(label, _)| bar(label, &[*label])).collect();
        if !rest.is_empty() {
            bars.push(bar(REST, &rest.iter().map(|(label, _)| *label).collect::<Vec<_>>()));
        }
        Column { name: format!("{name}: {}", format::seconds(total)), bars }
    };
    all.iter().map(column).collect()
}

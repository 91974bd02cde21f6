//! Device time per kernel, a panel of bars per run.

use super::figure::{Figure, Fit, Kind, Panel, Point, Series, Value};
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use prbvh::format;

/// Kernels of a run; the rest is added up.
const MOST: usize = 14;
const REST: &str = "all others";
/// Room for a bar and its text, in lengths of the longest bar.
const ROOM: f64 = 1.7;

/// A run and what it is called among the others.
type Named<'a> = (&'a OptimizerRun, String);

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    let timed = |run: &&OptimizerRun| total(run) > 0.0;
    let of = |purpose| scene.runs.iter().filter(move |run| run.purpose == purpose).filter(timed).collect::<Vec<_>>();
    let mut all = of(Purpose::Table);
    if all.is_empty() {
        all = of(Purpose::Strategy);
    }
    let names = runs::names(&all, |run| runs::method(&run.method, Some(run.mu)));
    let named: Vec<Named<'_>> = all.iter().copied().zip(names).collect();
    // Optimisers and builders have different kernels: each kind for itself.
    let (optimisers, builders): (Vec<_>, Vec<_>) = named.into_iter().partition(|(run, _)| run.rows.len() > 1);
    let figure = Figure {
        name: "kernels",
        title: "Device time per kernel".to_owned(),
        subject: runs::subject(scene),
        caption: "Seconds that the kernels of a run took on the device, that of the initial tree included, and their share of all. The bars of \
                  optimisers have one scale, and so have those of builders."
            .to_owned(),
        columns: vec!["kernel", "time (s)", "calls", "share (%)"],
        panels: [optimisers, builders].iter().flat_map(|runs| panels(runs)).collect(),
        ..Figure::default()
    };
    figure.finished()
}

fn total(run: &OptimizerRun) -> f64 {
    run.phases.iter().map(|phase| phase.seconds).sum()
}

/// Runs of the same kernels.
fn panels(all: &[Named<'_>]) -> Vec<Panel> {
    let mut labels: Vec<(&str, f64)> = Vec::new();
    for phase in all.iter().flat_map(|(run, _)| &run.phases) {
        match labels.iter_mut().find(|(label, _)| *label == phase.label) {
            Some((_, seconds)) => *seconds += phase.seconds,
            None => labels.push((&phase.label, phase.seconds)),
        }
    }
    labels.sort_by(|a, b| b.1.total_cmp(&a.1));
    let rest: Vec<&str> = labels.iter().skip(MOST - 1).map(|(label, _)| *label).collect();
    let mut rows: Vec<(&str, Vec<&str>)> = labels.iter().map(|(label, _)| (*label, vec![*label])).collect();
    if labels.len() > MOST {
        rows.splice(MOST - 1.., [(REST, rest)]);
    }
    let bars = |(run, _): &Named<'_>| {
        let bar = |(at, (label, of)): (usize, &(&str, Vec<&str>))| {
            let phases = run.phases.iter().filter(|phase| of.contains(&phase.label.as_str()));
            let (seconds, calls) = phases.fold((0.0, 0), |(s, c), phase| (s + phase.seconds, c + phase.calls));
            let share = 100.0 * seconds / total(run);
            let name = Value::Text((*label).to_owned());
            let values = [name, Value::Number(seconds), Value::Count(calls), Value::Number(share)];
            let text =
                if calls == 0 { "–".to_owned() } else { format!("{}, {share:.0} %", format::seconds(seconds)) };
            Point { text, ..Point::new(seconds, at as f64, values) }
        };
        rows.iter().enumerate().map(bar).collect::<Vec<_>>()
    };
    let bars: Vec<Vec<Point>> = all.iter().map(bars).collect();
    let most = bars.iter().flatten().map(|bar| bar.x).fold(f64::MIN_POSITIVE, f64::max);
    let names = || Fit::Names(rows.iter().map(|(label, _)| (*label).to_owned()).collect());
    let panel = |((run, name), bars): (&Named<'_>, Vec<Point>)| {
        let heading = format!("{name}: {}", format::seconds(total(run)));
        let series = Series::new(name, Kind::Bars, bars);
        Panel::new(&heading, ("", Fit::Between(0.0, ROOM * most)), ("", names()), vec![series])
    };
    all.iter().zip(bars).map(panel).collect()
}

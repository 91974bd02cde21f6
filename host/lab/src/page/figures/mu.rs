//! Influence of µ on cost and time, as in Meister & Bittner 2018.

use super::chart::Chart;
use super::panel::{Curve, Names, Panel, Point};
use super::style::Style;
use super::ticks::Tick;
use super::{Figure, Value, runs};
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use crate::report::axis::Axis;
use crate::report::plot::PlotError;

/// Runs that differ in µ alone, by rising µ.
struct Group<'a> {
    runs: Vec<&'a OptimizerRun>,
}

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    let groups = groups(scene);
    let firsts: Vec<&OptimizerRun> = groups.iter().map(|group| group.runs[0]).collect();
    let names = runs::names(&firsts, |run| name(run, &firsts));
    let curves = |value: fn(&OptimizerRun) -> f64| -> Vec<Curve> {
        let curve = |(k, (group, name)): (usize, (&Group<'_>, &String))| Curve {
            name: name.clone(),
            style: Style(k),
            joined: true,
            points: group.runs.iter().map(|run| point(run, value)).collect(),
        };
        groups.iter().zip(&names).enumerate().map(curve).collect()
    };
    let panels = vec![
        panel("final SAH cost", "SAH cost (no unit)", curves(final_cost), Axis::around),
        panel("time to convergence", "time from triangles (s)", curves(final_time), Axis::from_zero),
    ];
    let chart = Chart {
        name: "mu",
        heading: "Influence of µ".to_owned(),
        subject: runs::subject(scene),
        caption: "With µ, an iteration searches one node in µ. A small µ tries more per iteration and takes longer; a large one is faster and \
                  may end at a higher cost. On the left the cost at the end, on the right the wall time from triangles to it."
            .to_owned(),
        note: String::new(),
        height: 640,
        columns: &["µ", "time (s)", "SAH cost", "iterations"],
        panels,
    };
    chart.draw()
}

fn groups(scene: &SceneComparison) -> Vec<Group<'_>> {
    let key = |run: &OptimizerRun| [&run.method, &run.initial, &run.strategy, &run.device].map(String::clone);
    let mut groups: Vec<Group<'_>> = Vec::new();
    // Runs made for this figure come first: one of the table only adds a µ.
    for purpose in [Purpose::Mu, Purpose::Table] {
        for run in scene.runs.iter().filter(|run| run.purpose == purpose && run.mu > 0 && !run.rows.is_empty()) {
            match groups.iter_mut().find(|group| key(group.runs[0]) == key(run)) {
                Some(group) if group.runs.iter().any(|known| known.mu == run.mu) => {}
                Some(group) => group.runs.push(run),
                None => groups.push(Group { runs: vec![run] }),
            }
        }
    }
    groups.retain_mut(|group| {
        group.runs.sort_by_key(|run| run.mu);
        group.runs.len() > 1
    });
    groups
}

fn name(run: &OptimizerRun, all: &[&OptimizerRun]) -> String {
    let mut name = run.method.clone();
    if all.iter().any(|other| other.strategy != run.strategy) {
        name = format!("{name} {}", run.strategy);
    }
    if all.iter().any(|other| other.initial != run.initial) {
        name = format!("{name} from {}", run.initial);
    }
    name
}

fn final_cost(run: &OptimizerRun) -> f64 {
    run.rows.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min)
}

fn final_time(run: &OptimizerRun) -> f64 {
    run.rows.last().map_or(f64::NAN, |row| runs::seconds(run, row))
}

fn point(run: &OptimizerRun, value: fn(&OptimizerRun) -> f64) -> Point {
    let iterations = run.rows.last().map_or(0, |row| row.iteration);
    Point {
        x: run.mu.into(),
        y: value(run),
        values: vec![
            Value::Count(run.mu.into()),
            Value::Number(final_time(run)),
            Value::Number(final_cost(run)),
            Value::Count(iterations.into()),
        ],
    }
}

fn panel(heading: &str, y_title: &str, curves: Vec<Curve>, y_axis: fn(std::vec::IntoIter<f64>) -> Axis) -> Panel {
    let values = |of: fn(&Point) -> f64| curves.iter().flat_map(|curve| &curve.points).map(of).collect::<Vec<_>>();
    let x = Axis::log_time(values(|point| point.x).into_iter());
    let mut mus = values(|point| point.x);
    mus.sort_by(f64::total_cmp);
    mus.dedup();
    Panel {
        heading: heading.to_owned(),
        x_ticks: Some(apart(&x, &mus)),
        x,
        y: y_axis(values(|point| point.y).into_iter()),
        x_title: "µ (logarithmic)".to_owned(),
        y_title: y_title.to_owned(),
        y_ticks: None,
        names: Names::Beside,
        curves,
    }
}

/// A tick at every value that is not too near the one before.
fn apart(axis: &Axis, values: &[f64]) -> Vec<Tick> {
    let range = axis.range();
    let mut ticks: Vec<Tick> = Vec::new();
    for &value in values {
        let at = axis.place(value);
        if ticks.last().is_none_or(|last| at - last.at > 0.05 * (range.end - range.start)) {
            ticks.push(Tick { at, text: value.to_string() });
        }
    }
    ticks
}

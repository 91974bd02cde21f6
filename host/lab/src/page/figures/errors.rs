//! Relative error against time: a curve per method, and the Pareto front over all settings.

use super::chart::Chart;
use super::panel::{Curve, Names, Panel, Point};
use super::style::Style;
use super::{Figure, Value, runs};
use crate::compare::{OptimizerRun, Purpose, Reference, SceneComparison, SceneErrors, SettingErrors};
use crate::report::axis::Axis;
use crate::report::plot::PlotError;
use prbvh::optimize::IterationRow;

/// Crosses, which no member of the front has.
const OTHERS: Style = Style(5);
const COLUMNS: [&str; 3] = ["time (s)", "relative error", "SAH cost"];

pub(super) fn figure(scene: &SceneComparison) -> Result<Option<Figure>, PlotError> {
    let Some(errors) = &scene.errors else { return Ok(None) };
    let members: Vec<String> = errors.front().map(|setting| runs::method(&setting.method, Some(setting.mu))).collect();
    let chart = Chart {
        name: "error-time",
        heading: "Relative error against time".to_owned(),
        subject: runs::subject(scene),
        caption: format!(
            "Cost divided by the lowest one known ({:.3}: {}), less 1, against the wall time from triangles; both axes are logarithmic. On \
             the left every method's way; on the right where each setting ends, with the Pareto front: no other setting is both as fast \
             and as good. Its members, the fastest first: {}.",
            errors.reference.reference_cost,
            errors.reference.source,
            members.join("; ")
        ),
        note: String::new(),
        height: 900,
        columns: &COLUMNS,
        panels: vec![
            panel("every tree of a run", ways(scene, &errors.reference)),
            panel("end of every setting", ends(errors)),
        ],
    };
    chart.draw()
}

fn panel(heading: &str, curves: Vec<Curve>) -> Panel {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    Panel {
        heading: heading.to_owned(),
        x: Axis::log_time(points().map(|point| point.x)),
        y: Axis::log(points().map(|point| point.y)),
        x_title: "time from triangles (s, logarithmic)".to_owned(),
        y_title: "cost / lowest known − 1 (logarithmic)".to_owned(),
        x_ticks: None,
        y_ticks: None,
        names: Names::Beside,
        curves,
    }
}

fn point(time: f64, error: f64, cost: f64) -> Point {
    // No lower cost is known, but one of a row may be by rounding.
    let error = error.max(0.0);
    Point { x: time, y: error, values: vec![Value::Number(time), Value::Number(error), Value::Number(cost)] }
}

/// The runs of the table.
fn ways(scene: &SceneComparison, reference: &Reference) -> Vec<Curve> {
    let all: Vec<&OptimizerRun> = scene.runs.iter().filter(|run| run.purpose == Purpose::Table).collect();
    let names = runs::names(&all, |run| runs::method(&run.method, Some(run.mu)));
    let curve = |(k, (run, name)): (usize, (&&OptimizerRun, String))| {
        let is_finite = |row: &&IterationRow| row.cost.is_finite() && row.cost > 0.0;
        let at = |row: &IterationRow| point(runs::seconds(run, row), reference.error_of(row.cost), row.cost);
        let points = run.rows.iter().filter(is_finite).map(at).collect();
        Curve { name, style: Style(k), joined: run.rows.len() > 1, points }
    };
    all.iter().zip(names).enumerate().map(curve).collect()
}

/// The front as one curve, its members under their names, and all others without.
fn ends(errors: &SceneErrors) -> Vec<Curve> {
    let cost = |setting: &SettingErrors| errors.reference.reference_cost * (1.0 + setting.error);
    let at = |setting: &SettingErrors| point(setting.wall_s, setting.error, cost(setting));
    let is_on_front = |k: usize| errors.pareto_front.contains(&k);
    let others = errors.settings.iter().enumerate().filter(|(k, _)| !is_on_front(*k)).map(|(_, setting)| at(setting));
    let mut curves = vec![
        Curve { name: "others".to_owned(), style: OTHERS, joined: false, points: others.collect() },
        Curve {
            name: "Pareto front".to_owned(),
            style: Style(0),
            joined: true,
            points: errors.front().map(at).collect(),
        },
    ];
    curves.extend(errors.front().enumerate().map(|(k, setting)| Curve {
        name: runs::method(&setting.method, Some(setting.mu)),
        style: Style(if k + 1 < OTHERS.0 { k + 1 } else { k + 2 }),
        joined: false,
        points: vec![at(setting)],
    }));
    curves
}

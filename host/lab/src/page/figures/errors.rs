//! Relative error against time: a line per method, and the Pareto front over all settings.

use super::figure::{Figure, Fit, Kind, Panel, Point, Series, Value};
use super::runs;
use super::style::Look;
use crate::compare::{OptimizerRun, Purpose, Reference, SceneComparison, SceneErrors, SettingErrors};
use prbvh::optimize::IterationRow;

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    let errors = scene.errors.as_ref()?;
    let names = setting_names(errors);
    let members: Vec<&str> = errors.pareto_front.iter().map(|&k| names[k].as_str()).collect();
    let figure = Figure {
        name: "error-time",
        title: "Relative error against time".to_owned(),
        subject: runs::subject(scene),
        caption: format!(
            "Cost divided by the lowest one known ({:.3}: {}), less 1, against the wall time from triangles; both axes are logarithmic. On \
             the left every method's way; on the right where each setting ends, with the Pareto front: no other setting is both as fast \
             and as good. Its members, the fastest first: {}.",
            errors.reference.reference_cost,
            errors.reference.source,
            members.join("; ")
        ),
        columns: vec!["time (s)", "relative error", "SAH cost"],
        panels: vec![
            panel("every tree of a run", ways(scene, &errors.reference)),
            panel("end of every setting", ends(errors, &names)),
        ],
        ..Figure::default()
    };
    figure.finished()
}

fn panel(heading: &str, series: Vec<Series>) -> Panel {
    let error = "cost / lowest known − 1 (logarithmic)";
    Panel::new(heading, (runs::TIME, Fit::Decades), (error, Fit::Decades), series)
}

fn point(time: f64, error: f64, cost: f64) -> Point {
    // No lower cost is known, but one of a row may be by rounding.
    let error = error.max(0.0);
    Point::new(time, error, [time, error, cost].map(Value::Number))
}

/// The runs of the table.
fn ways(scene: &SceneComparison, reference: &Reference) -> Vec<Series> {
    let all: Vec<&OptimizerRun> = scene.runs.iter().filter(|run| run.purpose == Purpose::Table).collect();
    let names = runs::names(&all, |run| runs::method(&run.method, Some(run.mu)));
    let series = |(run, name): (&&OptimizerRun, String)| {
        let is_finite = |row: &&IterationRow| row.cost.is_finite() && row.cost > 0.0;
        let at = |row: &IterationRow| point(runs::seconds(run, row), reference.error_of(row.cost), row.cost);
        Series::new(name, Kind::Line, run.rows.iter().filter(is_finite).map(at))
    };
    all.iter().zip(names).map(series).collect()
}

fn setting_names(errors: &SceneErrors) -> Vec<String> {
    let name = |setting: &'_ SettingErrors| runs::method(&setting.method, Some(setting.mu));
    runs::told_apart(&errors.settings.iter().map(|s| (name(s), s.device.as_str())).collect::<Vec<_>>())
}

/// The front as one line, its members under their names, and all others without.
fn ends(errors: &SceneErrors, names: &[String]) -> Vec<Series> {
    let end = |setting: &SettingErrors| {
        point(setting.wall_s, setting.error, errors.reference.reference_cost * (1.0 + setting.error))
    };
    let others = errors.settings.iter().enumerate().filter(|(k, _)| !errors.pareto_front.contains(k));
    let members = errors.pareto_front.iter().map(|&k| (&names[k], end(&errors.settings[k])));
    let mut series = vec![
        Series::new("others", Kind::Points, others.map(|(_, setting)| end(setting))).looking(Look::DOT),
        Series::new("Pareto front", Kind::Line, members.clone().map(|(_, point)| point)).looking(Look::LINE),
    ];
    series.extend(members.map(|(name, point)| Series::new(name, Kind::Points, [point])));
    series
}

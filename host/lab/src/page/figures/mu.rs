//! Influence of µ on cost and time, as in Meister & Bittner 2018.

use super::figure::{Figure, Fit, Kind, Panel, Point, Series, Value};
use super::runs;
use crate::compare::{OptimizerRun, Purpose, SceneComparison};

/// Runs that differ in µ alone, by rising µ.
type Group<'a> = Vec<&'a OptimizerRun>;

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    let groups = groups(scene);
    let firsts: Vec<&OptimizerRun> = groups.iter().map(|group| group[0]).collect();
    let names = runs::names(&firsts, |run| name(run, &firsts));
    let mut mus: Vec<u32> = groups.iter().flatten().map(|run| run.mu).collect();
    mus.sort_unstable();
    mus.dedup();
    let panel = |heading: &str, title: &str, fit: Fit, value: fn(&OptimizerRun) -> f64| {
        let series = |(group, name): (&Group<'_>, &String)| {
            let place = |run: &OptimizerRun| mus.iter().position(|&mu| mu == run.mu).unwrap_or_default() as f64;
            let points = group.iter().map(|run| Point::new(place(run), value(run), values(run)));
            Series::new(name, Kind::Line, points)
        };
        let places = Fit::Names(mus.iter().map(ToString::to_string).collect());
        Panel::new(heading, ("µ", places), (title, fit), groups.iter().zip(&names).map(series).collect())
    };
    let figure = Figure {
        name: "mu",
        title: "Influence of µ".to_owned(),
        subject: runs::subject(scene),
        caption: "With µ, an iteration searches one node in µ. A small µ tries more per iteration and takes longer; a large one is faster and \
                  may end at a higher cost. On the left the cost at the end, on the right the wall time from triangles to it."
            .to_owned(),
        columns: vec!["µ", "time (s)", "SAH cost", "iterations"],
        panels: vec![
            panel("final SAH cost", "SAH cost (no unit)", Fit::Around, final_cost),
            panel("time to convergence", "time from triangles (s)", Fit::FromZero, final_time),
        ],
        ..Figure::default()
    };
    figure.finished()
}

fn groups(scene: &SceneComparison) -> Vec<Group<'_>> {
    let key = |run: &OptimizerRun| [&run.method, &run.initial, &run.strategy, &run.device].map(String::clone);
    let mut groups: Vec<Group<'_>> = Vec::new();
    // Runs made for this figure come first: one of the table only adds a µ.
    for purpose in [Purpose::Mu, Purpose::Table] {
        for run in scene.runs.iter().filter(|run| run.purpose == purpose && run.mu > 0 && !run.rows.is_empty()) {
            match groups.iter_mut().find(|group| key(group[0]) == key(run)) {
                Some(group) if group.iter().any(|known| known.mu == run.mu) => {}
                Some(group) => group.push(run),
                None => groups.push(vec![run]),
            }
        }
    }
    groups.retain_mut(|group| {
        group.sort_by_key(|run| run.mu);
        group.len() > 1
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

fn values(run: &OptimizerRun) -> [Value; 4] {
    let iterations = run.rows.last().map_or(0, |row| row.iteration);
    [
        Value::Count(run.mu.into()),
        Value::Number(final_time(run)),
        Value::Number(final_cost(run)),
        Value::Count(iterations.into()),
    ]
}

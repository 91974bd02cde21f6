//! Initial tree × optimiser: cost, ray cost and time of each initial tree, and of what PRBVH makes of it.

use super::figure::{Figure, Fit, Kind, Panel, Point, Series, Value};
use super::{initial, runs};
use crate::compare::{OptimizerRun, SceneComparison};

/// Method whose rows are PRBVH from LBVH; from other trees they are `prbvh from …`.
const FROM_LBVH: &str = "prbvh worst first";

pub(super) fn figure(scene: &SceneComparison) -> Option<Figure> {
    let runs = initial::runs(scene);
    let names = runs::names(&runs, |run| runs::method(&run.initial, (run.mu > 0).then_some(run.mu)));
    let panel = |heading: &str, fit: Fit, value: &dyn Fn(&OptimizerRun) -> [Option<f64>; 2]| {
        let series = |(which, name): (usize, &str)| {
            let point = |(k, (run, initial)): (usize, (&&OptimizerRun, &String))| {
                let value = value(run)[which]?;
                let values = [Value::Text(initial.clone()), Value::Text(name.to_owned()), Value::Number(value)];
                Some(Point::new(value, k as f64, values))
            };
            let points: Vec<Point> = runs.iter().zip(&names).enumerate().filter_map(point).collect();
            Series::new(name.to_owned(), Kind::Points, points)
        };
        let both = ["initial tree", "after PRBVH"].into_iter().enumerate().map(series).collect();
        Panel::new("", (heading, fit), ("", Fit::Names(names.clone())), both)
    };
    let figure = Figure {
        name: "starts",
        title: "Initial trees before and after PRBVH".to_owned(),
        subject: runs::subject(scene),
        caption: "Each row is an initial tree; one mark is that tree, the other what the optimiser makes of it. Rays see the effective partial overlap \
                  (EPO) where the cost does not; it is there for the methods of the table."
            .to_owned(),
        columns: vec!["initial tree", "tree", "value"],
        panels: vec![
            panel("SAH cost (no unit)", Fit::Around, &costs),
            panel("EPO (no unit)", Fit::Around, &|run| epo(scene, run)),
            panel(runs::TIME, Fit::Decades, &times),
        ],
        ..Figure::default()
    };
    figure.finished()
}

/// Of the initial tree, and the lowest of the run.
fn costs(run: &OptimizerRun) -> [Option<f64>; 2] {
    let lowest = run.rows.iter().map(|row| row.cost).min_by(f64::total_cmp);
    [run.rows.first().map(|row| row.cost), lowest]
}

fn times(run: &OptimizerRun) -> [Option<f64>; 2] {
    [Some(run.build_s), run.rows.last().map(|row| runs::seconds(run, row))]
}

/// Of the rows of the table that made the same trees.
fn epo(scene: &SceneComparison, run: &OptimizerRun) -> [Option<f64>; 2] {
    let of = |is_it: &dyn Fn(&str) -> bool| {
        scene.rows.iter().filter(|row| row.mu.unwrap_or(0) == run.mu && is_it(&row.method)).find_map(|row| row.epo)
    };
    let started = format!("prbvh from {}", run.initial);
    let before = scene.rows.iter().filter(|row| row.method == run.initial).find_map(|row| row.epo);
    [before, of(&|method| method == started || run.initial == "lbvh" && method == FROM_LBVH)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::{MethodRow, Purpose};
    use prbvh::optimize::IterationRow;

    #[test]
    fn a_tree_has_a_mark_before_and_one_after() {
        let row = |cost: f64, time_s: f64| {
            IterationRow::default().with(|row| {
                row.cost = cost;
                row.time_s = time_s;
            })
        };
        let run = |purpose, initial: &str, costs: [f64; 3]| OptimizerRun {
            method: String::new(),
            purpose,
            initial: initial.to_owned(),
            strategy: "aggressive".to_owned(),
            mu: 0,
            device: "cpu".to_owned(),
            build_s: 0.5,
            build_device_s: None,
            rows: vec![row(costs[0], 0.0), row(costs[1], 1.0), row(costs[2], 2.0)],
            phases: Vec::new(),
            plan: Vec::new(),
        };
        let of_table =
            |method: &str, epo| MethodRow { method: method.to_owned(), epo: Some(epo), ..MethodRow::default() };
        let mut scene = SceneComparison {
            name: "scene".to_owned(),
            hash: String::new(),
            triangles: 3,
            notes: Vec::new(),
            rows: vec![of_table("aac:hq", 9.0), of_table("prbvh from aac:hq", 7.0), of_table("prbvh worst first", 6.0)],
            runs: vec![
                run(Purpose::Initial, "aac:hq", [50.0, 38.0, 40.0]),
                run(Purpose::Table, "lbvh", [70.0, 45.0, 41.0]),
            ],
            errors: None,
            pictures: Vec::new(),
        };
        let figure = figure(&scene).unwrap();
        let marks = |panel: usize, series: usize| {
            figure.panels[panel].series[series].points.iter().map(|point| point.x).collect::<Vec<_>>()
        };
        assert_eq!(figure.panels[0].y.names, ["aac:hq", "lbvh"]);
        assert_eq!((marks(0, 0), marks(0, 1)), (vec![50.0, 70.0], vec![38.0, 41.0]));
        assert_eq!((marks(1, 0), marks(1, 1)), (vec![9.0], vec![7.0, 6.0]));
        assert_eq!((marks(2, 0), marks(2, 1)), (vec![0.5, 0.5], vec![2.5, 2.5]));
        scene.runs.truncate(1);
        assert!(super::figure(&scene).is_none(), "one start is nothing to compare");
    }
}

//! Runs as curves, and what they are called.

use super::figure::{Fit, Kind, Panel, Point, Series, Value};
use crate::compare::{OptimizerRun, Purpose, SceneComparison};
use prbvh::format;
use prbvh::optimize::IterationRow;

/// `sponza, 262,267 triangles`.
pub(super) fn subject(scene: &SceneComparison) -> String {
    format!("{}, {} triangles", format::shortened(&scene.name, 80), format::count(scene.triangles.into()))
}

/// Method, and µ where it has one.
pub(super) fn method(method: &str, mu: Option<u32>) -> String {
    match mu {
        Some(mu) if mu > 0 => format!("{method} µ = {mu}"),
        _ => method.to_owned(),
    }
}

/// Names of runs among one another: what `what` says, and the device where that would be the name of runs of several.
pub(super) fn names(runs: &[&OptimizerRun], what: impl Fn(&OptimizerRun) -> String) -> Vec<String> {
    told_apart(&runs.iter().map(|run| (what(run), run.device.as_str())).collect::<Vec<_>>())
}

/// The names; and the device where one name is that of several.
pub(super) fn told_apart(all: &[(String, &str)]) -> Vec<String> {
    let name = |(name, device): &(String, &str)| {
        let twice = all.iter().any(|(other, elsewhere)| other == name && elsewhere != device);
        if twice { format!("{name}, {}", short_device(device)) } else { name.clone() }
    };
    all.iter().map(name).collect()
}

/// A device's name without what drivers add to it: `llvmpipe (LLVM 19.1.7, 256 bits)` is `llvmpipe`.
fn short_device(name: &str) -> String {
    let start = name.split(" (").next().filter(|start| !start.is_empty()).unwrap_or(name);
    format::shortened(start, 18)
}

/// Seconds from triangles to the end of the row.
pub(super) fn seconds(run: &OptimizerRun, row: &IterationRow) -> f64 {
    run.build_s + row.time_s
}

/// Columns of the points of [`cost_over`].
pub(super) const COLUMNS: [&str; 3] = ["iteration", "time (s)", "SAH cost"];

/// Cost against what `at` says, a series for each run.
pub(super) fn cost_over(
    heading: &str,
    x: (&str, Fit),
    runs: &[&OptimizerRun],
    names: &[String],
    at: fn(&OptimizerRun, &IterationRow) -> f64,
) -> Panel {
    let series = |(run, name): (&&OptimizerRun, &String)| {
        let point = |row: &IterationRow| {
            let values =
                [Value::Count(row.iteration.into()), Value::Number(seconds(run, row)), Value::Number(row.cost)];
            Point::new(at(run, row), row.cost, values)
        };
        Series::new(name, Kind::Line, run.rows.iter().map(point))
    };
    Panel::new(heading, x, ("SAH cost (no unit)", Fit::Around), runs.iter().zip(names).map(series).collect())
}

/// Cost against the time from triangles, a series for each run.
pub(super) fn cost_over_time(heading: &str, runs: &[&OptimizerRun], names: &[String]) -> Panel {
    cost_over(heading, (TIME, Fit::Decades), runs, names, seconds)
}

/// Title of an axis of times.
pub(super) const TIME: &str = "time from triangles (s, logarithmic)";

/// The runs of a purpose, and those of other figures that differ from one of them in nothing but `differs`, and add a value of it.
/// None unless there are two values to compare.
pub(super) fn counterparts<'a, S: PartialEq, D: PartialEq>(
    scene: &'a SceneComparison,
    purpose: Purpose,
    same: impl Fn(&'a OptimizerRun) -> S,
    differs: impl Fn(&'a OptimizerRun) -> D,
) -> Option<Vec<&'a OptimizerRun>> {
    let has_rows = |run: &&OptimizerRun| !run.rows.is_empty();
    let mut runs: Vec<&OptimizerRun> =
        scene.runs.iter().filter(|run| run.purpose == purpose).filter(has_rows).collect();
    for other in [Purpose::Table, Purpose::Mu, Purpose::Strategy, Purpose::Initial] {
        for run in scene.runs.iter().filter(|run| run.purpose == other && other != purpose).filter(has_rows) {
            let alike = runs.iter().filter(|known| same(known) == same(run)).copied().collect::<Vec<_>>();
            if !alike.is_empty() && alike.iter().all(|known| differs(known) != differs(run)) {
                runs.push(run);
            }
        }
    }
    runs.windows(2).any(|pair| differs(pair[0]) != differs(pair[1])).then_some(runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(purpose: Purpose, initial: &str, mu: u32, device: &str) -> OptimizerRun {
        OptimizerRun {
            method: "prbvh".to_owned(),
            purpose,
            initial: initial.to_owned(),
            strategy: "aggressive".to_owned(),
            mu,
            device: device.to_owned(),
            build_s: 0.5,
            build_device_s: None,
            rows: vec![IterationRow::default()],
            phases: Vec::new(),
            plan: Vec::new(),
        }
    }

    #[test]
    fn devices_are_named_where_they_tell_runs_apart() {
        let runs = [run(Purpose::Table, "lbvh", 1, "llvmpipe (LLVM 19)"), run(Purpose::Table, "lbvh", 9, "cpu")];
        let name = |run: &OptimizerRun| method(&run.method, Some(run.mu));
        assert_eq!(names(&[&runs[0], &runs[1]], name), ["prbvh µ = 1", "prbvh µ = 9"]);
        let same = |_: &OptimizerRun| "prbvh".to_owned();
        assert_eq!(names(&[&runs[0], &runs[1]], same), ["prbvh, llvmpipe", "prbvh, cpu"]);
    }

    #[test]
    fn counterparts_come_from_the_table() {
        let scene = |runs| SceneComparison {
            name: String::new(),
            hash: String::new(),
            triangles: 1,
            notes: Vec::new(),
            rows: Vec::new(),
            runs,
            errors: None,
            pictures: Vec::new(),
        };
        let found = |runs| {
            let scene = scene(runs);
            let same = |run: &OptimizerRun| (run.mu, run.device.clone());
            let found = counterparts(&scene, Purpose::Initial, same, |run| run.initial.clone());
            found.map(|runs| runs.iter().map(|run| run.initial.clone()).collect::<Vec<_>>())
        };
        let ploc = run(Purpose::Initial, "ploc", 9, "gpu");
        let lbvh = run(Purpose::Table, "lbvh", 9, "gpu");
        assert_eq!(found(vec![lbvh.clone(), ploc.clone()]).unwrap(), ["ploc", "lbvh"]);
        assert_eq!(found(vec![ploc.clone()]), None);
        assert_eq!(found(vec![lbvh.clone()]), None);
        // Of another µ or device, or there already.
        assert_eq!(found(vec![ploc.clone(), run(Purpose::Table, "lbvh", 1, "gpu")]), None);
        assert_eq!(found(vec![ploc.clone(), run(Purpose::Table, "lbvh", 9, "cpu")]), None);
        assert_eq!(found(vec![ploc.clone(), run(Purpose::Table, "ploc", 9, "gpu"), lbvh]).unwrap(), ["ploc", "lbvh"]);
    }
}

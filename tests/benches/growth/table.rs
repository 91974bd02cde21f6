//! What is printed, as Markdown.

use crate::limits::{Memory, Search};
use crate::scaling::Row;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::bench::markdown::{Markdown, ms, number};
use prbvh_tests::bench::stats::{exponent, geometric_mean, worst};
use prbvh_tests::bench::targets::{FEWEST_TRIANGLES, Verdict};
use std::collections::BTreeSet;

/// Seconds of a stage; none if it did not run.
fn stage(row: &Row, label: &str) -> Option<f64> {
    row.measured.phases.iter().find(|(have, _)| have == label).map(|(_, seconds)| *seconds)
}

/// Stages of any of the rows, in the order in which they ran.
fn stages<'a>(rows: impl Iterator<Item = &'a Row>) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let all = rows.flat_map(|row| &row.measured.phases).map(|(label, _)| label);
    all.filter(|label| seen.insert((*label).clone())).cloned().collect()
}

/// Bytes per triangle of the device's buffers and of the triangles that came in.
fn device_bytes(row: &Row) -> f64 {
    row.measured.peak_bytes as f64 / row.triangles as f64 + size_of::<Triangle>() as f64
}

fn process_bytes(row: &Row) -> Option<f64> {
    Some(row.process_bytes? as f64 / row.triangles as f64)
}

/// Time and memory of every run.
pub(crate) fn runs(rows: &[Row]) -> String {
    let mut table = Markdown::new(&[
        "<scene",
        "triangles",
        "threads",
        "build, ms",
        "optimise, ms",
        "both, ms",
        "iterations",
        "ms an iteration",
        "ns a triangle",
        "device + input, bytes a triangle",
        "process, bytes a triangle",
        "cost",
        "<tree hash",
    ]);
    for row in rows {
        let m = &row.measured;
        table.row(&[
            row.scene.clone(),
            row.triangles.to_string(),
            row.threads.to_string(),
            ms(m.build_s),
            ms(m.optimize_s),
            ms(m.total_s),
            m.iterations.to_string(),
            ms(m.optimize_s / f64::from(m.iterations.max(1))),
            number(m.total_s / row.triangles as f64 * 1e9, 0),
            number(device_bytes(row), 1),
            number(process_bytes(row), 1),
            number(m.final_cost, 3),
            m.tree_hash.clone(),
        ]);
    }
    table.finish()
}

/// How many times as fast a run of several threads is as the same on one: all of it and stage by stage.
pub(crate) fn speedups(rows: &[Row]) -> String {
    let labels = stages(rows.iter());
    let fixed = ["<scene", "triangles", "threads", "build", "optimise", "both"];
    let headers: Vec<&str> = fixed.into_iter().chain(labels.iter().map(String::as_str)).collect();
    let mut table = Markdown::new(&headers);
    for row in rows.iter().filter(|row| row.threads > 1) {
        let Some(one) = one_thread(rows, row) else { continue };
        let (a, b) = (&one.measured, &row.measured);
        let mut cells = vec![
            row.scene.clone(),
            row.triangles.to_string(),
            row.threads.to_string(),
            number(a.build_s / b.build_s, 2),
            number(a.optimize_s / b.optimize_s, 2),
            number(a.total_s / b.total_s, 2),
        ];
        cells
            .extend(labels.iter().map(|label| number(stage(one, label).zip(stage(row, label)).map(|(a, b)| a / b), 2)));
        table.row(&cells);
    }
    table.finish()
}

fn one_thread<'a>(rows: &'a [Row], row: &Row) -> Option<&'a Row> {
    rows.iter().find(|one| one.threads == 1 && one.scene_hash == row.scene_hash)
}

/// Milliseconds of every stage at every size, and the exponents of their growth, with all threads.
pub(crate) fn growth(rows: &[Row]) -> String {
    let rows = grown(rows);
    let mut headers = vec!["<what".to_owned()];
    headers.extend(rows.iter().map(|row| format!("{}, ms", row.triangles)));
    headers.push("exponent".to_owned());
    let mut table = Markdown::new(&headers.iter().map(String::as_str).collect::<Vec<_>>());
    let mut line = |what: &str, of: &dyn Fn(&Row) -> Option<f64>| {
        let mut cells = vec![what.to_owned()];
        cells.extend(rows.iter().map(|row| ms(of(row))));
        cells.push(number(fitted(&rows, of), 3));
        table.row(&cells);
    };
    line("build + optimise", &|row| Some(row.measured.total_s));
    line("build", &|row| Some(row.measured.build_s));
    line("optimise", &|row| Some(row.measured.optimize_s));
    line("an iteration", &|row| Some(row.measured.optimize_s / f64::from(row.measured.iterations.max(1))));
    for label in &stages(rows.iter().copied()) {
        line(label, &|row| stage(row, label));
    }
    table.finish()
}

/// Built-in scenes with the most threads, by size.
fn grown(rows: &[Row]) -> Vec<&Row> {
    let most = rows.iter().map(|row| row.threads).max().unwrap_or(0);
    rows.iter().filter(|row| row.is_built_in && row.threads == most).collect()
}

fn fitted(rows: &[&Row], of: &dyn Fn(&Row) -> Option<f64>) -> Option<f64> {
    let points: Option<Vec<(f64, f64)>> = rows.iter().map(|row| Some((row.triangles as f64, of(row)?))).collect();
    exponent(&points?)
}

/// The machine's memory.
pub(crate) fn memory(memory: &[Memory]) -> String {
    let mut table = Markdown::new(&[
        "working set, KiB",
        "dependent read, ns",
        "independent read, ns",
        "independent reads, GB/s a thread",
        "front to back, GB/s all threads",
    ]);
    for m in memory {
        table.row(&[
            (m.bytes >> 10).to_string(),
            number(m.dependent_s * 1e9, 2),
            number(m.independent_s * 1e9, 2),
            number(32.0 / m.independent_s / 1e9, 2),
            number(m.sequential / 1e9, 2),
        ]);
    }
    table.finish()
}

/// The search beside what the memory allows.
pub(crate) fn searches(searches: &[Search]) -> String {
    let mut table = Markdown::new(&[
        "<scene",
        "<tree",
        "tree, MiB",
        "searches",
        "found",
        "steps a search",
        "most",
        "threads",
        "search, ms",
        "ns a step and thread",
        "GB/s",
        "÷ latency",
        "÷ random reads",
        "÷ bandwidth",
    ]);
    for s in searches {
        let steps = s.steps as f64;
        table.row(&[
            s.scene.clone(),
            s.tree.to_owned(),
            number(s.tree_bytes as f64 / f64::from(1 << 20), 1),
            s.searches.to_string(),
            s.found.to_string(),
            number(steps / s.searches as f64, 1),
            s.most_steps.to_string(),
            s.threads.to_string(),
            ms(s.search_s),
            number(s.search_s * s.threads as f64 / steps * 1e9, 2),
            number(steps * 32.0 / s.search_s / 1e9, 2),
            number(s.search_s / s.bounds_s[0], 2),
            number(s.search_s / s.bounds_s[1], 2),
            number(s.search_s / s.bounds_s[2], 2),
        ]);
    }
    table.finish()
}

/// The targets of time and memory.
pub(crate) fn targets(rows: &[Row]) -> String {
    let two = rows.iter().filter(|row| row.threads == 2 && row.triangles >= FEWEST_TRIANGLES);
    let slowdowns: Vec<f64> =
        two.filter_map(|row| Some(row.measured.total_s / one_thread(rows, row)?.measured.total_s)).collect();
    let grown = grown(rows);
    let largest = grown.last();
    let nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let scenes = slowdowns.len();
    let size = largest.map_or(0, |row| row.triangles);
    let verdicts = [
        Verdict::at_least(
            format!("two threads ÷ one, geometric mean of {scenes} scenes, ≥ 1.8"),
            1.0 / geometric_mean(&slowdowns),
            1.8,
            2,
        ),
        Verdict::at_least(
            format!("two threads ÷ one, worst of {scenes} scenes, ≥ 1.8"),
            1.0 / worst(&slowdowns),
            1.8,
            2,
        ),
        Verdict::at_most(
            "exponent of build + optimise against triangles, ≤ 1.15".to_owned(),
            nan(fitted(&grown, &|row| Some(row.measured.total_s))),
            1.15,
            3,
        ),
        Verdict::at_most(
            format!("device buffers and input at {size} triangles, bytes a triangle, ≤ 250"),
            nan(largest.map(|row| device_bytes(row))),
            250.0,
            1,
        ),
        Verdict::at_most(
            format!("whole process at {size} triangles, bytes a triangle, ≤ 250"),
            nan(largest.and_then(|row| process_bytes(row))),
            250.0,
            1,
        ),
    ];
    let mut table = Markdown::new(&["<target", "measured", "<", "by"]);
    for verdict in verdicts {
        let word = verdict.word().to_owned();
        table.row(&[verdict.target, verdict.measured, word, verdict.by]);
    }
    table.finish()
}

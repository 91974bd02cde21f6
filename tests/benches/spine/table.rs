//! The tables of the benchmark, as Markdown.

use crate::Row;
use prbvh_tests::bench::markdown::number;
use prbvh_tests::bench::runs::Measured;
use prbvh_tests::bench::stats::exponent;
use std::fmt::Write;

fn per_device(rows: &[Row]) -> impl Iterator<Item = (&Row, &Measured)> {
    rows.iter().flat_map(|row| row.devices.iter().map(move |device| (row, device)))
}

/// Time, memory and cost.
pub(crate) fn spine(rows: &[Row]) -> String {
    let mut text = "| scene | triangles | device | LBVH ms | PRBVH ms | iterations | ms/iteration | M triangles/s (LBVH) | \
                    M triangles/s (whole) | bytes/node | peak bytes/triangle | LBVH cost | PRBVH cost | ratio | tree hash |\n\
                    |---|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|---|\n"
        .to_owned();
    for (row, m) in per_device(rows) {
        let n = row.triangles as f64;
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.1} | {:.1} | {} | {:.2} | {:.2} | {:.3} | {:.1} | {:.0} | {:.3} | {:.3} | {:.3} | {} |",
            row.scene,
            row.triangles,
            m.device,
            m.build_s * 1e3,
            m.optimize_s * 1e3,
            m.iterations,
            m.optimize_s * 1e3 / f64::from(m.iterations.max(1)),
            n / m.build_s / 1e6,
            n / (m.build_s + m.optimize_s) / 1e6,
            m.working_bytes as f64 / (2.0 * n - 1.0),
            m.peak_bytes as f64 / n,
            m.initial_cost,
            m.final_cost,
            m.final_cost / m.initial_cost,
            m.tree_hash
        );
    }
    text
}

/// Device milliseconds by stage.
pub(crate) fn phases(rows: &[Row]) -> String {
    let mut text = "| scene | device | device ms by stage |\n|---|---|---|\n".to_owned();
    for (row, m) in per_device(rows) {
        let phases: Vec<String> = m.phases.iter().map(|(label, s)| format!("{label} {:.1}", s * 1e3)).collect();
        let _ = writeln!(text, "| {} | {} | {} |", row.scene, m.device, phases.join(", "));
    }
    text
}

/// The CPU device beside obvhs.
pub(crate) fn peers(rows: &[Row]) -> String {
    let mut text = "| scene | LBVH ÷ PLOC time | obvhs PLOC ms | PLOC cost | obvhs best cost | PRBVH ÷ obvhs best | obvhs settings: \
                    s, cost |\n|---|--:|--:|--:|--:|--:|---|\n"
        .to_owned();
    for row in rows {
        let (Some(peer), Some(ours)) = (&row.obvhs, row.devices.first()) else { continue };
        let settings: Vec<String> =
            peer.reinsertion.iter().map(|(setting, s, cost)| format!("{setting}: {s:.3}, {cost:.3}")).collect();
        let _ = writeln!(
            text,
            "| {} | {:.2} | {:.1} | {:.3} | {:.3} | {:.4} | {} |",
            row.scene,
            ours.build_s / peer.ploc_s,
            peer.ploc_s * 1e3,
            peer.ploc_cost,
            peer.best_cost(),
            ours.final_cost / peer.best_cost(),
            settings.join("; ")
        );
    }
    text
}

/// Exponents of time against triangles.
pub(crate) fn growth(rows: &[Row]) -> String {
    let mut text = String::new();
    let names: Vec<&String> =
        rows.first().map(|row| row.devices.iter().map(|m| &m.device).collect()).unwrap_or_default();
    for name in names {
        let fit = |time: fn(&Measured) -> f64| {
            let points: Vec<(f64, f64)> = per_device(rows)
                .filter(|(_, m)| m.device == *name)
                .map(|(row, m)| (row.triangles as f64, time(m)))
                .collect();
            number(exponent(&points), 2)
        };
        let _ = writeln!(
            text,
            "growth of time with triangles on {name}: LBVH n^{}, PRBVH n^{}, PRBVH iteration n^{}",
            fit(|m| m.build_s),
            fit(|m| m.optimize_s),
            fit(|m| m.optimize_s / f64::from(m.iterations.max(1)))
        );
    }
    text
}

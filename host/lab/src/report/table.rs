//! The table on the terminal.

use super::RunReport;
use crate::plan::items;
use crate::terminal::{NARROWEST, empty, right};
use comfy_table::{Cell, ColumnConstraint, Table, Width};
use prbvh::format;
use prbvh::plan::Status;

/// The outcome of a run, what it left out, and its phases, at most `width` columns wide (30 at least). Ends with a line end.
#[must_use]
pub fn table(report: &RunReport, width: u16) -> String {
    let width = width.max(NARROWEST);
    let mut text = outcome(report, width).trim_fmt();
    text.push('\n');
    let left_out: Vec<_> = report.plan_items.iter().filter(|item| item.status == Status::LeftOut).cloned().collect();
    if !left_out.is_empty() {
        text.push_str(&items(&left_out, width).trim_fmt());
        text.push('\n');
    }
    if !report.phases.is_empty() {
        text.push_str(&phases(report, width).trim_fmt());
        text.push('\n');
    }
    text
}

fn outcome(report: &RunReport, width: u16) -> Table {
    let mut table = empty(width);
    let ratio = report.final_cost / report.initial_cost;
    let cost = |cost: f64| format!("{cost:.3}");
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    row("scene", report.scene.clone());
    row("triangles", format::count(report.triangles.into()));
    if let Some(splits) = &report.splits {
        let ratio = f64::from(report.references) / f64::from(report.triangles.max(1));
        let (references, merged) = (format::count(report.references.into()), format::count(splits.merged.into()));
        row("references", format!("{references} ({ratio:.3} per triangle, {merged} merged)"));
    }
    row("device", report.device.clone());
    row("initial cost", format!("{} ({})", cost(report.initial_cost), report.settings.run.initial));
    row("final cost", format!("{} ({})", cost(report.final_cost), report.settings.run.optimizer));
    if ratio.is_finite() {
        row("final / initial", format!("{ratio:.4}"));
    }
    if let Some(adaptive) = report.adaptive_cost {
        row("adaptive cost", format!("{} ({} leaves)", cost(adaptive), format::count(report.leaves.into())));
    }
    if let (Some(wide), Some(settings)) = (&report.wide, &report.settings.run.wide) {
        let children = format!("{} of {}", settings.layout, settings.width);
        let per_triangle = format::significant(wide.bytes_per_triangle);
        row("wide cost", format!("{} ({children}, {per_triangle} B per triangle)", cost(wide.quality.sah_cost)));
    }
    if let Some(reference) = report.reference.as_ref().filter(|reference| reference.final_error > 0.0) {
        let error = 100.0 * reference.final_error;
        row("above the best known", format!("{error:.3} % ({})", cost(reference.reference_cost)));
    }
    row("iterations", format::count(report.iterations.into()));
    row("build time", format::seconds(report.build_s));
    row("optimise time", format::seconds(report.time_s));
    let memory = &report.memory;
    let per_triangle = format::significant(memory.bytes_per_triangle);
    row("device memory", format!("{} ({per_triangle} B per triangle)", format::bytes(memory.peak_bytes)));
    let quality = &report.quality;
    row("device code", report.code.to_string());
    row("depth", format!("{} (initially {})", quality.last.max_depth, quality.initial.max_depth));
    if let Some(bound) = &report.bound {
        row("bounded to", format!("{}: {bound}", bound.max_depth));
    }
    row("stopped", report.stop_reason.clone());
    row("tree hash", report.tree_hash.clone());
    table
}

fn phases(report: &RunReport, width: u16) -> Table {
    let mut table = empty(width);
    table.set_header([Cell::new("phase"), right("time"), right("calls"), right("share")]);
    for phase in &report.phases {
        table.add_row([
            Cell::new(&phase.label),
            right(&format::seconds(phase.seconds)),
            right(&format::count(phase.calls)),
            right(&format!("{:.1} %", phase.share * 100.0)),
        ]);
    }
    // A name may break; a number may not.
    for column in table.column_iter_mut().skip(1) {
        column.set_constraint(ColumnConstraint::ContentWidth);
    }
    if let Some(names) = table.column_mut(0) {
        names.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(8)));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::super::testing::report;
    use super::*;
    use prbvh::bvh::DepthBound;

    fn widest(text: &str) -> usize {
        text.lines().map(|line| line.chars().count()).max().unwrap()
    }

    #[test]
    fn what_matters_is_there() {
        let report = report(40);
        let text = table(&report, 100);
        for part in [
            "sponza_crytek",
            "262,267",
            "312.500",
            "0.6",
            "40",
            &report.tree_hash,
            "search",
            "80.0 %",
            "B per triangle",
            "17 of 49 kernels",
            "30 bits tell all triangles apart",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
        assert!(text.contains(&report.stop_reason) && text.ends_with('\n'));
    }

    #[test]
    fn a_bound_on_the_depth_is_told_where_it_changed_something() {
        let mut report = report(4);
        assert!(!table(&report, 100).contains("bounded"));
        report.bound = Some(
            serde_json::from_value::<DepthBound>(serde_json::json!({
                "max_depth": 63,
                "depth_before": 109,
                "depth_after": 62,
                "cost_before": 5.0,
                "cost_after": 5.25,
                "subtrees": 3,
                "nodes": 90
            }))
            .unwrap(),
        );
        let text = table(&report, 200);
        for part in ["bounded to", "63: depth 109 to 62, 3 subtrees built anew, SAH cost 5.000 to 5.250 (+5.00 %)"] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
        assert!(widest(&table(&report, 60)) <= 60);
    }

    #[test]
    fn it_fits_the_terminal() {
        let mut report = report(40);
        report.device = "A device whose maker likes to put everything into its name (TM) 9000 Max-Q".to_owned();
        for width in [40, 60, 80, 200] {
            let text = table(&report, width);
            assert!(widest(&text) <= width as usize, "{width} columns:\n{text}");
        }
        let narrow = table(&report, 40);
        for number in ["262,267", "312.500", "80.0 %"] {
            assert!(narrow.contains(number), "{number} is broken in\n{narrow}");
        }
        assert!(widest(&table(&report, 0)) <= 40);
    }

    #[test]
    fn a_device_without_phases_has_one_table() {
        let mut report = report(0);
        report.phases.clear();
        assert!(!table(&report, 80).contains("share"));
    }
}

//! A plan on the terminal.

use crate::terminal::{empty, right};
use comfy_table::{Cell, Table};
use prbvh::format;
use prbvh::plan::{Item, Plan};
use prbvh::scene::Census;

/// The census, the phases and the decisions, at most `width` columns wide. `duplicate_boxes` is what [`prbvh::scene::duplicate_boxes`] counts.
#[must_use]
pub fn table(census: &Census, duplicate_boxes: usize, plan: &Plan, width: u16) -> String {
    let tables = [of_census(census, duplicate_boxes, width), of_phases(plan, width), items(&plan.items, width)];
    let mut text = tables.iter().map(Table::trim_fmt).collect::<Vec<_>>().join("\n");
    text.push_str(&format!("\nbuffers left out: {}; device code: {}", format::bytes(plan.bytes_left_out()), plan.code));
    text
}

fn of_census(census: &Census, duplicate_boxes: usize, width: u16) -> Table {
    let mut table = empty(width);
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    let count = |value: usize| format::count(value as u64);
    let number = |value: f64| {
        if value == 0.0 || (1e-3..1e6).contains(&value) { format::significant(value) } else { format!("{value:.2e}") }
    };
    row("triangles", count(census.triangles));
    row("without area", count(census.zero_area));
    row("duplicates", format!("{}, with equal boxes {}", count(census.duplicates), count(duplicate_boxes)));
    row("extent x, y, z", census.extent.map(number).join(", "));
    let flat: Vec<&str> =
        ["x", "y", "z"].into_iter().zip(census.flat_axes).filter(|(_, flat)| *flat).map(|(name, _)| name).collect();
    row("flat axes", if flat.is_empty() { "none".to_owned() } else { flat.join(", ") });
    row("ratio of extents", number(census.extent_ratio));
    row("decades of extents", format!("{:.1}", census.extent_decades()));
    row("decades of areas", format!("{:.1}", census.area_decades()));
    table
}

fn of_phases(plan: &Plan, width: u16) -> Table {
    let mut table = empty(width);
    table.set_header([
        Cell::new("phase"),
        Cell::new("runs"),
        right("peak"),
        right("B per triangle"),
        right("largest buffer"),
    ]);
    for phase in &plan.phases {
        let per_triangle = phase.peak_bytes as f64 / plan.triangles.max(1) as f64;
        table.add_row([
            Cell::new(&phase.phase),
            Cell::new(if phase.runs { "yes" } else { "no" }),
            right(&format::bytes(phase.peak_bytes)),
            right(&format::significant(per_triangle)),
            right(&format!("{}, {}", phase.largest_buffer, format::bytes(phase.largest_buffer_bytes))),
        ]);
    }
    table
}

/// Decisions, at most `width` columns wide.
pub(crate) fn items(items: &[Item], width: u16) -> Table {
    let mut table = empty(width);
    table.set_header(["", "what", "why", "saves"]);
    for item in items {
        table.add_row([item.status.to_string(), item.what.clone(), item.why.clone(), item.saved.to_string()]);
    }
    table
}

//! The table as text.

use super::{Case, Method, Row};
use comfy_table::{Cell, CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

const STYLE: TableStyle = TableStyle::new().top_border(LINE).header_separator(LINE).bottom_border(LINE);
const LINE: LineStyle = LineStyle::none().fill('─').junction('─');

/// What stands for a number that there is not.
const NONE: &str = "-";

/// A line per row, as wide as it takes; ends with a line end.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    let mut table = Table::new();
    table.load_style(STYLE).set_content_arrangement(ContentArrangement::Disabled);
    let names = ["case", "method", "device", "valid", "finite"].map(Cell::new).into_iter();
    let numbers = ["iter.", "cost before", "after", "f32 error", "depth"].map(|name| right(name.to_owned()));
    table.set_header(names.chain(numbers).chain(["same", "verdict"].map(Cell::new)));
    for row in rows {
        let yes = |is: bool| Cell::new(if is { "yes" } else { "NO" });
        let cost = |cost: Option<f64>| right(cost.map_or_else(|| NONE.to_owned(), |cost| format!("{cost:.3}")));
        table.add_row([
            Cell::new(&row.case),
            Cell::new(&row.method),
            Cell::new(&row.device),
            yes(row.valid),
            yes(row.finite),
            right(if row.stop.is_empty() { NONE.to_owned() } else { row.iterations.to_string() }),
            cost(row.cost_before),
            cost(row.cost_after),
            right(row.f32_error.map_or_else(|| NONE.to_owned(), |error| format!("{error:.1e}"))),
            right(row.depth.map_or_else(|| NONE.to_owned(), |depth| depth.to_string())),
            row.same_hash.map_or_else(|| Cell::new(NONE), yes),
            Cell::new(verdict(row)),
        ]);
    }
    format!("{}\n", table.trim_fmt())
}

fn verdict(row: &Row) -> String {
    if row.is_green() {
        return "ok".to_owned();
    }
    let mut properties: Vec<String> = row.breaches.iter().map(|breach| breach.property.to_string()).collect();
    properties.dedup();
    format!("RED: {}", properties.join(", "))
}

/// What is wrong, a line per breach, and how many rows there are; ends with a line end.
#[must_use]
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        for breach in &row.breaches {
            let Row { case, method, device, .. } = row;
            text += &format!("{case}, {method}, {device}: {}: {}\n", breach.property, breach.what);
        }
    }
    let red = rows.iter().filter(|row| !row.is_green()).count();
    text + &format!("{} rows, {red} red\n", rows.len())
}

/// The catalogue and the methods; ends with a line end.
#[must_use]
pub fn listing(cases: &[Case], methods: &[Method], full: bool) -> String {
    let mut table = Table::new();
    table.load_style(STYLE).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(["case", "triangles", "what can go wrong"]);
    for case in cases {
        table.add_row([case.name.to_owned(), case.triangles(full).len().to_string(), case.purpose.to_owned()]);
    }
    let names: Vec<&str> = methods.iter().map(|method| method.name).collect();
    format!("{}\nmethods: {}\n", table.trim_fmt(), names.join(", "))
}

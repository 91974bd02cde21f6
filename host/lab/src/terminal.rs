//! What all tables on the terminal share.

use comfy_table::{Cell, CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

/// Narrowest table that still reads.
pub(crate) const NARROWEST: u16 = 30;

/// Lines above, below and under the header only.
pub(crate) const STYLE: TableStyle = TableStyle::new().top_border(LINE).header_separator(LINE).bottom_border(LINE);
const LINE: LineStyle = LineStyle::none().fill('─').junction('─');

/// A cell of a column of numbers.
pub(crate) fn right(text: &str) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

/// No rows yet, in the style of all tables.
pub(crate) fn empty(width: u16) -> Table {
    let width = width.max(NARROWEST);
    let mut table = Table::new();
    table.load_style(STYLE).set_content_arrangement(ContentArrangement::Dynamic).set_width(width);
    table
}

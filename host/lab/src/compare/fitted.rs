//! A table that fits a terminal by leaving columns out.

use comfy_table::{Cell, CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

/// Lines above, below and under the header only.
const STYLE: TableStyle = TableStyle::new().top_border(LINE).header_separator(LINE).bottom_border(LINE);
const LINE: LineStyle = LineStyle::none().fill('─').junction('─');

/// A column. Where there is no room for all, those of the highest rank go first.
pub(super) struct Fitted {
    pub(super) header: String,
    pub(super) rank: u32,
    pub(super) is_text: bool,
    /// A row each.
    pub(super) cells: Vec<String>,
}

impl Fitted {
    /// Columns of the terminal that it takes, with its padding and the gap before the next.
    fn wide(&self) -> usize {
        let texts = self.cells.iter().chain([&self.header]);
        texts.map(|text| text.chars().count()).max().unwrap_or(0) + 3
    }

    fn cell(&self, text: &str) -> Cell {
        Cell::new(text).set_alignment(if self.is_text { CellAlignment::Left } else { CellAlignment::Right })
    }
}

/// The table, at most `width` columns wide where two columns fit into that, and the headers of what was left out.
pub(super) fn fitted(mut columns: Vec<Fitted>, width: u16) -> (String, Vec<String>) {
    let shown: Vec<String> = columns.iter().map(|column| column.header.clone()).collect();
    while columns.iter().map(Fitted::wide).sum::<usize>() > usize::from(width) && columns.len() > 2 {
        let last = (0..columns.len()).max_by_key(|&k| columns[k].rank).unwrap_or(0);
        columns.remove(last);
    }
    let is_left_out = |header: &String| columns.iter().all(|column| column.header != *header);
    let left_out = shown.into_iter().filter(is_left_out).collect();
    let mut table = Table::new();
    table.load_style(STYLE).set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(columns.iter().map(|column| column.cell(&column.header)));
    for k in 0..columns.first().map_or(0, |column| column.cells.len()) {
        table.add_row(columns.iter().map(|column| column.cell(&column.cells[k])));
    }
    (table.trim_fmt(), left_out)
}

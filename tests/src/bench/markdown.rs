//! Tables as Markdown.

use std::fmt::Write;

/// A table under construction.
#[derive(Clone, Debug)]
pub struct Markdown {
    text: String,
    columns: usize,
}

impl Markdown {
    /// A table with these headers; a header that starts with `<` is of a column of texts, the others are right-aligned.
    #[must_use]
    pub fn new(headers: &[&str]) -> Self {
        let mut text = String::from("|");
        for header in headers {
            let _ = write!(text, " {} |", header.trim_start_matches('<'));
        }
        text.push_str("\n|");
        for header in headers {
            text.push_str(if header.starts_with('<') { "---|" } else { "--:|" });
        }
        text.push('\n');
        Self { text, columns: headers.len() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it has not a cell for each column.
    pub fn row(&mut self, cells: &[String]) {
        assert_eq!(cells.len(), self.columns, "{cells:?}");
        let _ = writeln!(self.text, "| {} |", cells.join(" | "));
    }

    /// The table.
    #[must_use]
    pub fn finish(self) -> String {
        self.text
    }
}

/// The value with so many digits after the point; `—` for none and for what is no number.
#[must_use]
pub fn number(value: impl Into<Option<f64>>, digits: usize) -> String {
    match value.into() {
        Some(value) if value.is_finite() => format!("{value:.digits$}"),
        _ => "—".to_owned(),
    }
}

/// Seconds as milliseconds, with three digits at least.
#[must_use]
pub fn ms(seconds: impl Into<Option<f64>>) -> String {
    let scaled = seconds.into().map(|seconds| seconds * 1e3);
    let digits = match scaled {
        Some(ms) if ms < 10.0 => 2,
        Some(ms) if ms < 100.0 => 1,
        _ => 0,
    };
    number(scaled, digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_its_columns() {
        let mut table = Markdown::new(&["<scene", "ms"]);
        table.row(&["hall".to_owned(), ms(0.0123)]);
        assert_eq!(table.finish(), "| scene | ms |\n|---|--:|\n| hall | 12.3 |\n");
    }

    #[test]
    #[should_panic(expected = "one")]
    fn a_missing_cell_is_refused() {
        Markdown::new(&["a", "b"]).row(&["one".to_owned()]);
    }

    #[test]
    fn what_is_not_there_is_a_dash() {
        assert_eq!([number(None, 2), number(f64::NAN, 2), ms(f64::INFINITY), ms(None)], ["—"; 4]);
        assert_eq!([number(1.005, 1), ms(0.001_234), ms(1.5)], ["1.0", "1.23", "1500"]);
    }
}

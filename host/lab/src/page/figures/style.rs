//! What tells series apart, in colour and without: dashes, marks, and colours that keep apart for the colour-blind.

use serde::Serialize;

/// Dark enough to be read as ink on white (after Okabe & Ito 2008).
const COLOURS: [&str; 7] = ["#000000", "#0060a0", "#b34a00", "#007a5a", "#8c3d78", "#5a5a5a", "#7a5c00"];
/// Lengths of dashes and gaps, pixels; none: solid.
const DASHES: [&[u32]; 5] = [&[], &[12, 5], &[3, 5], &[14, 5, 3, 5], &[7, 4]];
/// Outlines of closed marks about (0, 0), pixels: circle, square, triangle, diamond, triangle.
const CLOSED: [&str; 5] = [
    "M-7 0a7 7 0 1 0 14 0a7 7 0 1 0 -14 0Z",
    "M-6.3 -6.3L6.3 -6.3L6.3 6.3L-6.3 6.3Z",
    "M0 -8L7.7 6L-7.7 6Z",
    "M0 -9L9 0L0 9L-9 0Z",
    "M0 8L7.7 -6L-7.7 -6Z",
];
const CROSS: &str = "M-7 -7L7 7M-7 7L7 -7";
const PLUS: &str = "M-8.4 0L8.4 0M0 -8.4L0 8.4";
const DOT: &str = "M-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0Z";

/// Look of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Look {
    /// Of line, mark and name, as in CSS.
    pub colour: &'static str,
    /// Lengths of dashes and gaps of the line, pixels; none: solid.
    pub dashes: &'static [u32],
    /// Outline of the mark about (0, 0) as an SVG path, pixels; empty: none.
    pub mark: &'static str,
    /// Width of the mark, pixels.
    pub size: u32,
    /// Whether the mark is white inside.
    pub hollow: bool,
}

impl Look {
    /// A line alone, under marks of other series.
    pub(super) const LINE: Self = Self { colour: COLOURS[0], dashes: DASHES[0], mark: "", size: 14, hollow: false };
    /// For points without a name of their own.
    pub(super) const DOT: Self = Self { colour: COLOURS[5], dashes: DASHES[0], mark: DOT, size: 8, hollow: true };

    pub(super) fn nth(k: usize) -> Self {
        // Closed marks, a cross, the closed ones again but hollow, a plus.
        let at = k % 12;
        let mark = match at {
            5 => CROSS,
            11 => PLUS,
            _ => CLOSED[at % 6],
        };
        Self { colour: COLOURS[k % COLOURS.len()], dashes: DASHES[k % DASHES.len()], mark, size: 14, hollow: at > 5 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_dozen_marks_differ_without_colour() {
        let marks = (0..12).map(Look::nth).map(|look| (look.mark, look.hollow));
        assert_eq!(marks.collect::<BTreeSet<_>>().len(), 12);
    }

    #[test]
    fn dashes_and_colours_repeat_together_late() {
        let looks = (0..35).map(Look::nth).map(|look| (look.colour, look.dashes));
        assert_eq!(looks.collect::<BTreeSet<_>>().len(), 35);
    }
}

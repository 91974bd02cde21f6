//! What tells curves apart, in colour and without: dashes, marks, and colours that keep apart for the colour-blind.

use std::fmt::Write;

/// Dark enough to be read as ink on white (after Okabe & Ito 2008).
const COLOURS: [&str; 7] = ["#000000", "#0060a0", "#b34a00", "#007a5a", "#8c3d78", "#5a5a5a", "#7a5c00"];
const DASHES: [&str; 5] = ["", "12 5", "3 5", "14 5 3 5", "7 4"];
const MARKS: usize = 12;

/// Look of a curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style(pub(super) usize);

impl Style {
    pub(super) fn colour(self) -> &'static str {
        COLOURS[self.0 % COLOURS.len()]
    }

    /// Pattern of `stroke-dasharray`; empty: solid.
    pub(super) fn dashes(self) -> &'static str {
        DASHES[self.0 % DASHES.len()]
    }

    /// A mark of about `2 r` pixels at (x, y), as an SVG element.
    pub(super) fn mark(self, out: &mut String, x: f64, y: f64, r: f64) {
        let d = match self.0 % MARKS {
            0 | 6 => format!("M{:.1} {y:.1}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 -{} 0Z", x - r, 2.0 * r, 2.0 * r),
            1 | 7 => {
                let r = 0.9 * r;
                polygon(&[(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)])
            }
            2 | 8 => polygon(&[(x, y - 1.2 * r), (x + 1.1 * r, y + 0.8 * r), (x - 1.1 * r, y + 0.8 * r)]),
            3 | 9 => polygon(&[(x, y - 1.3 * r), (x + 1.3 * r, y), (x, y + 1.3 * r), (x - 1.3 * r, y)]),
            4 | 10 => polygon(&[(x, y + 1.2 * r), (x + 1.1 * r, y - 0.8 * r), (x - 1.1 * r, y - 0.8 * r)]),
            5 => cross(&[(x - r, y - r, x + r, y + r), (x - r, y + r, x + r, y - r)]),
            _ => cross(&[(x - 1.2 * r, y, x + 1.2 * r, y), (x, y - 1.2 * r, x, y + 1.2 * r)]),
        };
        let colour = self.colour();
        let fill = if self.0 % MARKS < 5 { colour } else { "#ffffff" };
        let _ = write!(out, r#"<path d="{d}" fill="{fill}" stroke="{colour}" stroke-width="2"/>"#);
    }
}

fn polygon(corners: &[(f64, f64)]) -> String {
    let mut d = String::new();
    for (k, (x, y)) in corners.iter().enumerate() {
        let _ = write!(d, "{}{x:.1} {y:.1}", if k == 0 { 'M' } else { 'L' });
    }
    d.push('Z');
    d
}

fn cross(lines: &[(f64, f64, f64, f64)]) -> String {
    lines.iter().map(|(x0, y0, x1, y1)| format!("M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Without colours, and moved to the same place, no two of the first dozen look alike.
    #[test]
    fn a_dozen_marks_differ_without_colour() {
        let look = |k: usize| {
            let mut svg = String::new();
            Style(k).mark(&mut svg, 10.0, 10.0, 5.0);
            let hollow = svg.contains("#ffffff");
            (svg.split('"').nth(1).unwrap_or_default().to_owned(), hollow)
        };
        assert_eq!((0..12).map(look).collect::<BTreeSet<_>>().len(), 12);
    }

    #[test]
    fn dashes_and_colours_repeat_together_late() {
        let looks: BTreeSet<_> = (0..35).map(|k| (Style(k).colour(), Style(k).dashes())).collect();
        assert_eq!(looks.len(), 35);
    }
}

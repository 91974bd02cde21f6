//! Text in SVG: fonts by family and size alone, and nothing that could be taken for markup.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A size of the system's sans-serif font, and its ink.
#[derive(Clone, Copy, Debug)]
pub(super) struct Font {
    size: i32,
    ink: RGBColor,
}

impl Font {
    pub(super) const TITLE: Self = Self { size: 34, ink: BLACK };
    pub(super) const PANEL: Self = Self { size: 26, ink: BLACK };
    pub(super) const TEXT: Self = Self { size: 23, ink: BLACK };
    pub(super) const NOTE: Self = Self { size: 22, ink: RGBColor(80, 80, 80) };

    pub(super) fn style(self) -> TextStyle<'static> {
        ("sans-serif", self.size).into_font().color(&self.ink)
    }

    /// Below and to the right of the point that it is drawn at.
    pub(super) fn left(self) -> TextStyle<'static> {
        self.style().pos(Pos::new(HPos::Left, VPos::Top))
    }

    /// To the left of the point, in the middle of its height.
    pub(super) fn right(self) -> TextStyle<'static> {
        self.style().pos(Pos::new(HPos::Right, VPos::Center))
    }

    /// To the right of the point, in the middle of its height.
    pub(super) fn middle(self) -> TextStyle<'static> {
        self.style().pos(Pos::new(HPos::Left, VPos::Center))
    }

    /// `font-size` in the file, pixels; the drawing library divides by as much.
    pub(super) fn pixels(self) -> f64 {
        f64::from(self.size) / 1.24
    }

    /// About the width of a character, pixels. There is no font to measure: this is wide for most.
    pub(super) fn advance(self) -> f64 {
        0.59 * self.pixels()
    }
}

/// The text without characters that XML does not allow, such as a file's name may have.
pub(super) fn clean(text: &str) -> String {
    text.chars().map(|c| if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { '\u{fffd}' } else { c }).collect()
}

/// As [`clean`], for between tags and in attributes.
pub(super) fn escaped(text: &str) -> String {
    clean(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The drawn picture with its title and description, and a layer over it.
pub(super) fn finished(drawn: &str, title: &str, description: &str, layer: &str) -> String {
    let (open, body) = drawn.split_at(drawn.find('>').map_or(0, |end| end + 1));
    let body = body.trim_end().strip_suffix("</svg>").unwrap_or(body);
    let open = open.replacen("<svg ", r#"<svg role="img" "#, 1);
    format!("{open}\n<title>{}</title>\n<desc>{}</desc>{body}{layer}\n</svg>\n", escaped(title), escaped(description))
}

//! Horizontal bars: rows of the same names, a column per run.

use super::chart::WIDTH;
use super::svg::{self, Font};
use super::{Figure, Hover, HoverPoint, Value};
use crate::report::plot::PlotError;
use plotters::prelude::*;
use prbvh::format;

const ROW: i32 = 32;
const HEAD: i32 = 104;
const COLUMN_HEAD: i32 = 44;
const GAP: i32 = 30;
/// Room of the text after a bar, pixels.
const TEXT: f64 = 150.0;
const INK: RGBColor = RGBColor(70, 70, 70);

/// A figure of bars before it is drawn.
#[derive(Debug)]
pub(super) struct Bars {
    pub(super) name: &'static str,
    pub(super) heading: String,
    pub(super) subject: String,
    pub(super) caption: String,
    pub(super) columns: &'static [&'static str],
    /// From top to bottom; the columns of a block have bars of the same names.
    pub(super) blocks: Vec<Vec<Column>>,
}

/// The bars of a run.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) bars: Vec<Bar>,
}

/// A bar.
#[derive(Debug)]
pub(super) struct Bar {
    pub(super) name: String,
    pub(super) value: f64,
    pub(super) text: String,
    pub(super) values: Vec<Value>,
}

type Failure = Box<dyn std::error::Error>;

impl Bars {
    /// Draws it. None without a bar.
    ///
    /// # Errors
    /// If the drawing library fails.
    pub(super) fn draw(self) -> Result<Option<Figure>, PlotError> {
        if self.blocks.is_empty() {
            return Ok(None);
        }
        let mut text = String::new();
        let curves = self.picture(&mut text).map_err(|error| PlotError(error.to_string()))?;
        let title = format!("{}: {}", self.subject, self.heading);
        Ok(Some(Figure {
            name: self.name.to_owned(),
            svg: svg::finished(&text, &title, &self.caption, ""),
            title: self.heading,
            caption: self.caption,
            columns: self.columns.iter().map(|&column| column.to_owned()).collect(),
            curves,
        }))
    }

    fn picture(&self, text: &mut String) -> Result<Vec<Hover>, Failure> {
        let rows = |block: &Vec<Column>| block.first().map_or(0, |column| column.bars.len() as i32);
        let height = HEAD + self.blocks.iter().map(|block| COLUMN_HEAD + ROW * rows(block) + GAP).sum::<i32>();
        let root = SVGBackend::with_string(text, (WIDTH, height as u32)).into_drawing_area();
        root.fill(&WHITE)?;
        root.draw_text(&svg::clean(&format::shortened(&self.heading, 80)), &Font::TITLE.left(), (40, 20))?;
        root.draw_text(&svg::clean(&format::shortened(&self.subject, 110)), &Font::NOTE.left(), (40, 62))?;
        let names = self.blocks.iter().flatten().flat_map(|column| &column.bars).map(|bar| bar.name.chars().count());
        let left = 40.0 + names.max().unwrap_or(0).min(30) as f64 * Font::TEXT.advance() + 16.0;
        let widest = self.blocks.iter().map(Vec::len).max().unwrap_or(1).max(2) as f64;
        let step = (f64::from(WIDTH) - 30.0 - left) / widest;
        let mut top = HEAD;
        let mut hovers = Vec::new();
        for block in &self.blocks {
            let most = block.iter().flat_map(|column| &column.bars).map(|bar| bar.value).fold(0.0, f64::max);
            let bars = block.first().map_or(&[][..], |column| &column.bars);
            for (row, bar) in (0..).zip(bars) {
                let at = (left as i32 - 12, top + COLUMN_HEAD + row * ROW + ROW / 2);
                root.draw_text(&svg::clean(&format::shortened(&bar.name, 30)), &Font::TEXT.right(), at)?;
            }
            for (k, column) in block.iter().enumerate() {
                let x = left + step * k as f64;
                // Wide letters fit too.
                let room = (step / Font::TEXT.advance()) as usize;
                let head = svg::clean(&format::shortened(&column.name, room));
                root.draw_text(&head, &Font::TEXT.left(), (x as i32, top + 6))?;
                let scale = if most > 0.0 { (step - TEXT - 24.0) / most } else { 0.0 };
                let mut points = Vec::new();
                for (row, bar) in (0..).zip(&column.bars) {
                    let y = top + COLUMN_HEAD + row * ROW;
                    let end = x + (scale * bar.value).max(1.0);
                    let corners = [(x as i32, y + 5), (end.ceil() as i32, y + ROW - 5)];
                    root.draw(&Rectangle::new(corners, INK.filled()))?;
                    root.draw_text(&bar.text, &Font::NOTE.middle(), (end as i32 + 8, y + ROW / 2))?;
                    points.push(HoverPoint::new(end, f64::from(y + ROW / 2), &bar.values));
                }
                hovers.extend(
                    column
                        .bars
                        .iter()
                        .zip(points)
                        .map(|(bar, point)| Hover { name: bar.name.clone(), points: vec![point] }),
                );
            }
            top += COLUMN_HEAD + ROW * rows(block) + GAP;
        }
        root.present()?;
        Ok(hovers)
    }
}

//! The chart that all figures but the bars are made of: panels of named curves on axes.
//!
//! Axes are drawn by plotters. The curves are a layer of our own over them: one SVG element per curve with its pattern of dashes and its
//! title, where the library would cut every dash into an element.

use super::Figure;
use super::layer;
use super::panel::{Names, Panel, Place};
use super::svg::{self, Font};
use super::ticks::{Tick, Ticked, ticks};
use crate::report::plot::PlotError;
use plotters::coord::Shift;
use plotters::prelude::*;
use prbvh::format;

/// Pixels. Coordinates of the drawing library are whole, so the picture is large; it is scaled where it is shown.
pub(super) const WIDTH: u32 = 1600;
const GRID: RGBColor = RGBColor(222, 222, 222);
/// Room for the title above and the notes below.
const HEAD: u32 = 96;
const FOOT: u32 = 44;

/// A figure before it is drawn.
#[derive(Debug)]
pub(super) struct Chart {
    /// Part of its file's name.
    pub(super) name: &'static str,
    /// What it shows.
    pub(super) heading: String,
    /// Of what: scene and triangles, for one.
    pub(super) subject: String,
    /// How to read it, a sentence or two for the page.
    pub(super) caption: String,
    /// A line inside the picture.
    pub(super) note: String,
    /// Pixels.
    pub(super) height: u32,
    /// Names of the values of every point.
    pub(super) columns: &'static [&'static str],
    /// From left to right.
    pub(super) panels: Vec<Panel>,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failure = Box<dyn std::error::Error>;

impl Chart {
    /// Draws it. None if there is no point to draw.
    ///
    /// # Errors
    /// If the drawing library fails.
    pub(super) fn draw(mut self) -> Result<Option<Figure>, PlotError> {
        for panel in &mut self.panels {
            for curve in &mut panel.curves {
                curve.points.retain(|point| point.x.is_finite() && point.y.is_finite());
            }
            panel.curves.retain(|curve| !curve.points.is_empty());
        }
        self.panels.retain(|panel| !panel.curves.is_empty());
        if self.panels.is_empty() {
            return Ok(None);
        }
        let mut text = String::new();
        let places = self.axes(&mut text).map_err(|error| PlotError(error.to_string()))?;
        let mut marks = String::new();
        let mut curves = Vec::new();
        for (panel, place) in self.panels.iter().zip(&places) {
            curves.extend(layer::draw(panel, place, &mut marks));
        }
        let title = format!("{}: {}", self.subject, self.heading);
        Ok(Some(Figure {
            name: self.name.to_owned(),
            svg: svg::finished(&text, &title, &self.caption, &marks),
            title: self.heading,
            caption: self.caption,
            columns: self.columns.iter().map(|&column| column.to_owned()).collect(),
            curves,
        }))
    }

    /// Everything but the curves. Returns where the panels are.
    fn axes(&self, text: &mut String) -> Result<Vec<Place>, Failure> {
        let root = SVGBackend::with_string(text, (WIDTH, self.height)).into_drawing_area();
        root.fill(&WHITE)?;
        root.draw_text(&svg::clean(&format::shortened(&self.heading, 80)), &Font::TITLE.left(), (40, 20))?;
        root.draw_text(&svg::clean(&format::shortened(&self.subject, 110)), &Font::NOTE.left(), (40, 62))?;
        root.draw_text(&svg::clean(&self.all_notes()), &Font::NOTE.left(), (40, self.height as i32 - 36))?;
        let plots = root.margin(HEAD, FOOT, 16, 16).split_evenly((1, self.panels.len()));
        let places = plots.iter().zip(&self.panels).map(|(area, panel)| panel.axes(area)).collect::<Result<_, _>>()?;
        root.present()?;
        Ok(places)
    }

    fn all_notes(&self) -> String {
        let points = || {
            self.panels
                .iter()
                .flat_map(|panel| panel.curves.iter().flat_map(move |c| c.points.iter().map(move |p| (panel, p))))
        };
        let mut notes: Vec<&str> = Vec::new();
        if !self.note.is_empty() {
            notes.push(&self.note);
        }
        if points().any(|(panel, point)| panel.y.clips(point.y)) {
            notes.push("Points at 0 are drawn on the lower edge.");
        }
        if points().any(|(panel, point)| panel.x.clips(point.x)) {
            notes.push("Points at time 0 are drawn on the left edge.");
        }
        notes.join(" ")
    }
}

impl Panel {
    fn axes(&self, area: &Area<'_>) -> Result<Place, Failure> {
        let (wide, high) = area.dim_in_pixel();
        let longest = |ticks: &[Tick]| ticks.iter().map(|tick| tick.text.chars().count()).max().unwrap_or(0);
        let y_ticks = self.y_ticks.clone().unwrap_or_else(|| ticks(&self.y, (high / 70) as usize));
        let x_ticks = self.x_ticks.clone().unwrap_or_else(|| ticks(&self.x, (wide / 130) as usize));
        let left = (longest(&y_ticks) as f64 * Font::TEXT.advance()).min(0.4 * f64::from(wide)) as u32 + 56;
        let room = match self.names {
            Names::Listed => layer::LIST,
            Names::Beside if wide > WIDTH / 2 => 170,
            Names::Beside => 100,
        };
        let mut builder = ChartBuilder::on(area);
        builder.margin(14).margin_right(room).x_label_area_size(64).y_label_area_size(left);
        if !self.heading.is_empty() {
            builder.caption(&self.heading, Font::PANEL.style());
        }
        let mut chart = builder.build_cartesian_2d(
            Ticked { range: self.x.range(), ticks: x_ticks },
            Ticked { range: self.y.range(), ticks: y_ticks },
        )?;
        let mut mesh = chart.configure_mesh();
        mesh.light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(BLACK)
            .label_style(Font::TEXT.style())
            .axis_desc_style(Font::TEXT.style())
            .x_desc(&self.x_title);
        if !self.y_title.is_empty() {
            mesh.y_desc(&self.y_title);
        }
        mesh.draw()?;
        let (x, y) = chart.plotting_area().get_pixel_range();
        let plot = [x.start, y.start, x.end, y.end].map(f64::from);
        Ok(Place { plot, right: plot[2] + f64::from(room) })
    }
}

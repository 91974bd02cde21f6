//! The figures of a comparison as SVG: those of Meister & Bittner 2018, for any scene.
//!
//! All are readable in black and white: dashes, marks and names beside the curves; colour is only added.

mod bars;
mod chart;
mod cost;
mod errors;
mod initial;
mod kernels;
mod labels;
mod layer;
mod mu;
mod overview;
mod panel;
mod reinsertions;
mod runs;
mod strategy;
mod style;
mod svg;
mod thin;
mod ticks;

pub use overview::{MethodOverview, Overview, overview, relative_costs};

use crate::compare::SceneComparison;
use crate::report::plot::PlotError;
use serde::Serialize;

/// A drawn figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Short name in lower case with hyphens, for a file.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// The SVG file.
    pub svg: String,
    /// What the values of a point are, with units.
    pub columns: Vec<String>,
    /// Where its points are and what they stand for.
    pub curves: Vec<Hover>,
}

/// The points of a curve as drawn: thinned where many would fall on one another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hover {
    /// Name of the curve.
    pub name: String,
    /// In the order of the curve.
    pub points: Vec<HoverPoint>,
}

/// A point of a figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HoverPoint {
    /// Pixels of the SVG's view box.
    pub x: f64,
    /// Pixels of the SVG's view box.
    pub y: f64,
    /// Values in the order of [`Figure::columns`].
    pub values: Vec<Value>,
}

impl HoverPoint {
    fn new(x: f64, y: f64, values: &[Value]) -> Self {
        // A tenth of a pixel is enough, and so are seven digits: both are short.
        let short = |value: &Value| match value {
            Value::Number(number) => Value::Number(format!("{number:.6e}").parse().unwrap_or(*number)),
            other => other.clone(),
        };
        let tenth = |pixels: f64| (pixels * 10.0).round() / 10.0;
        Self { x: tenth(x), y: tenth(y), values: values.iter().map(short).collect() }
    }
}

/// What is said of a point.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A count.
    Count(u64),
    /// Any other number.
    Number(f64),
    /// A name.
    Text(String),
}

/// The figures of a scene for which there is data, in the order of the paper.
///
/// # Errors
/// If the drawing library fails.
pub fn scene_figures(scene: &SceneComparison) -> Result<Vec<Figure>, PlotError> {
    let figures = [
        cost::figure(scene)?,
        errors::figure(scene)?,
        mu::figure(scene)?,
        strategy::figure(scene)?,
        initial::figure(scene)?,
        reinsertions::figure(scene)?,
        kernels::figure(scene)?,
    ];
    Ok(figures.into_iter().flatten().collect())
}

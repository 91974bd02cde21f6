//! A panel of a chart before it is drawn.

use super::Value;
use super::style::Style;
use super::ticks::Tick;
use crate::report::axis::Axis;

/// Axes and what is on them.
#[derive(Debug)]
pub(super) struct Panel {
    pub(super) heading: String,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) x_title: String,
    pub(super) y_title: String,
    /// Instead of round numbers.
    pub(super) x_ticks: Option<Vec<Tick>>,
    /// Instead of round numbers; they may be long.
    pub(super) y_ticks: Option<Vec<Tick>>,
    pub(super) names: Names,
    pub(super) curves: Vec<Curve>,
}

/// Where the names of the curves stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Names {
    /// At the ends of the curves.
    Beside,
    /// In a list on the right, each with its mark.
    Listed,
}

/// Named points, joined or not.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) name: String,
    pub(super) style: Style,
    pub(super) joined: bool,
    pub(super) points: Vec<Point>,
}

/// A point in the units of the axes, and what is said of it.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) values: Vec<Value>,
}

/// Where a panel is, in pixels of the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The rectangle between the axes.
    pub(super) plot: [f64; 4],
    /// How far names may go to the right.
    pub(super) right: f64,
}

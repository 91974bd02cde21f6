//! The figures of a comparison: those of Meister & Bittner 2018, for any scene.
//!
//! Each is a description ([`Figure`]) of which the page makes a chart and `svg` a file. All are readable in black and white: dashes and
//! marks tell series apart; colour is only added.

mod cost;
mod errors;
mod figure;
mod initial;
mod kernels;
mod mu;
mod overview;
mod reinsertions;
mod runs;
mod starts;
mod strategy;
mod style;
mod svg;
mod thin;

pub use figure::{Figure, Kind, Panel, Point, Scale, Series, Value};
pub use overview::{MethodOverview, Overview, overview, relative_costs};
pub use style::Look;
pub use svg::svg;

use crate::compare::SceneComparison;

/// The figures of a scene for which there is data, in the order of the paper.
#[must_use]
pub fn scene_figures(scene: &SceneComparison) -> Vec<Figure> {
    let figures = [
        cost::figure(scene),
        errors::figure(scene),
        mu::figure(scene),
        strategy::figure(scene),
        initial::figure(scene),
        starts::figure(scene),
        reinsertions::figure(scene),
        kernels::figure(scene),
    ];
    figures.into_iter().flatten().collect()
}

//! Whether splits of a scene's triangles promise anything, before anything runs.

use super::grid::grid_of;
use super::{PresplitForm, PresplitSettings};
use crate::scene::{SafeRange, Scene};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::presplit::priority::{BY_EXTENT, BY_LEVEL, PrioritiesParams, priority};
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// What the boxes of a scene's triangles tell. All areas are half areas over that of the scene's box: of a convex part of it a random ray through the scene meets so many.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct PresplitCensus {
    /// Triangles with a priority.
    pub candidates: usize,
    /// Areas of the boxes beyond those of ever smaller pieces, all triangles: boxes that a random ray meets without need.
    pub excess: f64,
    /// The same of the triangles whose boxes have at least [`LARGE`](Self::LARGE) times the mean area.
    pub excess_of_large: f64,
}

impl PresplitCensus {
    /// Times the mean area from which on a box is large.
    pub const LARGE: f64 = 8.0;

    /// Whether splits are worth more references. Of scenes whose triangles are small and all alike, where they give nothing (docs/splits.md), the large ones had at most 0.11 and all at
    /// most 4.3; of architectural ones the large ones had at least 2.6.
    #[must_use]
    pub fn promises(&self) -> bool {
        const OF_LARGE: f64 = 0.25;
        const OF_ALL: f64 = 8.0;
        self.candidates > 0 && (self.excess_of_large >= OF_LARGE || self.excess >= OF_ALL)
    }

    /// Takes the census of a scene.
    #[must_use]
    pub fn of(scene: &Scene, settings: &PresplitSettings) -> Self {
        let range = SafeRange::of_largest(scene.census.largest_coordinate);
        let corners = Triangle { a: scene.census.min, b: scene.census.max, c: scene.census.max };
        let whole = range.apply(&[corners]).first().map_or(Aabb::EMPTY, Triangle::aabb);
        let params = params(scene.triangles.len(), &whole, settings.form);
        let of_chunk = |triangles: &[Triangle]| {
            let working = range.apply(triangles);
            let candidates = working.iter().filter(|triangle| priority(&params, triangle) > 0.0).count();
            let areas = working.iter().map(|triangle| half_area(&triangle.aabb()));
            (candidates, areas.zip(&working).map(|(area, triangle)| (area, excess(triangle))).collect::<Vec<_>>())
        };
        let chunks: Vec<(usize, Vec<(f64, f64)>)> = scene.triangles.par_chunks(1 << 12).map(of_chunk).collect();
        // In order, so that the sums are the same on any number of threads.
        let boxes = || chunks.iter().flat_map(|(_, boxes)| boxes);
        let mean = boxes().map(|&(area, _)| area).sum::<f64>() / scene.triangles.len() as f64;
        let large = boxes().filter(|&&(area, _)| area >= Self::LARGE * mean);
        let area = half_area(&whole);
        let part = |sum: f64| if area > 0.0 { sum / area } else { 0.0 };
        Self {
            candidates: chunks.iter().map(|(candidates, _)| candidates).sum(),
            excess: part(boxes().map(|&(_, excess)| excess).sum()),
            excess_of_large: part(large.map(|&(_, excess)| excess).sum()),
        }
    }
}

/// Push constants of the priorities of triangles in this box.
pub(super) fn params(triangles: usize, scene: &Aabb, form: PresplitForm) -> PrioritiesParams {
    let form = if form == PresplitForm::Level { BY_LEVEL } else { BY_EXTENT };
    PrioritiesParams { count: u32::try_from(triangles).unwrap_or(u32::MAX), form, grid: grid_of(scene) }
}

fn half_area(aabb: &Aabb) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| f64::from(aabb.max[k]) - f64::from(aabb.min[k]));
    x * y + y * z + z * x
}

/// Half area of the box beyond that of ever smaller pieces.
fn excess(triangle: &Triangle) -> f64 {
    let [u, v] = [triangle.b, triangle.c].map(|to| [0, 1, 2].map(|k| f64::from(to[k]) - f64::from(triangle.a[k])));
    let normal = |k: usize, l: usize| (u[k] * v[l] - u[l] * v[k]).abs();
    (half_area(&triangle.aabb()) - 0.5 * (normal(1, 2) + normal(2, 0) + normal(0, 1))).max(0.0)
}

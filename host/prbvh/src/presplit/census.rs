//! Whether splits of a scene's triangles promise anything, before anything runs.

use super::grid::grid_of;
use super::{PresplitForm, PresplitSettings};
use crate::scene::{SafeRange, Scene};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::presplit::priority::{BY_EXTENT, BY_LEVEL, PrioritiesParams, priority};
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// What the priorities of a scene tell.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct PresplitCensus {
    /// Triangles with a priority.
    pub candidates: usize,
    /// Part of the boxes' areas, of all triangles, that is not needed around ever smaller pieces, over the area of the scene's box: tests that a random ray through it makes for nothing.
    pub excess: f64,
}

/// Boxes of triangles that a random ray meets without need, from which on splits pay.
const LEAST_EXCESS: f64 = 0.0;

impl PresplitCensus {
    /// Whether splits are worth more references.
    #[must_use]
    pub fn promises(&self) -> bool {
        self.candidates > 0 && self.excess >= LEAST_EXCESS
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
            (candidates, working.iter().map(excess).sum::<f64>())
        };
        // In order, so that the sum is the same on any number of threads.
        let chunks: Vec<(usize, f64)> = scene.triangles.par_chunks(1 << 12).map(of_chunk).collect();
        let (candidates, sum) = chunks.iter().fold((0, 0.0), |sum, chunk| (sum.0 + chunk.0, sum.1 + chunk.1));
        let area = half_area(&whole);
        Self { candidates, excess: if area > 0.0 { sum / area } else { 0.0 } }
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

//! How much splits of a triangle promise.
//!
//! Source: Karras & Aila 2013, §4.3, equations 1 and 2. Kind: map.
//!
//! What a split can save is the area of the box beyond that of the boxes of ever smaller pieces: half the sum of the normal's components, all taken positive. The
//! level form halves it with each level of the coarsest plane through the triangle: a plane near the root parts more of a tree. The form of extent and area weighs
//! it by the square of the largest extent. Both take the cube root.

use super::{CELL_BITS, Grid};
use crate::math::{difference_of_products, magnitude, max, reciprocal};
use crate::mem::Slot;
use crate::setup::Triangle;
use bytemuck::{Pod, Zeroable};

/// [`PrioritiesParams::form`]: by the level of the plane.
pub const BY_LEVEL: u32 = 0;
/// [`PrioritiesParams::form`]: by extent and area.
pub const BY_EXTENT: u32 = 1;

/// Push constants of [`priorities`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PrioritiesParams {
    /// Invocations: one per triangle.
    pub count: u32,
    /// [`BY_LEVEL`] or [`BY_EXTENT`].
    pub form: u32,
    /// The scene's grid.
    pub grid: Grid,
}

/// Least part of the scene's extent, and of its square, that is worth a split.
const LEAST_EXTENT: f32 = 1.0 / (1u32 << 20) as f32;
const LEAST_AREA: f32 = LEAST_EXTENT * LEAST_EXTENT * LEAST_EXTENT;

/// Invocation `i` computes the priority of triangle `i`, 0 for one that is never split. Reads `triangles[n]`, writes `priorities[n]`.
#[inline(always)]
pub fn priorities(i: u32, params: &PrioritiesParams, triangles: &[Triangle], priorities: &[Slot<f32>]) {
    priorities[i as usize].set(priority(params, &triangles[i as usize]));
}

/// The priority of a triangle, at least 0; 0 for one without area.
#[inline(always)]
#[must_use]
pub fn priority(params: &PrioritiesParams, triangle: &Triangle) -> f32 {
    let grid = params.grid;
    let aabb = triangle.aabb();
    let extent = |k: usize| snapped((aabb.max[k] - aabb.min[k]) * grid.unit);
    let (dx, dy, dz) = (extent(0), extent(1), extent(2));
    let largest = max(max(dx, dy), dz);
    let edge = |to: [f32; 3], k: usize| snapped((to[k] - triangle.a[k]) * grid.unit);
    let (u, v) = (triangle.b, triangle.c);
    let normal = |k: usize, l: usize| magnitude(difference_of_products(edge(u, k), edge(v, l), edge(u, l), edge(v, k)));
    let normals = normal(1, 2) + normal(2, 0) + normal(0, 1);
    let excess = (dy * (dx + dz) + dz * dx) - 0.5 * normals;
    if normals < LEAST_AREA || excess < LEAST_AREA || largest < LEAST_EXTENT {
        return 0.0;
    }
    if params.form == BY_EXTENT {
        return cube_root(largest * largest * excess);
    }
    let plane = grid.plane(&aabb);
    // 2^-level, exact.
    let weight = f32::from_bits((127 - if plane.level < CELL_BITS { plane.level } else { CELL_BITS }) << 23);
    if plane.parts { cube_root(weight * excess) } else { 0.0 }
}

/// A multiple of 2^-40, as larger numbers are anyway.
#[inline(always)]
fn snapped(x: f32) -> f32 {
    // The sum with the constant rounds to its last place.
    const ROUND: f32 = 1.5 / (1u32 << 17) as f32;
    const BELOW: f32 = 0.5 / (1u32 << 17) as f32;
    if x > -BELOW && x < BELOW { (x + ROUND) - ROUND } else { x }
}

/// The cube root of a normal number from 2^-100 to 2^60, to a few units in the last place, by Newton's method from a guess.
#[inline(always)]
#[must_use]
pub fn cube_root(x: f32) -> f32 {
    let mut y = f32::from_bits(x.to_bits() / 3 + 0x2a51_4067);
    y -= (y - x * reciprocal(y * y)) * (1.0 / 3.0);
    y -= (y - x * reciprocal(y * y)) * (1.0 / 3.0);
    y -= (y - x * reciprocal(y * y)) * (1.0 / 3.0);
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_good_to_a_few_places() {
        let mut x = 1e-30f32;
        while x < 1e18 {
            let exact = f64::from(x).cbrt();
            assert!((f64::from(cube_root(x)) / exact - 1.0).abs() < 4e-7, "{x}");
            x *= 1.37;
        }
    }

    #[test]
    fn what_is_small_is_a_multiple() {
        for x in [0.0f32, 1e-13, -1e-13, 3.7e-9, -2.2e-6, 0.3] {
            let grid = 2f64.powi(40);
            assert_eq!(f64::from(snapped(x)) * grid, (f64::from(x) * grid).round_ties_even(), "{x}");
        }
    }
}

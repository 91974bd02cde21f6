//! A ray against several boxes at once, against the edges of a triangle at once and against several triangles at once, for processors with vectors. The bits are those of
//! [`Prepared::enters`] and [`Prepared::hits`]: the same operations in the same order, side by side.

use super::steps::Steps;
use super::{Prepared, WIDER};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x4, u32x4};

/// A row for each coordinate of the corners of a triangle; the fourth number of a row is no coordinate.
pub(crate) type Rows = [[f32; 4]; 3];

impl Prepared {
    /// [`Prepared::enters`] of several boxes: where the ray enters each, and a bit for each that it enters. `min` and `max` are corners, a vector a coordinate.
    #[inline(always)]
    pub(crate) fn enters_each<S: Simd, V: SimdFloat<S, Element = f32>>(
        &self,
        min: [V; 3],
        max: [V; 3],
        t_max: f32,
    ) -> (V, u32) {
        let slab = |k: usize| {
            let inverse = self.inverse[k];
            [(min[k] - self.lower_origin[k]) * inverse, (max[k] - self.upper_origin[k]) * inverse]
        };
        self.within(slab(0), slab(1), slab(2), t_max)
    }

    /// [`Prepared::enters_steps`] of several boxes, as [`Prepared::enters_each`].
    #[inline(always)]
    pub(crate) fn enters_each_steps<S: Simd, V: SimdFloat<S, Element = f32>>(
        &self,
        steps: &Steps,
        min: [V; 3],
        max: [V; 3],
        t_max: f32,
    ) -> (V, u32) {
        let slab = |k: usize| [min[k] * steps.step[k] + steps.lower[k], max[k] * steps.step[k] + steps.upper[k]];
        self.within(slab(0), slab(1), slab(2), t_max)
    }

    #[inline(always)]
    fn within<S: Simd, V: SimdFloat<S, Element = f32>>(&self, x: [V; 2], y: [V; 2], z: [V; 2], t_max: f32) -> (V, u32) {
        let (near, far) = (|[a, b]: [V; 2]| a.min(b), |[a, b]: [V; 2]| a.max(b));
        let near = near(x).max(near(y)).max(near(z)).max(self.t_min);
        let far = far(x).min(far(y)).min(far(z)) * WIDER;
        (near, near.simd_le(far.min(t_max)).to_bitmask() as u32)
    }

    /// Whether the ray surely misses a triangle: the first test of [`Prepared::hits`].
    #[inline(always)]
    pub(crate) fn misses(&self, rows: &Rows) -> bool {
        dispatch!(Level::baseline(), simd => self.misses_by(simd, rows))
    }

    /// [`Prepared::misses`] with given vectors.
    #[inline(always)]
    pub(crate) fn misses_by<S: Simd>(&self, simd: S, rows: &Rows) -> bool {
        let (first, second) = super::across(self.axis);
        let d = self.direction;
        // The fourth number of a row may be slow to compute with.
        let corners = u32x4::simd_from(simd, [u32::MAX, u32::MAX, u32::MAX, 0]);
        let from = |axis: u32| {
            let row = f32x4::simd_from(simd, rows[axis as usize]);
            f32x4::from_bits(row.to_bits() & corners) - self.origin[axis as usize]
        };
        let along = from(self.axis);
        let x: [f32; 4] = (from(first) * d[2] - along * d[0]).into();
        let y: [f32; 4] = (from(second) * d[2] - along * d[1]).into();
        let turned = |v: [f32; 4]| {
            (f32x4::simd_from(simd, [v[2], v[0], v[1], v[3]]), f32x4::simd_from(simd, [v[1], v[2], v[0], v[3]]))
        };
        let ((x_before, x_after), (y_before, y_after)) = (turned(x), turned(y));
        let weights = x_before * y_after - y_before * x_after;
        // The fourth lane has twice the same product, and is 0.
        weights.simd_lt(0.0).to_bitmask() != 0 && weights.simd_gt(0.0).to_bitmask() != 0
    }

    /// A bit for each of four triangles that passes the first test of [`Prepared::hits`].
    #[inline(always)]
    pub(crate) fn may_hit<S: Simd>(&self, simd: S, rows: [&Rows; 4]) -> u32 {
        let (first, second) = super::across(self.axis);
        let along = self.corners(simd, rows, self.axis);
        let [ax, bx, cx] = self.sheared_along(self.corners(simd, rows, first), along, self.direction[0]);
        let [ay, by, cy] = self.sheared_along(self.corners(simd, rows, second), along, self.direction[1]);
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let outside = least.simd_lt(0.0) & most.simd_gt(0.0);
        !outside.to_bitmask() as u32
    }

    // Functions where closures would be shorter: what is no `inline(always)` is compiled by itself, for any processor.

    /// A coordinate of the three corners of each triangle, seen from the origin.
    #[inline(always)]
    fn corners<S: Simd>(&self, simd: S, rows: [&Rows; 4], axis: u32) -> [f32x4<S>; 3] {
        let axis = axis as usize;
        let (even, odd) = (f32x4::simd_from(simd, rows[0][axis]), f32x4::simd_from(simd, rows[1][axis]));
        let (even_next, odd_next) = (f32x4::simd_from(simd, rows[2][axis]), f32x4::simd_from(simd, rows[3][axis]));
        let (even_low, odd_low) = (even.zip_low(even_next), odd.zip_low(odd_next));
        let (even_high, odd_high) = (even.zip_high(even_next), odd.zip_high(odd_next));
        let origin = self.origin[axis];
        [even_low.zip_low(odd_low) - origin, even_low.zip_high(odd_low) - origin, even_high.zip_low(odd_high) - origin]
    }

    #[inline(always)]
    fn sheared_along<S: Simd>(&self, across: [f32x4<S>; 3], along: [f32x4<S>; 3], by: f32) -> [f32x4<S>; 3] {
        let last = self.direction[2];
        [across[0] * last - along[0] * by, across[1] * last - along[1] * by, across[2] * last - along[2] * by]
    }
}

//! A ray against several boxes at once and against the edges of a triangle at once, for processors with vectors. The bits are those of [`Prepared::enters`] and
//! [`Prepared::hits`]: the same operations in the same order, side by side.

use super::steps::Steps;
use super::{Prepared, WIDER};
use core::ops::{Add, Mul, Sub};
use wide::{f32x4, f32x8};

/// Numbers side by side.
pub(crate) trait Lanes: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The same number in every lane.
    fn splat(x: f32) -> Self;
    /// [`crate::math::min`] of each lane.
    fn least(self, other: Self) -> Self;
    /// [`crate::math::max`] of each lane.
    fn most(self, other: Self) -> Self;
    /// A bit for each lane that is not above the other's, the first lane in the lowest.
    fn at_most(self, other: Self) -> u32;
}

macro_rules! lanes {
    ($($vector:ident),+) => {$(
        impl Lanes for $vector {
            #[inline(always)]
            fn splat(x: f32) -> Self {
                Self::splat(x)
            }
            #[inline(always)]
            fn least(self, other: Self) -> Self {
                self.fast_min(other)
            }
            #[inline(always)]
            fn most(self, other: Self) -> Self {
                self.fast_max(other)
            }
            #[inline(always)]
            fn at_most(self, other: Self) -> u32 {
                self.simd_le(other).to_bitmask()
            }
        }
    )+};
}

lanes!(f32x4, f32x8);

impl Prepared {
    /// [`Prepared::enters`] of several boxes: where the ray enters each, and a bit for each that it enters. `min` and `max` are corners, a vector a coordinate.
    #[inline(always)]
    pub(crate) fn enters_each<V: Lanes>(&self, min: [V; 3], max: [V; 3], t_max: f32) -> (V, u32) {
        let slab = |k: usize| {
            let inverse = V::splat(self.inverse[k]);
            [(min[k] - V::splat(self.lower_origin[k])) * inverse, (max[k] - V::splat(self.upper_origin[k])) * inverse]
        };
        self.within(slab(0), slab(1), slab(2), t_max)
    }

    /// [`Prepared::enters_steps`] of several boxes, as [`Prepared::enters_each`].
    #[inline(always)]
    pub(crate) fn enters_each_steps<V: Lanes>(&self, steps: &Steps, min: [V; 3], max: [V; 3], t_max: f32) -> (V, u32) {
        let slab = |k: usize| {
            let step = V::splat(steps.step[k]);
            [min[k] * step + V::splat(steps.lower[k]), max[k] * step + V::splat(steps.upper[k])]
        };
        self.within(slab(0), slab(1), slab(2), t_max)
    }

    #[inline(always)]
    fn within<V: Lanes>(&self, x: [V; 2], y: [V; 2], z: [V; 2], t_max: f32) -> (V, u32) {
        let (near, far) = (|[a, b]: [V; 2]| a.least(b), |[a, b]: [V; 2]| a.most(b));
        let near = near(x).most(near(y)).most(near(z)).most(V::splat(self.t_min));
        let far = far(x).least(far(y)).least(far(z)) * V::splat(WIDER);
        (near, near.at_most(far.least(V::splat(t_max))))
    }

    /// Whether the ray surely misses a triangle, whose corners' coordinates are the first three lanes of each row: the first test of [`Prepared::hits`].
    #[inline(always)]
    pub(crate) fn misses(&self, rows: &[[f32; 4]; 3]) -> bool {
        let (first, second) = super::across(self.axis);
        let d = self.direction;
        // The fourth number of a row is none: it may be slow to compute with.
        let corners = f32x4::new([f32::from_bits(u32::MAX), f32::from_bits(u32::MAX), f32::from_bits(u32::MAX), 0.0]);
        let from = |axis: u32| (f32x4::new(rows[axis as usize]) & corners) - f32x4::splat(self.origin[axis as usize]);
        let along = from(self.axis);
        let x = (from(first) * f32x4::splat(d[2]) - f32x4::splat(d[0]) * along).to_array();
        let y = (from(second) * f32x4::splat(d[2]) - f32x4::splat(d[1]) * along).to_array();
        let turned = |v: [f32; 4]| (f32x4::new([v[2], v[0], v[1], v[3]]), f32x4::new([v[1], v[2], v[0], v[3]]));
        let ((x_before, x_after), (y_before, y_after)) = (turned(x), turned(y));
        let weights = x_before * y_after - y_before * x_after;
        let zero = f32x4::splat(0.0);
        // The fourth lane has twice the same product, and is 0.
        weights.simd_lt(zero).to_bitmask() != 0 && weights.simd_gt(zero).to_bitmask() != 0
    }
}

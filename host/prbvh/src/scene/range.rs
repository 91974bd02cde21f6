//! The working coordinates of the kernels: the scene, scaled into a range in which no product of extents under- or overflows.

use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// The largest |coordinate| lies in [2^54, 2^55) after scaling.
const LARGEST: i32 = 54;

/// Coordinates are multiples of 2^-62 after scaling.
const GRID: i32 = 62;

/// A float32 of at least this magnitude is a whole number, as is its product with a power of two.
const WHOLE: f64 = (1u32 << 24) as f64;

/// Half areas of a scene from which on those of its parts have room below them: a part of 2^-86 of it is still a normal float32.
const LEAST_AREA: f64 = 1.0 / (1u64 << 40) as f64;

/// A box around a whole scene whose coordinates are so small or so large that areas in float32 are not to be relied on.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the box from {:?} to {:?} is out of the range in which areas can be relied on (coordinates below 2^55, half area 0 or at least 2^-40): \
     scale the scene with `scene::SafeRange`, as `pipeline` does by itself",
    .aabb.min, .aabb.max
)]
pub struct OutOfRange {
    /// The box.
    pub aabb: Aabb,
}

/// A power of two that brings a scene into the safe range.
///
/// The largest |coordinate| comes to lie in [2^54, 2^55): half surface areas stay below 2^114, which leaves room for sums of
/// 2^13 of the largest. Coordinates become multiples of 2^-62, which changes only those below 2^-39 in magnitude, 2^-93 of the
/// scene: extents are then multiples of 2^-62 too, and every product of two is 0 or at least 2^-124. That is a normal float32,
/// so it makes no difference whether a device flushes denormal numbers to zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SafeRange {
    /// Working coordinates are those of the scene times 2^`exponent`.
    pub exponent: i32,
}

impl SafeRange {
    /// The range of finite triangles; `exponent` is 0 where all coordinates are 0.
    #[must_use]
    pub fn of(triangles: &[Triangle]) -> Self {
        let largest_of = |t: &Triangle| t.a.iter().chain(&t.b).chain(&t.c).fold(0_f32, |m, x| m.max(x.abs()));
        let largest = triangles.par_iter().map(largest_of).reduce(|| 0.0, f32::max);
        Self::of_largest(largest)
    }

    /// The range of a scene whose largest |coordinate| is `largest`.
    #[must_use]
    pub fn of_largest(largest: f32) -> Self {
        if largest == 0.0 {
            return Self { exponent: 0 };
        }
        // A denormal float32 is a normal float64, so the exponent field of the latter tells the magnitude of either.
        let exponent = ((f64::from(largest).to_bits() >> 52) & 0x7ff) as i32 - 1023;
        Self { exponent: LARGEST - exponent }
    }

    /// Whether a scene in this box may stay as it is: it is in the safe range, or it has all coordinates below it and is not so small that the areas
    /// of its parts vanish. What takes triangles or trees in working coordinates asks this first.
    ///
    /// # Errors
    /// [`OutOfRange`] otherwise, also for a box that is not finite.
    pub fn check(aabb: &Aabb) -> Result<(), OutOfRange> {
        let corners = || aabb.min.iter().chain(&aabb.max);
        let largest = corners().fold(0_f32, |most, x| most.max(x.abs()));
        let is_below = |exponent: i32| f64::from(largest) < power_of_two(exponent);
        let extent = |k: usize| f64::from(aabb.max[k]) - f64::from(aabb.min[k]);
        let area = extent(0) * extent(1) + extent(1) * extent(2) + extent(2) * extent(0);
        let is_large_enough = area == 0.0 || area >= LEAST_AREA || !is_below(LARGEST);
        let is_good = corners().all(|x| x.is_finite()) && is_below(LARGEST + 1) && is_large_enough;
        if is_good { Ok(()) } else { Err(OutOfRange { aabb: *aabb }) }
    }

    /// The working coordinates of `triangles`. A zero is +0, so that the smaller and the greater of two are the same bits on all
    /// devices.
    #[must_use]
    pub fn apply(&self, triangles: &[Triangle]) -> Vec<Triangle> {
        let work = self.work();
        triangles.par_iter().map(|t| Triangle { a: t.a.map(work), b: t.b.map(work), c: t.c.map(work) }).collect()
    }

    /// The range of what is in a finite box.
    pub(crate) fn of_box(aabb: &Aabb) -> Self {
        Self::of_largest(aabb.min.iter().chain(&aabb.max).fold(0.0, |most: f32, x| most.max(x.abs())))
    }

    /// A box in working coordinates.
    pub(crate) fn apply_to_box(&self, aabb: &Aabb) -> Aabb {
        let work = self.work();
        Aabb { min: aabb.min.map(work), max: aabb.max.map(work) }
    }

    /// The working coordinate of a coordinate.
    fn work(&self) -> impl Fn(f32) -> f32 + Copy + Sync + use<> {
        // Scaling and rounding in float64 are exact up to the one rounding to the grid.
        let (to_grid, from_grid) = (power_of_two(self.exponent + GRID), power_of_two(-GRID));
        move |x: f32| {
            let cells = f64::from(x) * to_grid;
            // A float32 of 24 bits that is beyond them is a whole number, which need not be rounded: a slow call on many CPUs.
            let cells = if cells.abs() >= WHOLE { cells } else { cells.round_ties_even() };
            (cells * from_grid + 0.0) as f32
        }
    }
}

/// 2^`exponent` for a normal float64.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

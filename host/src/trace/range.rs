//! The coordinates that rays are traced in.

use super::TraceError;
use prbvh_kernel::ray::Ray;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// The largest |coordinate| lies in [2^30, 2^31) after scaling.
const LARGEST: i32 = 30;
/// Coordinates are multiples of 2^-25 after scaling.
const GRID: i32 = 25;
/// Components of directions are multiples of 2^-24.
const DIRECTION_GRID: f64 = (1u32 << 24) as f64;

/// A power of two that brings a scene, and the origins of its rays, into the range in which no product of the ray tests under- or
/// overflows ([`prbvh_kernel::ray`]). Exact, but that coordinates become multiples of 2^-55 of the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRange {
    exponent: i32,
    reach: f32,
}

impl TraceRange {
    /// The range of `triangles` and of rays that start where no |coordinate| is larger than `reach`, scene units.
    #[must_use]
    pub fn of(triangles: &[Triangle], reach: f32) -> Self {
        let largest_of = |t: &Triangle| t.a.iter().chain(&t.b).chain(&t.c).fold(0_f32, |m, x| m.max(x.abs()));
        let largest = triangles.par_iter().map(largest_of).reduce(|| 0.0, f32::max);
        let reach = largest.max(reach.abs());
        if reach == 0.0 {
            return Self { exponent: 0, reach };
        }
        let exponent = ((f64::from(reach).to_bits() >> 52) & 0x7ff) as i32 - 1023;
        Self { exponent: LARGEST - exponent, reach }
    }

    /// Trace coordinates are those of the scene times 2^`exponent`.
    #[must_use]
    pub fn exponent(&self) -> i32 {
        self.exponent
    }

    /// A coordinate of the scene in the trace range.
    #[must_use]
    pub fn coordinate(&self, x: f32) -> f32 {
        ((f64::from(x) * power_of_two(self.exponent + GRID)).round_ties_even() * power_of_two(-GRID) + 0.0) as f32
    }

    /// A point of the scene in the trace range.
    #[must_use]
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        p.map(|x| self.coordinate(x))
    }

    /// The triangles in the trace range.
    #[must_use]
    pub fn triangles(&self, triangles: &[Triangle]) -> Vec<Triangle> {
        let work = |t: &Triangle| Triangle { a: self.point(t.a), b: self.point(t.b), c: self.point(t.c) };
        triangles.par_iter().map(work).collect()
    }

    /// A distance of the trace range in scene units.
    #[must_use]
    pub fn to_scene(&self, t: f32) -> f32 {
        (f64::from(t) * power_of_two(-self.exponent)) as f32
    }

    /// Ray number `k` in the trace range, its direction brought to length 1.
    ///
    /// # Errors
    /// If its coordinates are no numbers, its origin is beyond the reach, or its direction is 0.
    pub fn ray(&self, k: usize, ray: &Ray) -> Result<Ray, TraceError> {
        let fault = |what, value, need: String| TraceError::Ray { ray: k, what, value, need };
        for x in ray.origin {
            if x.is_nan() || x.abs() > self.reach {
                return Err(fault("origin", x, format!("within {} of 0", self.reach)));
            }
        }
        let d = ray.direction.map(f64::from);
        let largest = d.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) || d.iter().any(|x| x.is_nan()) {
            return Err(fault("direction", ray.direction[0], "finite and not 0".to_owned()));
        }
        if ray.t_min.is_nan() || ray.t_max.is_nan() || ray.t_min < 0.0 {
            return Err(fault("t_min", ray.t_min, "from 0 to t_max".to_owned()));
        }
        let length = d.iter().map(|x| (x / largest) * (x / largest)).sum::<f64>().sqrt() * largest;
        let distance = |t: f32| {
            // Farther than any corner from any origin; and no less than the smallest normal number.
            let far = f64::from(prbvh_kernel::ray::LARGEST) * 8.0;
            let t = (f64::from(t) * power_of_two(self.exponent)).clamp(-1.0, far) as f32;
            if t.abs() < f32::MIN_POSITIVE { 0.0 } else { t }
        };
        Ok(Ray {
            origin: self.point(ray.origin),
            t_min: distance(ray.t_min),
            direction: d.map(|x| ((x / length * DIRECTION_GRID).round_ties_even() / DIRECTION_GRID + 0.0) as f32),
            t_max: distance(ray.t_max),
        })
    }
}

/// 2^`exponent` for a normal float64.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

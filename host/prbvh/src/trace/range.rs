//! The coordinates that rays are traced in.

use super::TraceError;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::ray::Ray;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// The largest |coordinate| lies in [2^30, 2^31) after scaling.
const LARGEST: i32 = 30;
/// Coordinates are multiples of 2^-25 after scaling.
const GRID: i32 = 25;
/// Components of directions are multiples of 2^-24.
const DIRECTION_GRID: f64 = (1u32 << 24) as f64;

/// Corners whose median becomes the origin, at most.
const SAMPLES: usize = 1 << 12;

/// A shift and a power of two that bring a scene, and the origins of its rays, into the range in which no product of the ray tests under- or
/// overflows ([`prbvh_kernel::ray`]). Exact, but that coordinates become multiples of 2^-55 of the largest.
///
/// Along each axis the median of the corners becomes 0, if all differences to it are float32 numbers: then rays start on a fine grid where
/// most of the scene is, however far from the origin that may be. A scene that is moved without a rounding has the same coordinates here, bit for
/// bit. Where a difference is none, as with fine detail around the origin and much elsewhere, the axis stays as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRange {
    origin: [f32; 3],
    exponent: i32,
    /// Where rays may start.
    bounds: Aabb,
}

impl TraceRange {
    /// The range of `triangles` and of rays that start in the smallest box around them and the points `starts`.
    #[must_use]
    pub fn of(triangles: &[Triangle], starts: &[[f32; 3]]) -> Self {
        let origin = origin(triangles);
        let scene = triangles.par_iter().map(Triangle::aabb).reduce(|| Aabb::EMPTY, Aabb::union);
        let bounds = starts.iter().fold(scene, |bounds, &p| bounds.union(Aabb { min: p, max: p }));
        let distance = |k: usize, x: f32| (f64::from(x) - f64::from(origin[k])).abs();
        let reach = (0..3).fold(0.0f64, |m, k| m.max(distance(k, bounds.min[k])).max(distance(k, bounds.max[k])));
        if reach == 0.0 {
            return Self { origin, exponent: 0, bounds };
        }
        let exponent = ((reach.to_bits() >> 52) & 0x7ff) as i32 - 1023;
        Self { origin, exponent: LARGEST - exponent, bounds }
    }

    /// Trace coordinates are those of the scene, less those of the [origin](Self::origin), times 2^`exponent`.
    #[must_use]
    pub fn exponent(&self) -> i32 {
        self.exponent
    }

    /// The point of the scene that is 0 in the trace range.
    #[must_use]
    pub fn origin(&self) -> [f32; 3] {
        self.origin
    }

    /// A length of the scene in the trace range.
    #[must_use]
    pub fn length(&self, x: f32) -> f32 {
        self.scaled(x.into())
    }

    fn scaled(&self, x: f64) -> f32 {
        ((x * power_of_two(self.exponent + GRID)).round_ties_even() * power_of_two(-GRID) + 0.0) as f32
    }

    /// A point of the scene in the trace range.
    #[must_use]
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|k| self.scaled(f64::from(p[k]) - f64::from(self.origin[k])))
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
    /// If its coordinates are no numbers, its origin is where no ray was to start, or its direction is 0.
    pub fn ray(&self, k: usize, ray: &Ray) -> Result<Ray, TraceError> {
        let fault = |what, value, need: String| TraceError::Ray { ray: k, what, value, need };
        for (k, x) in ray.origin.into_iter().enumerate() {
            let (low, high) = (self.bounds.min[k], self.bounds.max[k]);
            // No range contains a NaN.
            if !(low..=high).contains(&x) {
                return Err(fault("origin", x, format!("from {low} to {high} along {}", ["x", "y", "z"][k])));
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

/// The median of the first corners, or 0 along axes where a difference to it is no float32 number.
fn origin(triangles: &[Triangle]) -> [f32; 3] {
    let step = triangles.len().div_ceil(SAMPLES).max(1);
    let median = [0, 1, 2].map(|k| {
        let mut sample: Vec<f32> = triangles.iter().step_by(step).map(|t| t.a[k]).collect();
        let middle = sample.len().saturating_sub(1) / 2;
        if sample.is_empty() { 0.0 } else { *sample.select_nth_unstable_by(middle, f32::total_cmp).1 }
    });
    let are_exact = |t: &Triangle| [0, 1, 2].map(|k| [t.a, t.b, t.c].iter().all(|p| is_exact(p[k], median[k])));
    let both = |a: [bool; 3], b: [bool; 3]| [0, 1, 2].map(|k| a[k] && b[k]);
    let exact = triangles.par_iter().map(are_exact).reduce(|| [true; 3], both);
    [0, 1, 2].map(|k| if exact[k] { median[k] } else { 0.0 })
}

/// Whether `a - b` is a float32 number.
fn is_exact(a: f32, b: f32) -> bool {
    let (a, b) = (f64::from(a), f64::from(b));
    let difference = a - b;
    // What rounding took from it (Knuth 1997, 4.2.2, theorem B).
    let other = difference - a;
    let lost = (a - (difference - other)) - (b + other);
    lost == 0.0 && f64::from(difference as f32) == difference
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(at: [f32; 3]) -> Triangle {
        let corner = |x: f32, y: f32| [at[0] + x, at[1] + y, at[2]];
        Triangle { a: at, b: corner(1.0, 0.0), c: corner(0.0, 1.0) }
    }

    #[test]
    fn differences_are_exact_or_not() {
        for (a, b) in [(1.0, 0.5), (524_288.0, 524_287.97), (1e30, 1e30), (-3.0, 3.0), (1e-40, 0.0)] {
            assert!(is_exact(a, b) && is_exact(b, a), "{a} - {b}");
        }
        // Beyond float32, beyond float64, an infinity.
        for (a, b) in [(1.0, 1e-9), (1.0, 1e-30), (1.0, f32::from_bits(1)), (f32::MAX, -f32::MAX)] {
            assert!(!is_exact(a, b) && !is_exact(b, a), "{a} - {b}");
        }
    }

    #[test]
    fn a_scene_that_is_moved_without_a_rounding_stays_where_it_is() {
        let scene: Vec<Triangle> = (0..40).map(|k| triangle([k as f32 * 0.25, 1.0, -5.0])).collect();
        let eye = [3.0, 2.0, 9.5];
        let expected = TraceRange::of(&scene, &[eye]);
        for offset in [0.0f32, -7.0, 65_536.0, 524_288.0, -1_048_576.0] {
            let moved = |p: [f32; 3]| p.map(|x| x + offset);
            let there: Vec<Triangle> =
                scene.iter().map(|t| Triangle { a: moved(t.a), b: moved(t.b), c: moved(t.c) }).collect();
            let range = TraceRange::of(&there, &[moved(eye)]);
            assert_eq!(range.exponent(), expected.exponent(), "{offset}");
            assert_eq!(range.triangles(&there), expected.triangles(&scene), "{offset}");
            assert_eq!(range.point(moved(eye)), expected.point(eye), "{offset}");
        }
    }

    #[test]
    fn an_axis_with_fine_detail_around_0_stays() {
        let mut scene: Vec<Triangle> = (0..40).map(|k| triangle([100.0 + k as f32, 1.0, 1000.0])).collect();
        assert_eq!(TraceRange::of(&scene, &[]).origin(), [119.0, 1.0, 1000.0]);
        scene[7].b[0] = 1e-9;
        assert_eq!(TraceRange::of(&scene, &[]).origin(), [0.0, 1.0, 1000.0]);
        // Few triangles far away do not draw the origin to them.
        scene.truncate(30);
        scene.extend([triangle([1e6, 1e6, 1e6]); 5]);
        assert_eq!(TraceRange::of(&scene, &[]).origin(), [0.0, 1.0, 1000.0]);
    }

    #[test]
    fn rays_start_where_they_were_to() {
        let range = TraceRange::of(&[triangle([0.0; 3])], &[[0.0, 0.0, 4.0]]);
        let ray = |origin| Ray { origin, t_min: 0.0, direction: [0.0, 0.0, 1.0], t_max: 1.0 };
        assert!(range.ray(0, &ray([1.0, 0.5, 4.0])).is_ok());
        for origin in [[1.5, 0.5, 0.0], [0.5, 0.5, -0.1], [0.5, f32::NAN, 0.0]] {
            let error = range.ray(3, &ray(origin)).unwrap_err().to_string();
            assert!(error.starts_with("ray 3: origin is") && error.contains("along"), "{error}");
        }
    }
}

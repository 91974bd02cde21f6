//! Where the picture is taken from, and what lights it.

use super::RenderError;
use prbvh::trace::TraceRange;
use prbvh_kernel::aabb::Aabb;

/// A pinhole camera, scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The eye.
    pub eye: [f32; 3],
    /// A point in the middle of the picture.
    pub look_at: [f32; 3],
    /// Upward in the picture.
    pub up: [f32; 3],
    /// Angle between the left and the right edge of the picture, degrees, more than 0 and less than 180.
    pub fov_degrees: f32,
}

impl Camera {
    /// Number of views that [`Camera::view`] knows.
    pub const VIEWS: u32 = 3;

    /// A view of a scene with box `bounds`: 0 from outside, over a corner; 1 from inside, along the longest horizontal axis; 2 from inside,
    /// from a corner to the opposite one. `up` is an axis, 0 to 2.
    ///
    /// # Errors
    /// If there is no such view or axis.
    pub fn view(number: u32, bounds: &Aabb, up: usize) -> Result<Self, RenderError> {
        Ok(Self::views_from(number, bounds, up)?[0])
    }

    /// The view of that number, and others like it from other places.
    pub(super) fn views_from(number: u32, bounds: &Aabb, up: usize) -> Result<Vec<Self>, RenderError> {
        if up > 2 {
            return Err(RenderError::Setting { name: "up", value: up.to_string(), need: "an axis from 0 to 2" });
        }
        let extent = |k: usize| f64::from(bounds.max[k]) - f64::from(bounds.min[k]);
        let (a, b) = ((up + 1) % 3, (up + 2) % 3);
        let (long, short) = if extent(a) >= extent(b) { (a, b) } else { (b, a) };
        let at = |[along, across, height]: [f64; 3]| {
            let mut p = [0.0f32; 3];
            for (k, part) in [(long, along), (short, across), (up, height)] {
                p[k] = (f64::from(bounds.min[k]) + part * extent(k)) as f32;
            }
            p
        };
        let mut axis = [0.0; 3];
        axis[up] = 1.0;
        let camera = |eye: [f32; 3], mut look_at: [f32; 3], fov_degrees| {
            // A scene without extent has one point, and no direction to look in.
            if eye == look_at {
                look_at[long] = if eye[long] == 0.0 { 1.0 } else { 0.5 * eye[long] };
            }
            Self { eye, look_at, up: axis, fov_degrees }
        };
        match number {
            0 => {
                let size = (0..3).map(|k| extent(k) * extent(k)).sum::<f64>().sqrt();
                let centre = at([0.5; 3]);
                let mut eye = centre;
                for (k, part) in [(long, 0.75), (short, 1.0), (up, 0.6)] {
                    eye[k] = (f64::from(centre[k]) + part * size) as f32;
                }
                Ok(vec![camera(eye, centre, 45.0)])
            }
            1 => Ok(places(0.22, 0.5, 0.4)
                .map(|[along, across, height]| {
                    let end = if along < 0.5 { 1.0 } else { 0.0 };
                    camera(at([along, across, height]), at([end, 0.5, height - 0.05]), 75.0)
                })
                .collect()),
            2 => Ok(places(0.72, 0.6, 0.5)
                .map(|[along, across, height]| {
                    let opposite = |x: f64, near: f64, far: f64| if x < 0.5 { far } else { near };
                    let end = [opposite(along, 0.2, 0.8), opposite(across, 0.35, 0.65), 0.2];
                    camera(at([along, across, height]), at(end), 75.0)
                })
                .collect()),
            _ => {
                let need = "a view from 0 to 2";
                Err(RenderError::Setting { name: "view", value: number.to_string(), need })
            }
        }
    }

    /// Forward, right and up; the latter two as long as the picture's half width and half height at distance 1.
    pub(super) fn frame(&self, width: u32, height: u32) -> Result<[[f32; 3]; 3], RenderError> {
        let numbers = [self.eye, self.look_at, self.up];
        if numbers.iter().flatten().any(|x| !x.is_finite()) {
            let value = format!("{numbers:?}");
            return Err(RenderError::Setting { name: "camera", value, need: "made of finite numbers" });
        }
        if !(self.fov_degrees > 0.0 && self.fov_degrees < 180.0) {
            let (value, need) = (self.fov_degrees.to_string(), "more than 0 and less than 180 degrees");
            return Err(RenderError::Setting { name: "fov", value, need });
        }
        let way = [0, 1, 2].map(|k| f64::from(self.look_at[k]) - f64::from(self.eye[k]));
        let forward = unit(way).ok_or_else(|| RenderError::Setting {
            name: "look-at",
            value: format!("{:?}", self.look_at),
            need: "another point than the eye",
        })?;
        // Straight up or down: any other axis will do.
        let axes = [self.up.map(f64::from), [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
        let across = |&up: &[f64; 3]| {
            let across = cross(forward, unit(up)?);
            let is_clear = across.iter().any(|x| x.abs() > 1e-6);
            if is_clear { unit(across) } else { None }
        };
        let right = axes.iter().find_map(across).unwrap_or([1.0, 0.0, 0.0]);
        let up = cross(right, forward);
        let half = (f64::from(self.fov_degrees).to_radians() / 2.0).tan();
        let aspect = f64::from(height) / f64::from(width);
        Ok([forward, right.map(|x| x * half), up.map(|x| x * half * aspect)].map(|v| v.map(|x| x as f32)))
    }
}

/// Places inside a scene as parts of its extents, the given one first.
fn places(along: f64, across: f64, height: f64) -> impl Iterator<Item = [f64; 3]> {
    const ALONG: [f64; 8] = [0.08, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.92];
    const ACROSS: [f64; 5] = [0.5, 0.38, 0.62, 0.25, 0.75];
    const HEIGHTS: [f64; 4] = [0.4, 0.25, 0.15, 0.6];
    let others = ALONG.into_iter().flat_map(|along| {
        ACROSS.into_iter().flat_map(move |across| HEIGHTS.into_iter().map(move |height| [along, across, height]))
    });
    std::iter::once([along, across, height]).chain(others)
}

/// A rectangle of light, in the trace range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AreaLight {
    pub(super) middle: [f32; 3],
    pub(super) u: [f32; 3],
    pub(super) v: [f32; 3],
    pub(super) normal: [f32; 3],
    /// Radiance times area, in units of 2^60.
    pub(super) power: f32,
    pub(super) sky: f32,
}

impl AreaLight {
    /// Below the ceiling where the eye is inside the scene's box, else above the scene.
    pub(super) fn of(camera: &Camera, bounds: &Aabb, range: &TraceRange) -> Self {
        let up = (0..3).max_by(|&a, &b| camera.up[a].abs().total_cmp(&camera.up[b].abs())).unwrap_or(1);
        let is_inside = (0..3).all(|k| camera.eye[k] >= bounds.min[k] && camera.eye[k] <= bounds.max[k]);
        let low = range.point(bounds.min).map(f64::from);
        let high = range.point(bounds.max).map(f64::from);
        let extent = [0, 1, 2].map(|k| high[k] - low[k]);
        let size = extent.iter().map(|x| x * x).sum::<f64>().sqrt().max(1.0);
        let mut middle = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
        let (half, distance) = if is_inside {
            middle[up] = low[up] + 0.75 * extent[up];
            (0.12, 0.4 * size)
        } else {
            middle[up] = high[up] + 0.7 * size;
            middle[(up + 1) % 3] += 0.8 * size;
            (0.25, size)
        };
        let edge = |k: usize| [0, 1, 2].map(|j| if j == k { (half * size) as f32 } else { 0.0 });
        let normal = [0, 1, 2].map(|k| if k == up { 1.0 } else { 0.0 });
        // An irradiance of about 2π below the light, of about π/2 from the sky.
        let to_unit = 1.0 / (1u64 << 60) as f64;
        let power = (2.0 * std::f64::consts::PI * distance * distance * to_unit) as f32;
        let middle = middle.map(|x| x as f32);
        Self { middle, u: edge((up + 1) % 3), v: edge((up + 2) % 3), normal, power, sky: 0.5 }
    }
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The vector at length 1; none if it has no direction.
pub(super) fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let largest = v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest < 1e-300 {
        return None;
    }
    let v = v.map(|x| x / largest);
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    Some(v.map(|x| x / length))
}

//! A ray against a box and against a triangle.
//!
//! Sources: Woop, Benthin & Wald 2013 (watertight triangle test, here without its divisions); Kay & Kajiya 1986 (slabs).
//!
//! # Why no ray slips through between triangles
//! 1. A corner comes to lie at one point of the plane across the ray, whatever triangle it is asked for.
//! 2. In that plane the sign of an edge says on which side the ray passes. It is that of the exact value, and the opposite one for the triangle on
//!    the other side of the edge: rounding keeps the order of two products, so a rounded difference has the right sign or is 0, and what is
//!    not surely outside is computed again by [`difference_of_products`], whose sign is exact. The paper takes float64 there, which a GPU may lack.
//! 3. So the triangles around an edge or a corner cover what lies around it, and a ray through the edge itself hits both.
//!
//! A ray in the plane of a triangle does not hit it: all three values are 0, or the rounded corners lie to one side. Whether a ray hits the triangle
//! that it starts on is up to roundings: [`Surface::leave`](crate::trace::path::Surface::leave) starts it elsewhere.
//!
//! # Why every tree of a scene gives the same hits
//! 1. Whether a ray hits a triangle, and at which `t`, is computed from the two alone. The closest hit is the smallest `(t, id)`.
//! 2. The interval of a box is monotone: each of its steps (a difference, a product with a fixed factor, minimum, maximum)
//!    keeps the order after rounding. A box inside another never has the larger computed interval.
//! 3. The `t` of a hit is moved into the interval of the triangle's own box (or the hit dropped if that is empty). So it lies in
//!    the interval of every box around the triangle, and no box test on the way can lose it.
//!
//! The boxes are widened by [`Prepared::PAD`] of the largest coordinate, twice what the triangle test may err sideways, so
//! that the last point drops no hit that a watertight test reports. A flat box is therefore hit like any other, and so is one whose face the ray
//! lies in.
//!
//! # Coordinates
//! All magnitudes below are those of the trace range: corners are multiples of 2^-25 below 2^31, origins below 2^33, components of
//! directions multiples of 2^-24 up to 1. Then no product under- or overflows, and it makes no difference whether a device
//! flushes denormal numbers.

#[cfg(not(target_arch = "spirv"))]
mod lanes;
mod steps;

pub use steps::Steps;

use crate::aabb::Aabb;
use crate::math::{difference_of_products, magnitude, max, min, reciprocal};
use bytemuck::{Pod, Zeroable};

/// Triangle of a ray that hits none.
pub const NO_TRIANGLE: u32 = u32::MAX;
/// Triangle of an any-hit ray that hits something: which one depends on the tree.
pub const SOME_TRIANGLE: u32 = u32::MAX - 1;
/// Triangle of a ray that needs more steps than one dispatch has.
pub const UNFINISHED: u32 = u32::MAX - 2;

/// The largest |coordinate| of a scene is below this.
pub const LARGEST: f32 = (1u32 << 31) as f32;

/// A ray, 32 bytes: the points `origin + t · direction` with `t_min <= t <= t_max`. None if `t_max < t_min`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Where it starts.
    pub origin: [f32; 3],
    /// Smallest parameter, at least 0.
    pub t_min: f32,
    /// Where it goes; about of length 1.
    pub direction: [f32; 3],
    /// Largest parameter.
    pub t_max: f32,
}

impl Ray {
    /// A ray that is not traced.
    pub const NONE: Self = Self { origin: [0.0; 3], t_min: 0.0, direction: [0.0, 0.0, 1.0], t_max: -1.0 };

    /// Whether it is traced.
    #[inline(always)]
    #[must_use]
    pub fn is_active(&self) -> bool {
        self.t_min <= self.t_max
    }

    /// A ray whose origin and direction are brought to the grid of the trace range.
    #[inline(always)]
    #[must_use]
    pub fn snapped(origin: [f32; 3], direction: [f32; 3], t_max: f32) -> Self {
        // The sum with the constant rounds to the last place of the constant.
        let point = |x: f32| if x > -0.125 && x < 0.125 { (x + 0.375) - 0.375 } else { x };
        let component = |x: f32| if x > -0.5 && x < 0.5 { (x + 1.5) - 1.5 } else { x };
        Self {
            origin: [point(origin[0]), point(origin[1]), point(origin[2])],
            t_min: 0.0,
            direction: [component(direction[0]), component(direction[1]), component(direction[2])],
            t_max,
        }
    }
}

/// What a ray hit and what it cost, 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hit {
    /// Parameter of the closest hit; 0 without one, and for any-hit rays.
    pub t: f32,
    /// Triangle of the closest hit, [`SOME_TRIANGLE`] for any-hit rays; [`NO_TRIANGLE`] without a hit.
    pub triangle: u32,
    /// Tests against boxes.
    pub box_tests: u32,
    /// Tests against triangles.
    pub triangle_tests: u32,
}

/// A part of a ray: parameters from `near` to `far`; empty if `far < near`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Where it starts.
    pub near: f32,
    /// Where it ends.
    pub far: f32,
}

/// A ray with all that its tests need.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    origin: [f32; 3],
    direction: [f32; 3],
    inverse: [f32; 3],
    /// Origin for the lower faces of boxes, and for the upper ones: the difference widens the boxes.
    lower_origin: [f32; 3],
    upper_origin: [f32; 3],
    /// By how much each of them is moved.
    pad: f32,
    /// Axis of the largest component of the direction.
    axis: u32,
    t_min: f32,
}

/// A component of a direction that is 0 counts as this in slabs: points in a slab are in it for all `t` of a scene, others for none.
const LEAST_COMPONENT: f32 = f32::from_bits((127 - 70) << 23);

/// Widens the end of an interval by what its roundings may have cost.
const WIDER: f32 = 1.0 + 1.0 / (1 << 19) as f32;

#[inline(always)]
fn inverse(x: f32) -> f32 {
    if x == 0.0 { reciprocal(LEAST_COMPONENT) } else { reciprocal(x) }
}

/// The vector with its axes renamed so that `axis` comes last.
#[inline(always)]
fn turned(v: [f32; 3], axis: u32) -> [f32; 3] {
    if axis == 0 {
        [v[1], v[2], v[0]]
    } else if axis == 1 {
        [v[2], v[0], v[1]]
    } else {
        v
    }
}

/// Axes that [`turned`] brings to the first and the second place.
#[cfg(not(target_arch = "spirv"))]
#[inline(always)]
fn across(axis: u32) -> (u32, u32) {
    if axis == 0 {
        (1, 2)
    } else if axis == 1 {
        (2, 0)
    } else {
        (0, 1)
    }
}

#[inline(always)]
fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Whether the ray passes outside of one edge or another, from either side of the triangle.
#[inline(always)]
fn is_outside(u: f32, v: f32, w: f32) -> bool {
    (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)
}

/// Barycentric coordinates of the ray times twice the area, from sheared corners, with their exact signs. An edge has the same value, but for the
/// sign, in both triangles that share it.
#[inline(always)]
fn weights(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> [f32; 3] {
    [
        difference_of_products(c[0], b[1], c[1], b[0]),
        difference_of_products(a[0], c[1], a[1], c[0]),
        difference_of_products(b[0], a[1], b[1], a[0]),
    ]
}

impl Prepared {
    /// Boxes are wider by this part of the largest coordinate.
    pub const PAD: f32 = 1.0 / (1 << 19) as f32;

    /// Prepares a ray.
    #[inline(always)]
    #[must_use]
    pub fn new(ray: &Ray) -> Self {
        let (o, d) = (ray.origin, ray.direction);
        let (x, y, z) = (magnitude(d[0]), magnitude(d[1]), magnitude(d[2]));
        let axis = if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        };
        let farthest = max(max(magnitude(o[0]), magnitude(o[1])), max(magnitude(o[2]), LARGEST));
        let pad = farthest * Self::PAD;
        Self {
            origin: o,
            direction: turned(d, axis),
            inverse: [inverse(d[0]), inverse(d[1]), inverse(d[2])],
            lower_origin: [o[0] + pad, o[1] + pad, o[2] + pad],
            upper_origin: [o[0] - pad, o[1] - pad, o[2] - pad],
            pad,
            axis,
            t_min: ray.t_min,
        }
    }

    /// The part of the whole line inside the box.
    #[inline(always)]
    #[must_use]
    pub fn in_box(&self, aabb: &Aabb) -> Interval {
        // No loop: the time of a ray is spent here.
        let slab = |k: usize| {
            let lower = (aabb.min[k] - self.lower_origin[k]) * self.inverse[k];
            let upper = (aabb.max[k] - self.upper_origin[k]) * self.inverse[k];
            (min(lower, upper), max(lower, upper))
        };
        let (x, y, z) = (slab(0), slab(1), slab(2));
        let far = min(min(x.1, y.1), z.1);
        Interval { near: max(max(x.0, y.0), z.0), far: far * WIDER }
    }

    /// Where the ray enters the box; more than `t_max` if it does not before `t_max`.
    #[inline(always)]
    #[must_use]
    pub fn enters(&self, aabb: &Aabb, t_max: f32) -> f32 {
        self.enters_at(self.in_box(aabb), t_max)
    }

    #[inline(always)]
    fn enters_at(&self, inside: Interval, t_max: f32) -> f32 {
        let near = max(inside.near, self.t_min);
        if near <= min(inside.far, t_max) { near } else { f32::INFINITY }
    }

    /// The corners seen from the origin, sheared so that the ray is the last axis; times the last component of the direction in the first two
    /// coordinates, which changes no sign that is compared with another.
    #[inline(always)]
    fn sheared(&self, corners: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
        let d = self.direction;
        let one = |corner: [f32; 3]| {
            let p = turned(minus(corner, self.origin), self.axis);
            [p[0] * d[2] - d[0] * p[2], p[1] * d[2] - d[1] * p[2], p[2]]
        };
        [one(corners[0]), one(corners[1]), one(corners[2])]
    }

    /// Barycentric coordinates of the second and the third corner where the ray meets a triangle that it [hits](Self::hits).
    #[inline(always)]
    #[must_use]
    pub fn barycentric(&self, corners: [[f32; 3]; 3]) -> [f32; 2] {
        let [a, b, c] = self.sheared(corners);
        let [u, v, w] = weights(a, b, c);
        let part = reciprocal(u + v + w);
        [v * part, w * part]
    }

    /// Parameter of the hit with a triangle, from either side; infinite if there is none from `t_min` to `t_max`.
    #[inline(always)]
    #[must_use]
    pub fn hits(&self, corners: [[f32; 3]; 3], t_max: f32) -> f32 {
        let [a, b, c] = self.sheared(corners);
        // Most triangles are missed, and for these a sign that may be 0 instead will do.
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if is_outside(u, v, w) {
            return f32::INFINITY;
        }
        let [u, v, w] = weights(a, b, c);
        let sum = u + v + w;
        if is_outside(u, v, w) || sum == 0.0 {
            return f32::INFINITY;
        }
        let along = (u * a[2] + v * b[2] + w * c[2]) * reciprocal(sum) * reciprocal(self.direction[2]);
        let own_box = Aabb {
            min: [
                min(min(corners[0][0], corners[1][0]), corners[2][0]),
                min(min(corners[0][1], corners[1][1]), corners[2][1]),
                min(min(corners[0][2], corners[1][2]), corners[2][2]),
            ],
            max: [
                max(max(corners[0][0], corners[1][0]), corners[2][0]),
                max(max(corners[0][1], corners[1][1]), corners[2][1]),
                max(max(corners[0][2], corners[1][2]), corners[2][2]),
            ],
        };
        let own = self.in_box(&own_box);
        let t = min(max(along, own.near), own.far);
        if own.near <= own.far && t >= self.t_min && t <= t_max { t } else { f32::INFINITY }
    }
}

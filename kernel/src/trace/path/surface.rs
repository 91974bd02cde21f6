//! Where new rays leave a surface.
//!
//! Sources: Pharr, Jakob & Humphreys 2016, section 3.9 (a hit point from barycentric coordinates, and a bound of its error); Wächter & Binder 2019
//! (a fast and robust method for avoiding self-intersection: the distance follows from that bound, not from the scene).
//!
//! # The distance
//! `u = 2^-24`; `R` is the largest coordinate difference between the hit point `P` and a corner of its triangle, `n` the normal. Any factors `v`, `w` put
//! `a + v (b - a) + w (c - a)` into the plane of the triangle, so that only the roundings of this sum lead out of it:
//!
//! | what | off the plane, at most |
//! |---|---|
//! | differences, products and their sum | `6 u R` in each coordinate: `10.4 u R` |
//! | the point itself, and the new origin | `2 u (\|n·P\|)`, coordinate by coordinate |
//! | rounding and shearing of the corners in the triangle test of the new ray | `7.2 u R` |
//! | weights and sums of that test | `6 u R` along the ray's axis: `10.4 u R` |
//!
//! A new ray starts `32 u R + 4 u |n·P|` from the plane (and a step of the grid), which is more than their sum: it does not hit the
//! triangle that it leaves.
//!
//! # Corners of a room
//! A hit beside an edge may be rounded onto the other wall there, or beyond it, and out of the room. So the point is first drawn towards the middle of its
//! triangle, by a part of the way that is `64 u`, or `16 u` times the largest coordinate over the triangle's size, if that is more: steps
//! of the grid, as many as one can lose.

use crate::math::{add_scaled, magnitude, max, min, reciprocal};
use crate::ray::{Prepared, Ray};
use bytemuck::{Pod, Zeroable};

/// A triangle that is shaded, trace range, 48 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Surface {
    /// First corner.
    pub a: [f32; 3],
    /// Second corner.
    pub b: [f32; 3],
    /// Third corner.
    pub c: [f32; 3],
    /// Normal, of length 1; 0 without an area.
    pub normal: [f32; 3],
}

const _: () = assert!(size_of::<Surface>() == 48);

/// `32 u`.
const OF_REACH: f32 = 1.0 / (1u32 << 19) as f32;
/// `4 u`.
const OF_POINT: f32 = 1.0 / (1u32 << 22) as f32;
/// Origins are rounded to half of this.
const GRID: f32 = 1.0 / (1u32 << 24) as f32;
/// `64 u`, `16 u`: parts of the way to the middle.
const INWARD: f32 = 1.0 / (1u32 << 18) as f32;
const INWARD_OF_POINT: f32 = 1.0 / (1u32 << 20) as f32;

/// The largest coordinate difference.
#[inline(always)]
fn apart(p: [f32; 3], q: [f32; 3]) -> f32 {
    max(max(magnitude(p[0] - q[0]), magnitude(p[1] - q[1])), magnitude(p[2] - q[2]))
}

impl Surface {
    /// Origin of new rays to the side of `normal`, where `ray` hits the triangle.
    #[inline(always)]
    #[must_use]
    pub fn leave(&self, ray: &Ray, normal: [f32; 3]) -> [f32; 3] {
        let Self { a, b, c, .. } = *self;
        let size = max(apart(a, b), apart(a, c));
        let farthest = max(max(apart(a, [0.0; 3]), apart(b, [0.0; 3])), apart(c, [0.0; 3]));
        let inward = min(max(INWARD, INWARD_OF_POINT * farthest * reciprocal(size)), 1.0);
        let drawn = |x: f32| x + inward * (1.0 / 3.0 - x);
        let [v, w] = Prepared::new(ray).barycentric([a, b, c]);
        let (v, w) = (drawn(v), drawn(w));
        let coordinate = |k: usize| a[k] + (v * (b[k] - a[k]) + w * (c[k] - a[k]));
        let p = [coordinate(0), coordinate(1), coordinate(2)];
        let reach = max(max(apart(a, p), apart(b, p)), apart(c, p));
        let along = magnitude(normal[0] * p[0]) + magnitude(normal[1] * p[1]) + magnitude(normal[2] * p[2]);
        add_scaled(p, OF_REACH * reach + OF_POINT * along + GRID, normal)
    }
}

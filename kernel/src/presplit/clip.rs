//! A triangle on both sides of a plane, as boxes that hold all of it.

use super::Plane;
use crate::aabb::Aabb;
use crate::math::{magnitude, max, min, reciprocal};
use crate::setup::Triangle;

/// Rounding errors of a point between two corners, as parts of their distance and of their coordinates, and a step of the working coordinates: at least twice what they can be.
const OF_DISTANCE: f32 = 1.0 / (1u32 << 19) as f32;
const OF_COORDINATE: f32 = 1.0 / (1u32 << 22) as f32;
const STEP: f32 = f32::from_bits((127 - 61) << 23);

/// Boxes around what of the triangle lies in `aabb` on the lower side of the plane, and on the upper one; inverted along some axis where nothing lies there. A point of
/// the plane is on both sides.
///
/// Source: the edges that cross the plane are cut (Sutherland & Hodgman 1974); as in Stich, Friedrich & Dietrich 2009, §4.1, the boxes are those of the whole triangle's sides, cut to
/// `aabb`. A computed point may be off by roundings, so that a box reaches beyond it by more than these, but no farther than the edge.
#[inline(always)]
#[must_use]
pub fn sides(triangle: &Triangle, aabb: &Aabb, plane: &Plane) -> (Aabb, Aabb) {
    let mut below = Aabb::EMPTY;
    let mut above = Aabb::EMPTY;
    add_edge(triangle.a, triangle.b, plane, &mut below, &mut above);
    add_edge(triangle.b, triangle.c, plane, &mut below, &mut above);
    add_edge(triangle.c, triangle.a, plane, &mut below, &mut above);
    (common(&below, aabb), common(&above, aabb))
}

/// Adds the corner `from`, and where the edge crosses the plane.
#[inline(always)]
fn add_edge(from: [f32; 3], to: [f32; 3], plane: &Plane, below: &mut Aabb, above: &mut Aabb) {
    let (axis, at) = (plane.axis as usize, plane.at);
    let (start, end) = (from[axis], to[axis]);
    let corner = Aabb { min: from, max: from };
    if start <= at {
        *below = below.union(corner);
    }
    if start >= at {
        *above = above.union(corner);
    }
    if (start < at && end > at) || (start > at && end < at) {
        let part = (at - start) * reciprocal(end - start);
        let mut crossing = corner;
        for k in 0..3 {
            let (low, high) = (min(from[k], to[k]), max(from[k], to[k]));
            let distance = to[k] - from[k];
            let point = from[k] + part * distance;
            let slack = magnitude(distance) * OF_DISTANCE + max(magnitude(low), magnitude(high)) * OF_COORDINATE + STEP;
            crossing.min[k] = min(max(point - slack, low), high);
            crossing.max[k] = max(min(point + slack, high), low);
        }
        crossing.min[axis] = at;
        crossing.max[axis] = at;
        *below = below.union(crossing);
        *above = above.union(crossing);
    }
}

#[inline(always)]
fn common(one: &Aabb, other: &Aabb) -> Aabb {
    Aabb {
        min: [max(one.min[0], other.min[0]), max(one.min[1], other.min[1]), max(one.min[2], other.min[2])],
        max: [min(one.max[0], other.max[0]), min(one.max[1], other.max[1]), min(one.max[2], other.max[2])],
    }
}

/// Whether nothing lies in a box.
#[inline(always)]
#[must_use]
pub fn is_inverted(aabb: &Aabb) -> bool {
    aabb.min[0] > aabb.max[0] || aabb.min[1] > aabb.max[1] || aabb.min[2] > aabb.max[2]
}

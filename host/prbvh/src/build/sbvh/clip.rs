//! What of a triangle lies in a box, in f64.

use crate::rounded::{at_least, at_most};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;

/// Most corners of a triangle that six planes have clipped.
const MOST_CORNERS: usize = 9;

/// Part of the coordinates that roundings of f64 in a cut may amount to, with room.
const ROUNDING: f64 = 1e-14;

/// The box around what of the triangle lies in `aabb` (Sutherland & Hodgman 1974), no smaller than that; none if nothing does.
pub(super) fn bounds_in(triangle: &Triangle, aabb: &Aabb) -> Option<Aabb> {
    let mut polygon = Polygon { corners: [[0.0; 3]; MOST_CORNERS], count: 3 };
    for (to, from) in polygon.corners.iter_mut().zip([triangle.a, triangle.b, triangle.c]) {
        *to = from.map(f64::from);
    }
    for axis in 0..3 {
        polygon = polygon.clip(axis, f64::from(aabb.min[axis]), 1.0);
        polygon = polygon.clip(axis, f64::from(aabb.max[axis]), -1.0);
    }
    let mut made = Aabb::EMPTY;
    for corner in &polygon.corners[..polygon.count] {
        for (k, x) in corner.iter().enumerate() {
            let slack = x.abs() * ROUNDING;
            made.min[k] = made.min[k].min(at_most(x - slack));
            made.max[k] = made.max[k].max(at_least(x + slack));
        }
    }
    let made = common(&made, aabb);
    (0..3).all(|k| made.min[k] <= made.max[k]).then_some(made)
}

/// What two boxes share; inverted along some axis where that is nothing.
pub(super) fn common(one: &Aabb, other: &Aabb) -> Aabb {
    Aabb {
        min: std::array::from_fn(|k| one.min[k].max(other.min[k])),
        max: std::array::from_fn(|k| one.max[k].min(other.max[k])),
    }
}

struct Polygon {
    corners: [[f64; 3]; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    /// What of it lies above `plane` (`side` 1) or below (-1).
    fn clip(self, axis: usize, plane: f64, side: f64) -> Self {
        let height = |corner: &[f64; 3]| side * (corner[axis] - plane);
        let all = &self.corners[..self.count];
        if all.iter().all(|corner| height(corner) >= 0.0) {
            return self;
        }
        let mut clipped = Self { corners: [[0.0; 3]; MOST_CORNERS], count: 0 };
        let Some(mut from) = all.last() else { return clipped };
        for to in all {
            if (height(from) >= 0.0) != (height(to) >= 0.0) {
                let part = (plane - from[axis]) / (to[axis] - from[axis]);
                let mut crossing: [f64; 3] = std::array::from_fn(|k| from[k] + part * (to[k] - from[k]));
                crossing[axis] = plane;
                clipped.push(crossing);
            }
            if height(to) >= 0.0 {
                clipped.push(*to);
            }
            from = to;
        }
        clipped
    }

    fn push(&mut self, corner: [f64; 3]) {
        // Rounding can bend a sliver by its width: what is then too many is within the rounding of others.
        if self.count < MOST_CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}

//! Triangles cut by boxes, in f64.

use prbvh_kernel::setup::Triangle;

/// Most corners of a triangle that six planes have clipped: each adds one at most.
const MOST_CORNERS: usize = 9;

/// Area of a triangle inside a closed box (Sutherland & Hodgman 1974).
pub(super) fn clipped_area(corners: &[[f64; 3]; 3], min: &[f64; 3], max: &[f64; 3]) -> f64 {
    let mut polygon = Polygon::default();
    corners.iter().for_each(|&corner| polygon.push(corner));
    for axis in 0..3 {
        polygon = polygon.clip(axis, min[axis], |x, plane| x >= plane).clip(axis, max[axis], |x, plane| x <= plane);
    }
    polygon_area(polygon.corners())
}

#[derive(Clone, Copy, Default)]
struct Polygon {
    corners: [[f64; 3]; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    fn corners(&self) -> &[[f64; 3]] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: [f64; 3]) {
        // Rounding can bend a sliver by its width: what is then too many is of no area.
        if self.count < MOST_CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    fn clip(self, axis: usize, plane: f64, is_inside: impl Fn(f64, f64) -> bool) -> Self {
        if self.corners().iter().all(|corner| is_inside(corner[axis], plane)) {
            return self;
        }
        let mut clipped = Self::default();
        let Some(&last) = self.corners().last() else { return clipped };
        let mut from = last;
        for &to in self.corners() {
            if is_inside(from[axis], plane) != is_inside(to[axis], plane) {
                let part = (plane - from[axis]) / (to[axis] - from[axis]);
                let mut crossing = [0, 1, 2].map(|k| from[k] + part * (to[k] - from[k]));
                crossing[axis] = plane;
                clipped.push(crossing);
            }
            if is_inside(to[axis], plane) {
                clipped.push(to);
            }
            from = to;
        }
        clipped
    }
}

/// Area of a flat convex polygon.
pub(super) fn polygon_area(corners: &[[f64; 3]]) -> f64 {
    let Some((&first, rest)) = corners.split_first() else { return 0.0 };
    let mut doubled = [0.0; 3];
    for pair in rest.windows(2) {
        let normal = cross(minus(pair[0], first), minus(pair[1], first));
        (0..3).for_each(|k| doubled[k] += normal[k]);
    }
    0.5 * doubled.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub(super) fn corners(triangle: &Triangle) -> [[f64; 3]; 3] {
    [triangle.a, triangle.b, triangle.c].map(|corner| corner.map(f64::from))
}

pub(super) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

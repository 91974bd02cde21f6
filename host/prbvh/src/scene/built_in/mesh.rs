//! Surfaces as triangles, by operations that give the same bits on every machine.

use super::noise::Noise;
use prbvh_kernel::setup::Triangle;
use std::f64::consts::TAU;

/// A point or a direction.
pub(super) type Point = [f64; 3];

pub(super) fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn scaled(a: Point, s: f64) -> Point {
    [a[0] * s, a[1] * s, a[2] * s]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: Point) -> Point {
    scaled(a, 1.0 / (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt())
}

/// Cosine and sine of `i` of `n` equal parts of a turn. `libm` computes them with additions and multiplications alone, unlike
/// the libraries of the systems, which differ in the last bit.
pub(super) fn turn(i: usize, n: usize) -> (f64, f64) {
    angle((i % n) as f64 / n as f64)
}

/// Cosine and sine of a part of a turn.
pub(super) fn angle(part: f64) -> (f64, f64) {
    (libm::cos(TAU * part), libm::sin(TAU * part))
}

/// Columns and rows of a grid of at most `triangles` triangles, with `aspect` columns per row, but at least `least`.
pub(super) fn grid(triangles: usize, aspect: f64, least: (usize, usize)) -> (usize, usize) {
    let columns = ((triangles as f64 / 2.0 * aspect).sqrt() as usize).min(triangles / (2 * least.1)).max(least.0);
    (columns, (triangles / (2 * columns)).max(least.1))
}

/// Triangles up to a number: what comes after is dropped.
pub(super) struct Mesh {
    pub(super) triangles: Vec<Triangle>,
    limit: usize,
}

impl Mesh {
    pub(super) fn new(limit: usize) -> Self {
        Self { triangles: Vec::with_capacity(limit), limit }
    }

    /// Triangles still missing.
    pub(super) fn room(&self) -> usize {
        self.limit - self.triangles.len()
    }

    pub(super) fn triangle(&mut self, a: Point, b: Point, c: Point) {
        if self.room() > 0 {
            let [a, b, c] = [a, b, c].map(|corner| corner.map(|x| x as f32));
            self.triangles.push(Triangle { a, b, c });
        }
    }

    /// Two triangles.
    pub(super) fn quad(&mut self, a: Point, b: Point, c: Point, d: Point) {
        self.triangle(a, b, c);
        self.triangle(a, c, d);
    }

    /// Twelve triangles.
    pub(super) fn cuboid(&mut self, min: Point, max: Point) {
        let at = |k: usize| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { max[axis] } else { min[axis] });
        for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            self.quad(at(a), at(b), at(c), at(d));
        }
    }

    /// `2 × columns × rows` triangles over the points `(i, j)` with i ≤ columns and j ≤ rows.
    pub(super) fn surface(&mut self, columns: usize, rows: usize, point: impl Fn(usize, usize) -> Point) {
        for j in 0..rows {
            for i in 0..columns {
                self.quad(point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
            }
        }
    }

    /// `2 × sides × steps` triangles: a tube around `path(0..=steps)`; `up` is never along the path.
    pub(super) fn tube(&mut self, steps: usize, sides: usize, radius: f64, up: Point, path: impl Fn(usize) -> Point) {
        self.surface(sides, steps, |i, j| {
            let tangent = minus(path((j + 1).min(steps)), path(j.saturating_sub(1)));
            let across = unit(cross(tangent, up));
            let normal = unit(cross(across, tangent));
            let (c, s) = turn(i, sides);
            add(path(j), add(scaled(across, radius * c), scaled(normal, radius * s)))
        });
    }

    /// `2 × sides × steps` triangles: a ring of radius `ring` around `centre` in the plane of `u` and `v`.
    pub(super) fn torus(
        &mut self,
        (steps, sides): (usize, usize),
        centre: Point,
        (u, v): (Point, Point),
        ring: f64,
        tube: f64,
    ) {
        let axis = cross(u, v);
        self.surface(steps, sides, |i, j| {
            let ((c, s), (h, w)) = (turn(i, steps), turn(j, sides));
            let out = add(scaled(u, c), scaled(v, s));
            add(centre, add(scaled(out, ring + tube * h), scaled(axis, tube * w)))
        });
    }

    /// `4 × n × (n - 1)` triangles.
    pub(super) fn sphere(&mut self, n: usize, centre: Point, radius: f64) {
        let point = |i: usize, j: usize| {
            let ((c, s), (y, r)) = (turn(i, 2 * n), angle(j as f64 / n as f64 / 2.0));
            add(centre, scaled([r * c, y, r * s], radius))
        };
        for i in 0..2 * n {
            self.triangle(point(0, 0), point(i + 1, 1), point(i, 1));
            self.triangle(point(i, n - 1), point(i + 1, n - 1), point(0, n));
        }
        self.surface(2 * n, n.saturating_sub(2), |i, j| point(i, j + 1));
    }

    /// One triangle: a blade that stands on `foot` and leans any way.
    pub(super) fn blade(&mut self, noise: &mut Noise, foot: Point, height: f64, width: f64) {
        let (c, s) = angle(noise.unit());
        let lean = [noise.between(-0.4, 0.4) * height, height, noise.between(-0.4, 0.4) * height];
        let half = scaled([c, 0.0, s], width / 2.0);
        self.triangle(minus(foot, half), add(foot, half), add(foot, lean));
    }
}

//! Generators of the catalogue: `n` triangles from a size and one parameter, the same bits on every machine.

use prbvh::scene::{Noise, built_in};
use prbvh_kernel::setup::Triangle;

type Point = [f64; 3];

fn triangle(a: Point, b: Point, c: Point) -> Triangle {
    let [a, b, c] = [a, b, c].map(|corner| corner.map(|x| x as f32));
    Triangle { a, b, c }
}

fn map(triangles: Vec<Triangle>, point: impl Fn([f32; 3]) -> [f32; 3]) -> Vec<Triangle> {
    triangles.into_iter().map(|t| Triangle { a: point(t.a), b: point(t.b), c: point(t.c) }).collect()
}

/// Triangles of edges up to `edge` anywhere in the unit cube.
fn pieces(n: usize, edge: f64, seed: u64) -> Vec<[Point; 3]> {
    let mut noise = Noise::new(seed);
    let piece = |_| {
        let at = [0; 3].map(|_| noise.unit());
        [0; 3].map(|_| at.map(|x| x + edge * noise.unit()))
    };
    (0..n).map(piece).collect()
}

/// Small triangles, all alike, in a cube of edge `scale`.
pub(super) fn uniform(n: usize, scale: f64) -> Vec<Triangle> {
    let work = |p: Point| p.map(|x| x * scale);
    pieces(n, 0.1, 1).into_iter().map(|[a, b, c]| triangle(work(a), work(b), work(c))).collect()
}

/// The unit cube of [`uniform`], `extents` away from the origin along every axis.
pub(super) fn offset(n: usize, extents: f64) -> Vec<Triangle> {
    let work = |p: Point| p.map(|x| x + extents);
    pieces(n, 0.1, 2).into_iter().map(|[a, b, c]| triangle(work(a), work(b), work(c))).collect()
}

/// Triangles as large as `edge` cubes: everything overlaps.
pub(super) fn soup(n: usize, edge: f64) -> Vec<Triangle> {
    pieces(n, edge, 3).into_iter().map(|[a, b, c]| triangle(a, b, c)).collect()
}

/// One triangle across the unit cube, the others `ratio` times smaller, side by side at the origin, where float32 is fine enough.
pub(super) fn huge_and_tiny(n: usize, ratio: f64) -> Vec<Triangle> {
    let spread = 2.0 * (n as f64).cbrt() / ratio;
    let mut noise = Noise::new(4);
    let mut tiny = |_| {
        let at = [0; 3].map(|_| spread * noise.unit());
        let [a, b, c] = [0; 3].map(|_| at.map(|x| x + noise.unit() / ratio));
        triangle(a, b, c)
    };
    let huge = triangle([0.0; 3], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]);
    std::iter::once(huge).chain((1..n).map(&mut tiny)).collect()
}

/// Triangle `k` of size 2^k at 2^k, from 2^`first` on.
pub(super) fn chain(n: usize, first: f64) -> Vec<Triangle> {
    let link = |k| {
        let size = libm::exp2(first + k as f64);
        triangle([size, 0.0, 0.0], [2.0 * size, size, 0.0], [size, 0.0, size])
    };
    (0..n).map(link).collect()
}

/// Needles, one short edge: `ratio` times as long as wide, along all three axes through one bundle.
pub(super) fn needles(n: usize, ratio: f64) -> Vec<Triangle> {
    slender(n, ratio, 0.0)
}

/// Slivers, no short edge: the third corner stands over the middle of the first edge, `ratio` times lower than the edge is long.
pub(super) fn slivers(n: usize, ratio: f64) -> Vec<Triangle> {
    slender(n, ratio, 0.5)
}

/// The thickness is across the axis, where the coordinates are in the unit interval: float32 resolves it to 6e-8.
fn slender(n: usize, ratio: f64, foot: f64) -> Vec<Triangle> {
    const LENGTH: f64 = 1e4;
    let mut noise = Noise::new(5);
    let slender = |k: usize| {
        let [from, y, z] = [0; 3].map(|_| noise.unit());
        // 0.9: what rounding to float32 may add to the thickness.
        let height = 0.9 * LENGTH / ratio;
        let corners = [[from, y, z], [from + LENGTH, y, z], [from + foot * LENGTH, y + height, z]];
        let [a, b, c] = corners.map(|corner| [0, 1, 2].map(|axis| corner[(axis + k) % 3]));
        triangle(a, b, c)
    };
    (0..n).map(slender).collect()
}

/// Triangles with whole coordinates below `side`: no half area and no sum of a few is rounded in float32.
pub(super) fn whole(n: usize, side: f64) -> Vec<Triangle> {
    let mut noise = Noise::new(6);
    let whole = |_| {
        let at = [0; 3].map(|_| (noise.unit() * (side - 8.0)).floor());
        let [a, b, c] = [0; 3].map(|_| at.map(|x| x + (noise.unit() * 8.0).floor()));
        triangle(a, b, c)
    };
    (0..n).map(whole).collect()
}

/// All corners on the plane z = x + y, exactly.
pub(super) fn coplanar(n: usize, side: f64) -> Vec<Triangle> {
    map(whole(n, side), |[x, y, _]| [x, y, x + y])
}

/// All corners on the line (t, 2t, 3t), exactly: no triangle has an area, but their boxes do.
pub(super) fn collinear(n: usize, side: f64) -> Vec<Triangle> {
    map(whole(n, side), |[t, ..]| [t, 2.0 * t, 3.0 * t])
}

/// Every corner is the same point.
pub(super) fn coincident(n: usize, at: f64) -> Vec<Triangle> {
    vec![triangle([at; 3], [at; 3], [at; 3]); n]
}

/// One triangle, again and again.
pub(super) fn duplicates(n: usize, size: f64) -> Vec<Triangle> {
    vec![triangle([0.1 * size, 0.2 * size, 0.3 * size], [size, 0.4 * size, 0.5 * size], [0.6 * size, size, size]); n]
}

/// One triangle with every coordinate off by 0 to `most - 1` units in the last place.
pub(super) fn ulp_jitter(n: usize, most: f64) -> Vec<Triangle> {
    let mut noise = Noise::new(7);
    let mut jittered = |x: f32| f32::from_bits(x.to_bits() + (most * noise.unit()) as u32);
    let work =
        |t: Triangle| Triangle { a: t.a.map(&mut jittered), b: t.b.map(&mut jittered), c: t.c.map(&mut jittered) };
    duplicates(n, 1.0).into_iter().map(work).collect()
}

/// Every other triangle of a soup is `ratio` times smaller, at the origin.
pub(super) fn two_scales(n: usize, ratio: f64) -> Vec<Triangle> {
    let two = |(k, [a, b, c]): (usize, [Point; 3])| {
        let scale = if k % 2 == 0 { 1.0 } else { 1.0 / ratio };
        let work = |p: Point| p.map(|x| x * scale);
        triangle(work(a), work(b), work(c))
    };
    pieces(n, 0.1, 8).into_iter().enumerate().map(two).collect()
}

/// [`uniform`] without extent along the last `axes` axes.
pub(super) fn flat(n: usize, axes: f64) -> Vec<Triangle> {
    let first = 3 - axes as usize;
    map(uniform(n, 1.0), |mut point| {
        point[first..].fill(0.5);
        point
    })
}

/// A dense body with a handle, a stadium `ratio` times as large around it: a few hundred large triangles and all others in one spot.
pub(super) fn teapot_in_stadium(n: usize, ratio: f64) -> Vec<Triangle> {
    let turn = |part: f64| (libm::cos(std::f64::consts::TAU * part), libm::sin(std::f64::consts::TAU * part));
    let surface = |columns: usize, rows: usize, point: &dyn Fn(f64, f64) -> Point| {
        let at = |i: usize, j: usize| point(i as f64 / columns as f64, j as f64 / rows as f64);
        let quad = |k: usize| {
            let (i, j) = (k % columns, k / columns);
            [triangle(at(i, j), at(i + 1, j), at(i + 1, j + 1)), triangle(at(i, j), at(i + 1, j + 1), at(i, j + 1))]
        };
        (0..columns * rows).flat_map(quad).collect::<Vec<_>>()
    };
    let side = |triangles: usize| ((triangles / 2) as f64).sqrt() as usize;
    let body = surface(side(n / 2).max(2), side(n / 2).max(2), &|u, v| {
        let ((c, s), (y, r)) = (turn(u), turn(v / 2.0));
        [r * c, 0.8 * y, r * s]
    });
    let handle = surface(side(n / 4).max(2), side(n / 4).max(2), &|u, v| {
        let ((c, s), (h, w)) = (turn(u), turn(v));
        [1.1 + (0.5 + 0.1 * h) * c, (0.5 + 0.1 * h) * s, 0.1 * w]
    });
    let bowl = surface(side(n / 4).max(2), side(n / 4).max(2), &|u, v| {
        let (c, s) = turn(u);
        let out = ratio * (0.6 + 0.4 * v);
        [out * c, ratio * 0.3 * v * v - 0.8, 0.7 * out * s]
    });
    [body, handle, bowl].concat()
}

/// `side³` equal triangles on the points of a lattice, as many as fit into `n`: most decisions are exact ties.
pub(super) fn grid(n: usize, pitch: f64) -> Vec<Triangle> {
    let side = (1..).take_while(|side: &usize| side.pow(3) <= n).last().unwrap_or(1);
    let cell = |k: usize| {
        let at = [k % side, k / side % side, k / side / side].map(|x| pitch * x as f64);
        triangle(at, [at[0] + 1.0, at[1], at[2] + 1.0], [at[0], at[1] + 1.0, at[2]])
    };
    (0..side.pow(3)).map(cell).collect()
}

/// A soup in which every `every`-th triangle has a NaN or an infinity somewhere.
pub(super) fn not_finite(n: usize, every: f64) -> Vec<Triangle> {
    const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let mut triangles = uniform(n, 1.0);
    for (k, triangle) in triangles.iter_mut().enumerate().skip(2).step_by(every as usize) {
        [&mut triangle.a, &mut triangle.b, &mut triangle.c][k % 3][k / 3 % 3] = BAD[k / 9 % 3];
    }
    triangles
}

/// Teeth of a comb: tooth `k` is `ratio` times smaller than the one before it and lies in the corner of its box. The tree that takes
/// off one tooth at a time has the least area, and is as deep as there are teeth.
pub(super) fn comb(n: usize, ratio: f64) -> Vec<Triangle> {
    let tooth = |k: usize| {
        let size = libm::pow(ratio, -(k as f64));
        triangle([0.0; 3], [size, 0.0, size], [0.0, size, size])
    };
    (0..n).map(tooth).collect()
}

/// Small teeth at 2^-k along each axis in turn, one for every bit of a 60-bit Morton code, and all others at the origin with equal
/// codes: a tree over codes has a level for each bit and more to tell the equal ones apart.
pub(super) fn morton_comb(n: usize, bits: f64) -> Vec<Triangle> {
    let tooth = |k: usize| {
        let mut at = [0.0; 3];
        if k < bits as usize {
            at[k % 3] = libm::exp2(-((k / 3) as f64));
        }
        let size = at[k % 3] / 64.0;
        triangle(at, at.map(|x| x + size), [at[0], at[1] + size, at[2] + size / 2.0])
    };
    (0..n).map(tooth).collect()
}

/// The surface of a box, `side` by `side` squares on each of its faces.
fn hull(low: Point, extent: Point, side: usize) -> Vec<Triangle> {
    let face = |axis: usize, end: f64| {
        let at = move |i: usize, j: usize| {
            let part = [i as f64 / side as f64, j as f64 / side as f64];
            let mut p = low;
            p[axis] += end * extent[axis];
            for (k, part) in part.into_iter().enumerate() {
                let other = (axis + 1 + k) % 3;
                p[other] += part * extent[other];
            }
            p
        };
        (0..side * side).flat_map(move |k| {
            let (i, j) = (k % side, k / side);
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            // Seen from outside the corners go round the same way on all faces.
            if end > 0.0 { [triangle(a, b, c), triangle(a, c, d)] } else { [triangle(a, c, b), triangle(a, d, c)] }
        })
    };
    (0..3).flat_map(|axis| face(axis, 0.0).chain(face(axis, 1.0))).collect()
}

/// A closed room of 8 by 4 by 8, `distance` away from the origin along every axis, and a cube on its floor: whole coordinates.
pub(super) fn room(n: usize, distance: f64) -> Vec<Triangle> {
    let side = [1, 2, 4].into_iter().rev().find(|side| 12 * side * side + 12 <= n).unwrap_or(1);
    let at = |p: Point| p.map(|x| x + distance);
    [hull(at([-4.0, -2.0, -4.0]), [8.0, 4.0, 8.0], side), hull(at([2.0, -2.0, 1.0]), [1.0; 3], 1)].concat()
}

/// The room at the origin, and one triangle `distance` away.
pub(super) fn room_and_far(n: usize, distance: f64) -> Vec<Triangle> {
    let far = triangle([distance, 0.0, 0.0], [distance + 1.0, 0.0, 0.0], [distance, 1.0, 0.0]);
    [room(n - 1, 0.0), vec![far]].concat()
}

/// The built-in hall, turned by so many degrees around two axes.
pub(super) fn turned_hall(n: usize, degrees: f64) -> Vec<Triangle> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    map(built_in(n).triangles, |p| {
        let [x, y, z] = p.map(f64::from);
        let [x, z] = [cos * x - sin * z, sin * x + cos * z];
        [x, cos * y - sin * z, sin * y + cos * z].map(|x| x as f32)
    })
}

#[cfg(test)]
#[path = "shapes_tests.rs"]
mod tests;

//! Rays through any tree, on the host and by the book: for trees that hold a primitive more than once, and for boxes.

use crate::fixtures::Random;
use prbvh::bvh::{Bvh, Content, ROOT};
use prbvh::scene::{Aabb, Triangle};

/// A ray: origin and direction.
pub type Line = ([f64; 3], [f64; 3]);

/// Part of a box's coordinates by which it is taken larger, so that rounding loses no primitive.
const SLACK: f64 = 1e-9;

/// Where along the ray it enters the box.
#[must_use]
pub fn enters(aabb: &Aabb, (origin, direction): &Line) -> Option<f64> {
    let (mut from, mut to) = (0.0f64, f64::INFINITY);
    for k in 0..3 {
        let slack = SLACK * (1.0 + f64::from(aabb.min[k].abs().max(aabb.max[k].abs())));
        let planes = [f64::from(aabb.min[k]) - slack, f64::from(aabb.max[k]) + slack];
        if direction[k] == 0.0 {
            if origin[k] < planes[0] || origin[k] > planes[1] {
                return None;
            }
            continue;
        }
        let [a, b] = planes.map(|plane| (plane - origin[k]) / direction[k]);
        (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
    }
    (from <= to).then_some(from)
}

/// Where along the ray it meets the triangle (Möller & Trumbore 1997, in f64).
#[must_use]
pub fn meets(t: &Triangle, (origin, direction): &Line) -> Option<f64> {
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let [a, b, c] = [t.a, t.b, t.c].map(|p| p.map(f64::from));
    let (u, v) = (minus(b, a), minus(c, a));
    let p = cross(*direction, v);
    let determinant = dot(u, p);
    if determinant == 0.0 {
        return None;
    }
    let s = minus(*origin, a);
    let x = dot(s, p) / determinant;
    let q = cross(s, u);
    let y = dot(*direction, q) / determinant;
    let at = dot(v, q) / determinant;
    (x >= 0.0 && y >= 0.0 && x + y <= 1.0 && at >= 0.0).then_some(at)
}

/// The nearest primitive that the ray meets, the first of equally near ones, by asking all.
pub fn nearest(primitives: impl Iterator<Item = u32>, meets: impl Fn(u32) -> Option<f64>) -> Option<(f64, u32)> {
    let hits = primitives.filter_map(|primitive| Some((meets(primitive)?, primitive)));
    hits.min_by(|one, other| one.partial_cmp(other).expect("numbers"))
}

/// The same through the tree.
pub fn through(tree: &Bvh, line: &Line, meets: impl Fn(u32) -> Option<f64>) -> Option<(f64, u32)> {
    let (mut stack, mut found) = (vec![ROOT], Vec::new());
    while let Some(v) = stack.pop() {
        let node = &tree.nodes[v as usize];
        if enters(&node.aabb, line).is_none() {
            continue;
        }
        match node.content {
            Content::Internal { left, right } => stack.extend([left, right]),
            Content::Leaf { first, count } => {
                found.extend(&tree.triangle_order[first as usize..][..count as usize]);
            }
        }
    }
    nearest(found.into_iter(), meets)
}

/// Rays through a box, from around it.
#[must_use]
pub fn lines(aabb: &Aabb, count: usize, seed: u64) -> Vec<Line> {
    let mut random = Random(seed);
    let mut point = |wide: f64| {
        let unit = random.point(1.0);
        let at = |k: usize| {
            let (min, max) = (f64::from(aabb.min[k]), f64::from(aabb.max[k]));
            0.5 * (min + max) + wide * (f64::from(unit[k]) - 0.5) * (max - min)
        };
        [at(0), at(1), at(2)]
    };
    let mut line = || {
        let (origin, target) = (point(3.0), point(1.0));
        (origin, [0, 1, 2].map(|k| target[k] - origin[k]))
    };
    (0..count).map(|_| line()).collect()
}

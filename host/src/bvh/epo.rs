//! End-point overlap (Aila, Karras & Laine 2013, *On Quality Metrics of Bounding Volume Hierarchies*).

use super::{Bvh, Content, ROOT, SahModel};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// Distinct triangles whose shares are summed by one thread; fixed, so that the result does not depend on the threads.
const CHUNK: usize = 256;

/// End-point overlap of a valid tree over `triangles`, unitless: what a ray that ends on a surface pays for nodes that hold the end point, but
/// not the triangle it lies on.
///
/// `EPO = Σ C(n) · area((S \ Q(n)) ∩ n) / area(S)` over all nodes `n`, where `S` are all triangles, `Q(n)` those in the subtree of `n`, and
/// `C(n)` is `c_traversal` for an internal node and `c_intersect` times its triangles for a leaf. A box is closed: a triangle that lies in
/// one of its faces is inside. Coincident triangles count each. Where `S` has no area the result is 0.
///
/// The sum is taken in f64 in the order of the corners, and for each triangle in depth-first order: one tree has one value, however its
/// nodes are numbered and on however many threads. Coordinates of any finite f32 neither overflow nor underflow. Copies of a triangle
/// share a walk through the tree, which would be quadratic in their number; near copies have one each.
///
/// # Panics
/// If the links are no tree over the triangles.
#[must_use]
pub fn epo(tree: &Bvh, triangles: &[Triangle], model: &SahModel) -> f64 {
    let walk = Walk::new(tree, triangles.len(), model);
    let bits = |id: u32| corners(&triangles[id as usize]).map(|corner| corner.map(f64::to_bits));
    let mut ids: Vec<u32> = (0..triangles.len() as u32).collect();
    ids.par_sort_unstable_by_key(|&id| (bits(id), walk.ranks[id as usize]));
    let copies: Vec<&[u32]> = ids.chunk_by(|&a, &b| bits(a) == bits(b)).collect();
    let chunk = |copies: &[&[u32]]| {
        let mut sums = [0.0; 2];
        for &ids in copies {
            let corners = corners(&triangles[ids[0] as usize]);
            let area = polygon_area(&corners);
            sums[0] += area * ids.len() as f64;
            if area > 0.0 {
                let ranks: Vec<u32> = ids.iter().map(|&id| walk.ranks[id as usize]).collect();
                sums[1] += walk.overlap(&corners, &ranks);
            }
        }
        sums
    };
    let sums: Vec<[f64; 2]> = copies.par_chunks(CHUNK).map(chunk).collect();
    let [area, overlap] = sums.iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    if area > 0.0 { overlap / area } else { 0.0 }
}

/// The tree in depth-first order.
struct Walk {
    steps: Vec<Step>,
    /// Place of each triangle among all in depth-first order.
    ranks: Vec<u32>,
}

/// A node of the walk.
struct Step {
    min: [f64; 3],
    max: [f64; 3],
    /// `C(n)`.
    cost: f64,
    /// Ranks of the triangles below.
    ranks: [u32; 2],
    /// The next node that is not below.
    skip: u32,
}

impl Walk {
    fn new(tree: &Bvh, triangles: usize, model: &SahModel) -> Self {
        assert_eq!(tree.triangle_order.len(), triangles, "the tree is over other triangles");
        let mut steps: Vec<Step> = Vec::with_capacity(tree.nodes.len());
        let mut ranks = vec![0; triangles];
        let mut rank = 0;
        // A node is met twice: before and, as its place in the walk, after all that is below.
        let mut pending = vec![Meeting::Before(ROOT)];
        while let Some(meeting) = pending.pop() {
            match meeting {
                Meeting::After(at) => {
                    steps[at].ranks[1] = rank;
                    steps[at].skip = steps.len() as u32;
                }
                Meeting::Before(v) => {
                    let node = &tree.nodes[v as usize];
                    assert!(steps.len() < tree.nodes.len(), "the links are no tree");
                    pending.push(Meeting::After(steps.len()));
                    let Aabb { min, max } = node.aabb;
                    let mut step =
                        Step { min: min.map(f64::from), max: max.map(f64::from), cost: 0.0, ranks: [rank; 2], skip: 0 };
                    match node.content {
                        Content::Internal { left, right } => {
                            step.cost = model.c_traversal;
                            pending.extend([Meeting::Before(right), Meeting::Before(left)]);
                        }
                        Content::Leaf { first, count } => {
                            step.cost = model.c_intersect * f64::from(count);
                            for &triangle in tree.triangles_of(first, count) {
                                ranks[triangle as usize] = rank;
                                rank += 1;
                            }
                        }
                    }
                    steps.push(step);
                }
            }
        }
        Self { steps, ranks }
    }

    /// `Σ C(n) · area(triangle ∩ n)` over the nodes that do not hold a copy of the triangle, for all its copies; `ranks` rise.
    fn overlap(&self, corners: &[[f64; 3]; 3], ranks: &[u32]) -> f64 {
        let hull = Hull::of(corners);
        let mut sum = 0.0;
        let mut at = 0;
        while let Some(step) = self.steps.get(at) {
            let [first, end] = step.ranks.map(|rank| ranks.partition_point(|&copy| copy < rank));
            let held = end - first;
            if held < ranks.len() {
                let area = if hull.misses(step) { 0.0 } else { clipped_area(corners, &step.min, &step.max) };
                // What holds a copy contains it whole.
                if area <= 0.0 && held == 0 {
                    at = step.skip as usize;
                    continue;
                }
                sum += step.cost * area * (ranks.len() - held) as f64;
            }
            at += 1;
        }
        sum
    }
}

enum Meeting {
    Before(u32),
    After(usize),
}

/// What tells quickly that a triangle misses a box.
struct Hull {
    min: [f64; 3],
    max: [f64; 3],
    corner: [f64; 3],
    /// Normal of its plane, of any length.
    normal: [f64; 3],
}

impl Hull {
    fn of(corners: &[[f64; 3]; 3]) -> Self {
        let [a, b, c] = *corners;
        let fold = |f: fn(f64, f64) -> f64| [0, 1, 2].map(|k| f(f(a[k], b[k]), c[k]));
        let normal = cross(minus(b, a), minus(c, a));
        Self { min: fold(f64::min), max: fold(f64::max), corner: a, normal }
    }

    /// Surely not both: a rounding error never makes it miss.
    fn misses(&self, step: &Step) -> bool {
        if (0..3).any(|k| self.min[k] > step.max[k] || self.max[k] < step.min[k]) {
            return true;
        }
        // Twice the distance of the box's centre from the plane against twice the reach of its half extents, all times the normal's length.
        let (mut distance, mut reach, mut size) = (0.0, 0.0, 0.0);
        for k in 0..3 {
            let term = (step.min[k] - self.corner[k]) + (step.max[k] - self.corner[k]);
            distance += self.normal[k] * term;
            reach += self.normal[k].abs() * (step.max[k] - step.min[k]);
            size += self.normal[k].abs() * (term.abs() + step.max[k].abs() + self.corner[k].abs());
        }
        distance.abs() > reach + 1e-12 * size
    }
}

/// Most corners of a triangle that six planes have clipped: each adds one at most.
const MOST_CORNERS: usize = 9;

/// Area of a triangle inside a closed box (Sutherland & Hodgman 1974).
fn clipped_area(corners: &[[f64; 3]; 3], min: &[f64; 3], max: &[f64; 3]) -> f64 {
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
fn polygon_area(corners: &[[f64; 3]]) -> f64 {
    let Some((&first, rest)) = corners.split_first() else { return 0.0 };
    let mut doubled = [0.0; 3];
    for pair in rest.windows(2) {
        let normal = cross(minus(pair[0], first), minus(pair[1], first));
        (0..3).for_each(|k| doubled[k] += normal[k]);
    }
    0.5 * doubled.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn corners(triangle: &Triangle) -> [[f64; 3]; 3] {
    [triangle.a, triangle.b, triangle.c].map(|corner| corner.map(f64::from))
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
#[path = "epo_tests.rs"]
mod tests;

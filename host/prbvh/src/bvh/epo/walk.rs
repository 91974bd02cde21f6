//! A triangle on its way through a tree.

use super::super::clip::{clipped_area, corners, cross, minus};
use super::super::{Bvh, Content, ROOT, SahModel};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;

/// The tree in depth-first order.
pub(super) struct Walk {
    steps: Vec<Step>,
    /// Where the references of each triangle begin among `references`, and the end: `[n + 1]`.
    starts: Vec<u32>,
    /// For each triangle the places of its references among all in depth-first order, rising, with the steps of their leaves.
    references: Vec<(u32, u32)>,
}

/// Where copies of a triangle are held.
pub(super) struct Held {
    /// Places of the references in depth-first order, rising.
    pub(super) ranks: Vec<u32>,
    /// How many triangles they are.
    pub(super) copies: usize,
    /// Areas of what the references before each hold, and of all, where a triangle has several: `[ranks + 1]`; else nothing.
    parts: Vec<f64>,
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
    pub(super) fn new(tree: &Bvh, triangles: usize, model: &SahModel) -> Self {
        assert!(tree.triangle_order.iter().all(|&triangle| (triangle as usize) < triangles), "other triangles");
        let mut steps: Vec<Step> = Vec::with_capacity(tree.nodes.len());
        // (triangle, rank, step)
        let mut references: Vec<(u32, u32, u32)> = Vec::with_capacity(tree.triangle_order.len());
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
                                references.push((triangle, rank, steps.len() as u32));
                                rank += 1;
                            }
                        }
                    }
                    steps.push(step);
                }
            }
        }
        references.sort_unstable();
        let starts = (0..=triangles as u32).map(|k| references.partition_point(|r| r.0 < k) as u32).collect();
        let references: Vec<(u32, u32)> = references.into_iter().map(|(_, rank, step)| (rank, step)).collect();
        assert!(references.len() >= triangles, "the tree is over other triangles");
        Self { steps, starts, references }
    }

    fn references_of(&self, triangle: u32) -> &[(u32, u32)] {
        let [start, end] = [0, 1].map(|k| self.starts[triangle as usize + k] as usize);
        &self.references[start..end]
    }

    /// The first place of a triangle.
    pub(super) fn first_rank(&self, triangle: u32) -> u32 {
        self.references_of(triangle).first().map_or(u32::MAX, |reference| reference.0)
    }

    /// Where copies of a triangle are held.
    pub(super) fn held(&self, copies: &[u32], triangle: &Triangle) -> Held {
        let mut references: Vec<(u32, u32)> = copies.iter().flat_map(|&id| self.references_of(id)).copied().collect();
        references.sort_unstable();
        let mut parts = Vec::new();
        if references.len() > copies.len() {
            let corners = corners(triangle);
            let mut sum = 0.0;
            parts.push(sum);
            parts.extend(references.iter().map(|&(_, step)| {
                let step = &self.steps[step as usize];
                sum += clipped_area(&corners, &step.min, &step.max);
                sum
            }));
        }
        Held { ranks: references.into_iter().map(|(rank, _)| rank).collect(), copies: copies.len(), parts }
    }

    /// `Σ C(n) · area((triangle \ Q(n)) ∩ n)` over all nodes, for all copies of the triangle, and how many boxes were looked at.
    pub(super) fn overlap(&self, corners: &[[f64; 3]; 3], held: &Held) -> (f64, u64) {
        let hull = Hull::of(corners);
        let (mut sum, mut tests) = (0.0, 0);
        let mut at = 0;
        while let Some(step) = self.steps.get(at) {
            tests += 1;
            let [first, end] = step.ranks.map(|rank| held.ranks.partition_point(|&copy| copy < rank));
            if end - first < held.ranks.len() {
                let area = if hull.misses(step) { 0.0 } else { clipped_area(corners, &step.min, &step.max) };
                // What holds a copy contains it whole, or its piece.
                if area <= 0.0 && end == first {
                    at = step.skip as usize;
                    continue;
                }
                sum += step.cost * held.missed(area, first, end);
            }
            at += 1;
        }
        (sum, tests)
    }
}

impl Held {
    /// What of all copies lies in a node and is not held by it, where `area` of one lies in the node and it has the references from `first` to `end`.
    fn missed(&self, area: f64, first: usize, end: usize) -> f64 {
        if self.parts.is_empty() {
            return area * (self.ranks.len() - (end - first)) as f64;
        }
        let missed = area * self.copies as f64 - (self.parts[end] - self.parts[first]);
        // What is left where all that lies in the node is held.
        const ROUNDING: f64 = 1e-9;
        if missed > ROUNDING * self.parts[self.ranks.len()] { missed } else { 0.0 }
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

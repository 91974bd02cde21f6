//! A triangle on its way through a tree.

use super::super::{Bvh, Content, ROOT, SahModel};
use super::clip::{clipped_area, cross, minus};
use prbvh_kernel::aabb::Aabb;

/// The tree in depth-first order.
pub(super) struct Walk {
    steps: Vec<Step>,
    /// Place of each triangle among all in depth-first order.
    pub(super) ranks: Vec<u32>,
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

    /// `Σ C(n) · area(triangle ∩ n)` over the nodes that do not hold a copy of the triangle, for all its copies, and how many boxes were looked
    /// at; `ranks` rise.
    pub(super) fn overlap(&self, corners: &[[f64; 3]; 3], ranks: &[u32]) -> (f64, u64) {
        let hull = Hull::of(corners);
        let (mut sum, mut tests) = (0.0, 0);
        let mut at = 0;
        while let Some(step) = self.steps.get(at) {
            tests += 1;
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
        (sum, tests)
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

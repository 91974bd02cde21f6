//! The best spatial split, between bins (Stich, Friedrich & Dietrich 2009, section 4.1 to 4.4).

use super::clip::{bounds_in, common};
use super::{Reference, bounds, half_area};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;

/// A plane across an axis.
pub(super) struct Spatial {
    axis: usize,
    at: f32,
    /// `area(left) · references(left) + area(right) · references(right)`.
    pub(super) cost: f64,
    left: Side,
    right: Side,
}

/// What lies on a side.
#[derive(Clone, Copy)]
struct Side {
    aabb: Aabb,
    references: usize,
}

impl Side {
    const NONE: Self = Self { aabb: Aabb::EMPTY, references: 0 };

    fn cost(&self) -> f64 {
        half_area(&self.aabb) * self.references as f64
    }
}

/// Planes between equal bins, the ends of the node's box included.
struct Planes {
    axis: usize,
    at: Vec<f32>,
}

impl Planes {
    /// None where the node is too flat for it.
    fn of(node: &Aabb, axis: usize, bins: usize) -> Option<Self> {
        let (min, max) = (f64::from(node.min[axis]), f64::from(node.max[axis]));
        let plane = |k: usize| (min + (max - min) * (k as f64 / bins as f64)) as f32;
        let mut at: Vec<f32> = (0..=bins).map(plane).collect();
        (at[0], at[bins]) = (node.min[axis], node.max[axis]);
        at.windows(2).all(|pair| pair[0] < pair[1]).then_some(Self { axis, at })
    }

    fn bins(&self) -> usize {
        self.at.len() - 1
    }

    /// The bins that a reference begins and ends in: it reaches into both, not only to them.
    fn range(&self, aabb: &Aabb) -> [usize; 2] {
        let (min, max) = (aabb.min[self.axis], aabb.max[self.axis]);
        let first = self.at.partition_point(|&plane| plane <= min).clamp(1, self.bins()) - 1;
        let last = self.at.partition_point(|&plane| plane < max).clamp(first + 1, self.bins()) - 1;
        [first, last]
    }
}

impl Spatial {
    /// The best plane, if there is one with something on both sides.
    pub(super) fn best(references: &[Reference], triangles: &[Triangle], bins: usize) -> Option<Self> {
        let node = bounds(references);
        let mut best: Option<Self> = None;
        for axis in 0..3 {
            let Some(planes) = Planes::of(&node, axis, bins) else { continue };
            let (mut entries, mut exits) = (vec![Side::NONE; bins], vec![Side::NONE; bins]);
            for reference in references {
                let [first, last] = planes.range(&reference.aabb);
                entries[first].references += 1;
                exits[last].references += 1;
                for (bin, entry) in entries.iter_mut().enumerate().take(last + 1).skip(first) {
                    let mut slab = reference.aabb;
                    if bin > first {
                        slab.min[axis] = planes.at[bin];
                    }
                    if bin < last {
                        slab.max[axis] = planes.at[bin + 1];
                    }
                    let piece = if first == last {
                        Some(reference.aabb)
                    } else {
                        bounds_in(&triangles[reference.triangle as usize], &slab)
                    };
                    if let Some(piece) = piece {
                        entry.aabb = entry.aabb.union(piece);
                    }
                }
            }
            let mut rights = vec![Side::NONE; bins + 1];
            for k in (1..bins).rev() {
                let references = rights[k + 1].references + exits[k].references;
                rights[k] = Side { aabb: rights[k + 1].aabb.union(entries[k].aabb), references };
            }
            let mut left = Side::NONE;
            for k in 1..bins {
                left.aabb = left.aabb.union(entries[k - 1].aabb);
                left.references += entries[k - 1].references;
                let right = rights[k];
                let cost = left.cost() + right.cost();
                if left.references > 0 && right.references > 0 && best.as_ref().is_none_or(|best| cost < best.cost) {
                    best = Some(Self { axis, at: planes.at[k], cost, left, right });
                }
            }
        }
        best
    }

    /// The references of both sides; none if they are more than the budget allows, or all are on one.
    pub(super) fn part(
        &self,
        references: &[Reference],
        triangles: &[Triangle],
        unsplits: bool,
        budget: usize,
    ) -> Option<[Vec<Reference>; 2]> {
        let (axis, at) = (self.axis, self.at);
        let (mut sides, mut across) = ([Vec::new(), Vec::new()], Vec::new());
        for &reference in references {
            if reference.aabb.max[axis] <= at {
                sides[0].push(reference);
            } else if reference.aabb.min[axis] >= at {
                sides[1].push(reference);
            } else {
                across.push(reference);
            }
        }
        let (mut left, mut right) = (self.left, self.right);
        for reference in across {
            let (mut below, mut above) = (reference.aabb, reference.aabb);
            (below.max[axis], above.min[axis]) = (at, at);
            let triangle = &triangles[reference.triangle as usize];
            let pieces = [bounds_in(triangle, &below), bounds_in(triangle, &above)];
            let with = |aabb| Reference { aabb, ..reference };
            let [Some(below), Some(above)] = pieces else {
                // What is computed to be nothing is none.
                sides[usize::from(pieces[0].is_none())].push(reference);
                continue;
            };
            let whole = |side: &Side| Side { aabb: side.aabb.union(reference.aabb), ..*side };
            let less = |side: &Side| Side { references: side.references - 1, ..*side };
            let both = left.cost() + right.cost();
            let to_left = whole(&left).cost() + less(&right).cost();
            let to_right = less(&left).cost() + whole(&right).cost();
            if unsplits && to_left.min(to_right) < both {
                if to_left <= to_right {
                    (left, right) = (whole(&left), less(&right));
                    sides[0].push(reference);
                } else {
                    (left, right) = (less(&left), whole(&right));
                    sides[1].push(reference);
                }
            } else {
                sides[0].push(with(common(&below, &reference.aabb)));
                sides[1].push(with(common(&above, &reference.aabb)));
            }
        }
        let more = sides[0].len() + sides[1].len() - references.len();
        // Where nothing more came of it, neither side has all.
        (more <= budget && sides.iter().all(|side| !side.is_empty())).then_some(sides)
    }
}

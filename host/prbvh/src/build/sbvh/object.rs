//! The best object split, by a sweep over the sorted centres of each axis.

use super::{Reference, half_area};
use prbvh_kernel::aabb::Aabb;

/// An object split of references, which are in its order.
pub(super) struct ObjectSplit {
    /// References on the left, which come first.
    pub(super) left: usize,
    /// `area(left) · references(left) + area(right) · references(right)`.
    pub(super) cost: f64,
    pub(super) left_box: Aabb,
    pub(super) right_box: Aabb,
}

/// Twice the centre, in f64: of the largest coordinates, too.
fn centre(reference: &Reference, axis: usize) -> f64 {
    f64::from(reference.aabb.min[axis]) + f64::from(reference.aabb.max[axis])
}

fn sort(references: &mut [Reference], axis: usize) {
    // The order of equal centres is given by the references: it does not depend on the axis before.
    let key = |a: &Reference, b: &Reference| {
        let by_box = || {
            let words = |r: &Reference| [r.aabb.min, r.aabb.max].map(|corner| corner.map(f32::to_bits));
            words(a).cmp(&words(b))
        };
        centre(a, axis).total_cmp(&centre(b, axis)).then(a.triangle.cmp(&b.triangle)).then_with(by_box)
    };
    references.sort_unstable_by(key);
}

/// The best split of at least two references; of equally good ones the one closest to the middle, so that equal boxes make a balanced tree, then the first axis.
pub(super) fn best(references: &mut [Reference]) -> ObjectSplit {
    let n = references.len();
    let mut best: Option<(usize, ObjectSplit)> = None;
    let mut right_boxes = vec![Aabb::EMPTY; n];
    let mut sorted_by = 0;
    for axis in 0..3 {
        sort(references, axis);
        sorted_by = axis;
        let mut sum = Aabb::EMPTY;
        for k in (1..n).rev() {
            sum = sum.union(references[k].aabb);
            right_boxes[k] = sum;
        }
        let mut left_box = Aabb::EMPTY;
        for left in 1..n {
            left_box = left_box.union(references[left - 1].aabb);
            let right_box = right_boxes[left];
            let cost = half_area(&left_box) * left as f64 + half_area(&right_box) * (n - left) as f64;
            let off_middle = |left: usize| (2 * left).abs_diff(n);
            let beats = best.as_ref().is_none_or(|(_, best)| {
                cost < best.cost || (cost == best.cost && off_middle(left) < off_middle(best.left))
            });
            if beats {
                best = Some((axis, ObjectSplit { left, cost, left_box, right_box }));
            }
        }
    }
    let Some((axis, split)) = best else { unreachable!("two references have a split") };
    if axis != sorted_by {
        sort(references, axis);
    }
    split
}

//! The best of all trees over a few boxes, by looking at all of them.

use crate::oracle::half_area;
use prbvh_kernel::aabb::Aabb;

/// Least sum of the half areas of internal nodes, the root among them, of all binary trees over `boxes`: nothing is remembered from one tree to the next.
///
/// # Panics
/// If there are no boxes.
#[must_use]
pub fn least_internal_area(boxes: &[Aabb]) -> f64 {
    let all = boxes.iter().copied().reduce(Aabb::union).expect("a tree has leaves");
    if boxes.len() == 1 {
        return 0.0;
    }
    // The first box is on the left: the others mirror these.
    let others = boxes.len() - 1;
    let split = |chosen: u32| {
        let is_left = |k: usize| k == 0 || chosen >> (k - 1) & 1 == 1;
        let side =
            |left: bool| -> Vec<Aabb> { (0..boxes.len()).filter(|&k| is_left(k) == left).map(|k| boxes[k]).collect() };
        least_internal_area(&side(true)) + least_internal_area(&side(false))
    };
    half_area(&all) + (0..(1u32 << others) - 1).map(split).fold(f64::INFINITY, f64::min)
}

/// As [`least_internal_area`], for up to a dozen boxes: the best tree over each set of them is remembered. There are `3^n` ways to halve the sets.
///
/// # Panics
/// If there are no boxes, or so many that nobody would wait.
#[must_use]
pub fn least_area_by_subsets(boxes: &[Aabb]) -> f64 {
    assert!((1..=14).contains(&boxes.len()), "{} boxes", boxes.len());
    let sets = 1usize << boxes.len();
    let mut best = vec![0.0; sets];
    for set in 1..sets {
        if set.count_ones() < 2 {
            continue;
        }
        let members = (0..boxes.len()).filter(|k| set >> k & 1 == 1).map(|k| boxes[k]);
        let own = half_area(&members.reduce(Aabb::union).expect("a set has boxes"));
        let (mut left, mut least) = ((set - 1) & set, f64::INFINITY);
        while left > 0 {
            least = f64::min(least, best[left] + best[set ^ left]);
            left = (left - 1) & set;
        }
        best[set] = own + least;
    }
    best[sets - 1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::soup;
    use crate::oracle::random_tree;
    use prbvh_kernel::setup::Triangle;

    #[test]
    fn no_tree_is_better_and_some_tree_is_as_good() {
        for n in 2..=5 {
            let boxes: Vec<Aabb> = soup(n, 0.3, n as u64).iter().map(Triangle::aabb).collect();
            let least = least_internal_area(&boxes);
            let areas: Vec<f64> = (0..2000).map(|seed| random_tree(&boxes, seed).internal_area()).collect();
            let lowest = areas.iter().copied().fold(f64::INFINITY, f64::min);
            // 105 trees at the most.
            assert!((lowest / least - 1.0).abs() < 1e-6, "{n}: {least} {lowest}");
            assert!((least_area_by_subsets(&boxes) / least - 1.0).abs() < 1e-12, "{n}");
        }
    }
}

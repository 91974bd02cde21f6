//! SBVH (Stich, Friedrich & Dietrich 2009): a tree by SAH over object splits and spatial splits, which put a triangle into several leaves.

mod clip;
mod object;
mod spatial;

use crate::bvh::{Bvh, BvhNode, Content, NO_NODE};
use crate::check::{SettingError, must, no_negative};
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use spatial::Spatial;

/// When a node is split in space.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct SbvhSettings {
    /// Spatial splits are tried where the children of the best object split overlap in more than this part of the root's area (section 4.5).
    pub alpha: f64,
    /// Bins of each axis between which spatial splits are tried, at least 2.
    pub bins: u32,
    /// Most further references, as a part of the triangles.
    pub budget: f64,
    /// Whether a reference goes to one side alone where that costs less than to have it on both (section 4.4).
    pub unsplit: bool,
}

impl Default for SbvhSettings {
    /// α as in the paper.
    fn default() -> Self {
        Self { alpha: 1e-5, bins: 32, budget: 0.3, unsplit: true }
    }
}

impl SbvhSettings {
    /// # Errors
    /// The first field whose value makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        no_negative("sbvh.alpha", self.alpha)?;
        must("sbvh.bins", self.bins, (2..=256).contains(&self.bins), "from 2 to 256")?;
        must("sbvh.budget", self.budget, (0.0..=16.0).contains(&self.budget), "from 0 to 16")
    }

    /// Most further references of so many triangles.
    #[must_use]
    pub fn most_splits(&self, triangles: usize) -> usize {
        // At most 16 · 2^30.
        (self.budget * triangles as f64) as usize
    }
}

/// A piece of a triangle, or all of it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reference {
    aabb: Aabb,
    triangle: u32,
}

/// References that a node is made of, and how many more they may become.
struct Task {
    node: u32,
    references: Vec<Reference>,
    budget: usize,
}

/// Builds a tree with one reference per leaf on the CPU, with all threads of the current rayon pool; the tree does not depend on their number. `triangles` are finite
/// and of any size: areas and cuts are computed in f64. Leaves have the boxes of the pieces, no smaller than these.
///
/// A node's budget is shared among its children by the areas of their references: so it does not depend on the order of the work. What a subtree does not need of it is lost to the others; so while much
/// of the budget is left, the tree is built again as if there were as much more, and the last one within the budget is taken.
///
/// None of no triangles, or if an end was asked for.
#[must_use]
pub fn sbvh(triangles: &[Triangle], settings: &SbvhSettings, stop: Option<&Stop>) -> Option<Bvh> {
    let most = settings.most_splits(triangles.len());
    let mut tree = with_budget(triangles, settings, most, stop)?;
    let (mut budget, mut too_much) = (most, None);
    for _ in 0..MOST_AGAIN {
        let used = tree.references() - triangles.len();
        if used == 0 || used as f64 > ENOUGH * most as f64 {
            break;
        }
        // Mostly each further reference needs more of it than the ones before.
        let more = match too_much {
            None => (budget as f64 * (most as f64 / used as f64)) as usize,
            Some(too_much) => usize::midpoint(budget, too_much),
        };
        let other = with_budget(triangles, settings, more, stop)?;
        match other.references() - triangles.len() {
            other_used if other_used > most => too_much = Some(more),
            other_used if other_used > used => (tree, budget) = (other, more),
            // All is split that pays.
            _ => break,
        }
    }
    Some(tree)
}

/// Most further builds, and the part of the budget with which there is none.
const MOST_AGAIN: usize = 4;
const ENOUGH: f64 = 0.97;

/// The tree by a budget that is handed down.
fn with_budget(triangles: &[Triangle], settings: &SbvhSettings, budget: usize, stop: Option<&Stop>) -> Option<Bvh> {
    let references: Vec<Reference> =
        (0..).zip(triangles).map(|(triangle, t)| Reference { aabb: t.aabb(), triangle }).collect();
    if references.is_empty() {
        return None;
    }
    let root = bounds(&references);
    let least_overlap = settings.alpha * half_area(&root);
    let mut tree = Bvh { nodes: vec![node(root, NO_NODE)], triangle_order: Vec::new() };
    let mut tasks = vec![Task { node: 0, references, budget }];
    while !tasks.is_empty() {
        if stop.is_some_and(Stop::is_asked) {
            return None;
        }
        let split = |task: &mut Task| {
            let references = std::mem::take(&mut task.references);
            (references.len() > 1)
                .then(|| halves(references, task.budget, triangles, (settings, least_overlap)))
                .ok_or(task.node)
        };
        // A level at a time: the order of the nodes is that of the level.
        let single: Vec<u32> =
            tasks.iter().filter(|t| t.references.len() == 1).map(|t| t.references[0].triangle).collect();
        let mut single = single.into_iter();
        let split: Vec<_> = tasks.par_iter_mut().map(split).collect();
        let mut below = Vec::with_capacity(2 * split.len());
        for (task, children) in tasks.iter().zip(split) {
            let v = task.node as usize;
            match children {
                Err(_) => {
                    tree.nodes[v].content = Content::Leaf { first: tree.triangle_order.len() as u32, count: 1 };
                    tree.triangle_order.extend(single.next());
                }
                Ok(children) => {
                    let first = tree.nodes.len() as u32;
                    tree.nodes[v].content = Content::Internal { left: first, right: first + 1 };
                    for (node_id, (references, budget)) in (first..).zip(children) {
                        tree.nodes.push(node(bounds(&references), v as u32));
                        below.push(Task { node: node_id, references, budget });
                    }
                }
            }
        }
        tasks = below;
    }
    // Pieces may be less than what they were cut from.
    Some(tree.with_boxes_of_leaves())
}

fn node(aabb: Aabb, parent: u32) -> BvhNode {
    BvhNode { aabb, parent, content: Content::Leaf { first: 0, count: 0 } }
}

/// The references of both children, and their budgets.
fn halves(
    mut references: Vec<Reference>,
    budget: usize,
    triangles: &[Triangle],
    (settings, least_overlap): (&SbvhSettings, f64),
) -> [(Vec<Reference>, usize); 2] {
    let object = object::best(&mut references);
    let mut children = None;
    if budget > 0 && overlap(&object.left_box, &object.right_box) > least_overlap {
        let spatial = Spatial::best(&references, triangles, settings.bins as usize);
        if let Some(spatial) = spatial.filter(|spatial| spatial.cost < object.cost) {
            children = spatial.part(&references, triangles, settings.unsplit, budget);
        }
    }
    let count = references.len();
    let [left, right] = children.unwrap_or_else(|| {
        let right = references.split_off(object.left);
        [references, right]
    });
    let left_over = budget - (left.len() + right.len() - count);
    let weight = |part: &[Reference]| part.iter().map(|reference| half_area(&reference.aabb)).sum::<f64>();
    let (lower, upper) = (weight(&left), weight(&right));
    let of_left = if lower + upper > 0.0 { (left_over as f64 * (lower / (lower + upper))).round() } else { 0.0 };
    let of_left = (of_left as usize).min(left_over);
    [(left, of_left), (right, left_over - of_left)]
}

fn bounds(references: &[Reference]) -> Aabb {
    references.iter().fold(Aabb::EMPTY, |sum, reference| sum.union(reference.aabb))
}

/// Half the surface area; 0 of a box that holds nothing.
fn half_area(aabb: &Aabb) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| f64::from(aabb.max[k]) - f64::from(aabb.min[k]));
    if x < 0.0 || y < 0.0 || z < 0.0 { 0.0 } else { x * y + y * z + z * x }
}

/// Half the surface area of what two boxes share.
fn overlap(one: &Aabb, other: &Aabb) -> f64 {
    half_area(&clip::common(one, other))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::validate_tree;
    use crate::scene::built_in;
    use proptest::prelude::*;

    #[test]
    fn a_long_triangle_between_small_ones_is_cut() {
        // The diagonal of a square with small ones at both of its ends: with it on either side, an object split leaves a box of the whole square.
        let small = |k: u32| {
            let at = if k.is_multiple_of(2) { 0.0 } else { 9.0 } + 0.1 * k as f32;
            Triangle { a: [at, at, 0.0], b: [at + 0.1, at, 0.0], c: [at, at + 0.1, 0.1] }
        };
        let long = Triangle { a: [0.0; 3], b: [10.0, 10.0, 0.0], c: [10.0, 10.0, 0.1] };
        let triangles: Vec<Triangle> = (0..10).map(small).chain([long]).collect();
        let settings = SbvhSettings { budget: 16.0, ..SbvhSettings::default() };
        let tree = sbvh(&triangles, &settings, None).unwrap();
        validate_tree(&tree, &triangles).unwrap();
        let of_long = tree.triangle_order.iter().filter(|&&triangle| triangle == 10).count();
        assert!(of_long > 1 && tree.references() == 10 + of_long, "{of_long} of {}", tree.references());
        let none = SbvhSettings { budget: 0.0, ..settings };
        assert_eq!(sbvh(&triangles, &none, None).unwrap().references(), 11);
    }

    #[test]
    fn what_is_left_of_the_budget_is_used() {
        let triangles = &*built_in(2000).triangles;
        let used = [0.1, 0.3].map(|budget| {
            let settings = SbvhSettings { budget, ..SbvhSettings::default() };
            let most = settings.most_splits(2000);
            let once = with_budget(triangles, &settings, most, None).unwrap().references() - 2000;
            let again = sbvh(triangles, &settings, None).unwrap().references() - 2000;
            assert!(once <= again && again <= most, "{once} {again} {most}");
            (once as f64 / most as f64, again as f64 / most as f64)
        });
        assert!(used.iter().any(|(once, again)| once < again), "{used:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(30))]
        #[test]
        fn trees_are_valid_and_within_the_budget(
            n in 1usize..300, budget in 0.0f64..2.0, unsplit: bool, bins in 2u32..40,
        ) {
            let triangles = &built_in(1000).triangles[1000 - n..];
            let settings = SbvhSettings { budget, unsplit, bins, ..SbvhSettings::default() };
            let tree = sbvh(triangles, &settings, None).unwrap();
            let stats = validate_tree(&tree, triangles).map_err(|faults| TestCaseError::fail(format!("{faults:?}")))?;
            prop_assert!(tree.references() <= n + settings.most_splits(n));
            prop_assert_eq!(stats.leaves as usize, tree.references());
        }
    }
}

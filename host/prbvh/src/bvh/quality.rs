//! How good a tree is: SAH cost, in f64, depth and stack, for any tree over any triangles.

use super::{Bvh, Content, ROOT};
use prbvh_kernel::aabb::Aabb;

/// Costs of the surface area heuristic (MacDonald & Booth 1990), unitless.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SahModel {
    /// A step of the traversal through an internal node.
    pub c_traversal: f64,
    /// A test of a ray against a triangle.
    pub c_intersect: f64,
}

impl Default for SahModel {
    /// As in Meister & Bittner 2018: 3 and 2.
    fn default() -> Self {
        Self { c_traversal: 3.0, c_intersect: 2.0 }
    }
}

/// Quality of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Quality {
    /// `(c_traversal · Σ area(internal) + c_intersect · Σ area(leaf) · triangles) / area(root)`, unitless.
    ///
    /// The areas are taken in f64 from the f32 boxes and summed in depth-first order: one tree has one cost, however its nodes are
    /// numbered. A root of zero area (all triangles on a line) is hit by no random ray; every ratio then counts as 1, which is
    /// the cost of visiting all: `c_traversal · internal + c_intersect · triangles`.
    pub sah_cost: f64,
    /// Most links between the root and a leaf.
    pub max_depth: u32,
    /// Entries that the stack of an ordered traversal needs: of a node whose boxes of both children a ray enters, the nearer child is
    /// visited next, and a reference to the farther one, a leaf or not, waits on the stack (Aila & Laine 2009; the kernels `trace_*`).
    ///
    /// The most over all rays, where either child may be the nearer one at each node: the most internal nodes on a way from the root to a
    /// leaf, for at each of them one entry may wait. That is [`Quality::max_depth`], and no order of visits needs more. A traversal that
    /// pushes both children and takes one off again needs one more, and so does one with a mark at the bottom.
    pub stack: u32,
    /// Mean number of links between the root and a leaf.
    pub mean_leaf_depth: f64,
    /// Nodes, leaves included.
    pub nodes: u32,
    /// Leaves.
    pub leaves: u32,
    /// Triangles.
    pub triangles: u32,
    /// Whether the root's box has no area, so that every ratio counts as 1.
    #[cfg_attr(feature = "serde", serde(default))]
    pub is_root_flat: bool,
}

/// Measures a valid tree.
///
/// # Panics
/// If the links are no tree.
#[must_use]
pub fn quality(tree: &Bvh, model: &SahModel) -> Quality {
    let root = half_area(&tree.nodes[ROOT as usize].aabb);
    let ratio = |aabb: &Aabb| if root > 0.0 { half_area(aabb) / root } else { 1.0 };
    let (mut internal, mut leaf) = (0.0, 0.0);
    let mut measured = Quality { is_root_flat: root <= 0.0, ..Quality::default() };
    let mut depth_sum = 0u64;
    let mut stack = vec![(ROOT, 0)];
    while let Some((v, depth)) = stack.pop() {
        assert!((measured.nodes as usize) < tree.nodes.len(), "the links are no tree");
        measured.nodes += 1;
        let node = &tree.nodes[v as usize];
        match node.content {
            Content::Internal { left, right } => {
                internal += ratio(&node.aabb);
                // One for each internal node above, and its own.
                measured.stack = measured.stack.max(depth + 1);
                stack.push((right, depth + 1));
                stack.push((left, depth + 1));
            }
            Content::Leaf { count, .. } => {
                leaf += ratio(&node.aabb) * f64::from(count);
                measured.leaves += 1;
                measured.triangles += count;
                measured.max_depth = measured.max_depth.max(depth);
                depth_sum += u64::from(depth);
            }
        }
    }
    measured.sah_cost = model.c_traversal * internal + model.c_intersect * leaf;
    measured.mean_leaf_depth = depth_sum as f64 / f64::from(measured.leaves);
    measured
}

/// Half the surface area, scene units². Extents of the largest f32 give 1e78: no overflow.
pub(crate) fn half_area(aabb: &Aabb) -> f64 {
    let [dx, dy, dz] = std::array::from_fn(|k| f64::from(aabb.max[k]) - f64::from(aabb.min[k]));
    dx * dy + dy * dz + dz * dx
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Rng, renumbered, tree};
    use super::super::{BvhNode, NO_NODE};
    use super::*;
    use proptest::prelude::*;

    /// A root with two leaves of 1 and 3 triangles.
    fn three_boxes(root: Aabb, left: Aabb, right: Aabb) -> Bvh {
        let leaf = |aabb, first, count| BvhNode { aabb, parent: ROOT, content: Content::Leaf { first, count } };
        let root = BvhNode { aabb: root, parent: NO_NODE, content: Content::Internal { left: 1, right: 2 } };
        Bvh { nodes: vec![root, leaf(left, 0, 1), leaf(right, 1, 3)], triangle_order: vec![0, 1, 2, 3] }
    }

    fn cube(min: f32, max: f32) -> Aabb {
        Aabb { min: [min; 3], max: [max; 3] }
    }

    #[test]
    fn cost_by_hand() {
        let tree = three_boxes(cube(0.0, 4.0), cube(0.0, 1.0), cube(2.0, 4.0));
        let measured = quality(&tree, &SahModel::default());
        assert_eq!(measured.sah_cost, 3.0 + 2.0 * (1.0 / 16.0) + 2.0 * 3.0 * (4.0 / 16.0));
        assert_eq!((measured.nodes, measured.leaves, measured.triangles), (3, 2, 4));
        assert_eq!((measured.max_depth, measured.mean_leaf_depth), (1, 1.0));
        let other = SahModel { c_traversal: 0.0, c_intersect: 16.0 };
        assert_eq!(quality(&tree, &other).sah_cost, 1.0 + 12.0);
    }

    #[test]
    fn a_single_leaf_costs_one_test() {
        let measured = quality(&tree(1, 4).1, &SahModel::default());
        assert_eq!((measured.sah_cost, measured.max_depth, measured.mean_leaf_depth), (2.0, 0, 0.0));
    }

    /// The most entries of an ordered traversal, by trying both orders at every internal node: `first` has a bit for each.
    fn most_entries(tree: &Bvh) -> u32 {
        let internal = tree.nodes.len() / 2;
        let entries = |first: u32| {
            let (mut stack, mut most) = (Vec::new(), 0);
            let mut next = Some(ROOT);
            while let Some(v) = next {
                next = match tree.nodes[v as usize].content {
                    Content::Internal { left, right } => {
                        let (near, far) = if first >> v & 1 == 0 { (left, right) } else { (right, left) };
                        stack.push(far);
                        most = most.max(stack.len() as u32);
                        Some(near)
                    }
                    Content::Leaf { .. } => stack.pop(),
                };
            }
            most
        };
        (0..1 << internal).map(entries).max().unwrap_or(0)
    }

    #[test]
    fn some_ray_fills_the_stack_and_none_needs_more() {
        for seed in 0..40 {
            let (_, tree) = tree(1 + seed as usize % 9, seed);
            let measured = quality(&tree, &SahModel::default());
            assert_eq!(measured.stack, most_entries(&tree), "{tree:?}");
            assert_eq!(measured.stack, measured.max_depth);
        }
    }

    #[test]
    fn a_root_of_no_area_costs_a_visit_of_all() {
        let tree = three_boxes(cube(1.0, 1.0), cube(1.0, 1.0), cube(1.0, 1.0));
        let measured = quality(&tree, &SahModel::default());
        assert_eq!((measured.sah_cost, measured.is_root_flat), (3.0 + 2.0 * 4.0, true));
    }

    #[test]
    fn extents_at_both_ends_of_f32() {
        for max in [3e38f32, 1e-45] {
            let tree = three_boxes(cube(-max, max), cube(-max, max), cube(-max, max));
            let measured = quality(&tree, &SahModel::default());
            assert_eq!((measured.sah_cost, measured.is_root_flat), (3.0 + 2.0 * 4.0, false));
        }
    }

    proptest! {
        #[test]
        fn numbering_does_not_change_a_bit(n in 1usize..100, seed: u64) {
            let (_, tree) = tree(n, seed);
            let model = SahModel::default();
            let other = renumbered(&tree, &mut Rng::new(seed));
            prop_assert_eq!(quality(&tree, &model), quality(&other, &model));
        }

        #[test]
        fn cost_is_the_sum_of_its_definition(n in 2usize..100, seed: u64) {
            let (_, tree) = tree(n, seed);
            let area = |v: usize| half_area(&tree.nodes[v].aabb);
            let internal: f64 = (0..n - 1).map(area).sum();
            let leaves: f64 = (n - 1..2 * n - 1).map(area).sum();
            let expected = (3.0 * internal + 2.0 * leaves) / area(0);
            let cost = quality(&tree, &SahModel::default()).sah_cost;
            prop_assert!((cost - expected).abs() <= 1e-12 * expected, "{} is not {}", cost, expected);
        }
    }
}

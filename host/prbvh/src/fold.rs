//! Triangles of equal boxes as one reference, from the initial tree to the optimised one.
//!
//! A tree is made of boxes, so that triangles with one box are one reference to the builder and to the optimiser: the two halves of a quad
//! that is in line with the axes, or copies. Afterwards the leaf becomes a subtree of them. Any such subtree costs the same, and none of them would
//! be better off elsewhere: beside its equal it adds the area of its own box, and no place adds less.

use crate::bvh::{Bvh, BvhNode, Content, SahModel};
use crate::optimize::{IterationRow, set_relative_errors};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// Classes of triangles with equal boxes, bit for bit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fold {
    /// Triangles, class by class, ascending in each; classes by their first triangles.
    members: Vec<u32>,
    /// First places of the classes in `members`, and the end.
    starts: Vec<u32>,
}

impl Fold {
    /// The classes of at least one triangle.
    pub(crate) fn of(triangles: &[Triangle]) -> Self {
        let key = |(index, triangle): (usize, &Triangle)| -> ([u32; 6], u32) {
            (bytemuck::cast(triangle.aabb()), index as u32)
        };
        let mut sorted: Vec<_> = triangles.par_iter().enumerate().map(key).collect();
        sorted.par_sort_unstable();
        let mut classes: Vec<&[([u32; 6], u32)]> = sorted.chunk_by(|x, y| x.0 == y.0).collect();
        classes.par_sort_unstable_by_key(|class| class[0].1);
        let mut fold = Self { members: Vec::with_capacity(triangles.len()), starts: vec![0] };
        for class in classes {
            fold.members.extend(class.iter().map(|(_, index)| index));
            fold.starts.push(fold.members.len() as u32);
        }
        fold
    }

    /// Classes.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Triangles that are no reference of their own.
    pub(crate) fn folded(&self) -> usize {
        self.members.len() - self.len()
    }

    /// Nothing for a class that there is not.
    fn class(&self, class: u32) -> &[u32] {
        match self.starts.get(class as usize..) {
            Some(&[start, end, ..]) => &self.members[start as usize..end as usize],
            _ => &[],
        }
    }

    /// The first triangle of each class.
    pub(crate) fn references(&self, triangles: &[Triangle]) -> Vec<Triangle> {
        self.starts[..self.len()].iter().map(|start| triangles[self.members[*start as usize] as usize]).collect()
    }

    /// The tree over the triangles, from one over the classes with a class in each leaf. The leaf of a class that there is not holds
    /// nothing, which is a fault of the tree.
    pub(crate) fn unfold(&self, tree: Bvh) -> Bvh {
        let Bvh { mut nodes, triangle_order } = tree;
        nodes.reserve_exact(2 * self.folded());
        let mut unfolded = Vec::with_capacity(self.members.len());
        let mut stack = Vec::new();
        for v in 0..nodes.len() {
            if let Content::Leaf { first, .. } = nodes[v].content {
                let class = self.class(triangle_order.get(first as usize).copied().unwrap_or(u32::MAX));
                stack.push((v as u32, unfolded.len() as u32, class.len() as u32));
                unfolded.extend_from_slice(class);
                split(&mut nodes, &mut stack);
            }
        }
        Bvh { nodes, triangle_order: unfolded }
    }

    /// What unfolding adds to the SAH cost: a node and a triangle for each one folded. Where the root has no area every ratio counts as 1.
    pub(crate) fn added_cost(&self, triangles: &[Triangle], sah: &SahModel) -> f64 {
        let root = self.references(triangles).iter().map(Triangle::aabb).fold(Aabb::EMPTY, Aabb::union);
        let root_area = half_area(&root);
        let of_class = |pair: &[u32]| {
            let aabb = triangles[self.members[pair[0] as usize] as usize].aabb();
            let ratio = if root_area > 0.0 { half_area(&aabb) / root_area } else { 1.0 };
            f64::from(pair[1] - pair[0] - 1) * ratio
        };
        (sah.c_traversal + sah.c_intersect) * self.starts.windows(2).map(of_class).sum::<f64>()
    }
}

/// Makes subtrees of the leaves on the stack: (node, first place, places).
fn split(nodes: &mut Vec<BvhNode>, stack: &mut Vec<(u32, u32, u32)>) {
    while let Some((v, first, count)) = stack.pop() {
        if count < 2 {
            nodes[v as usize].content = Content::Leaf { first, count };
            continue;
        }
        let (left, right) = (nodes.len() as u32, nodes.len() as u32 + 1);
        let child = BvhNode { parent: v, ..nodes[v as usize] };
        nodes.extend([child, child]);
        nodes[v as usize].content = Content::Internal { left, right };
        stack.extend([(left, first, count / 2), (right, first + count / 2, count - count / 2)]);
    }
}

fn half_area(aabb: &Aabb) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| f64::from(aabb.max[k]) - f64::from(aabb.min[k]));
    x * y + y * z + z * x
}

/// A row of the folded tree as one of the whole tree, which costs `added` more.
pub(crate) fn unfolded_row(row: &IterationRow, added: f64) -> IterationRow {
    IterationRow { cost: row.cost + added, ..*row }
}

/// The same of all rows.
pub(crate) fn unfold_rows(rows: &mut [IterationRow], added: f64) {
    for row in &mut *rows {
        row.cost += added;
    }
    set_relative_errors(rows);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::sah_sweep;
    use crate::bvh::{quality, validate};
    use crate::scene::built_in;
    use proptest::prelude::*;

    /// Some of the built-in scene, some of it again.
    fn scene(n: usize, again: &[usize]) -> Vec<Triangle> {
        let mut triangles = built_in(1000).triangles[..n].to_vec();
        triangles.extend(again.iter().map(|k| triangles[k % n]).collect::<Vec<_>>());
        triangles
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn an_unfolded_tree_is_a_tree_of_the_cost_said(n in 1usize..60, again in prop::collection::vec(0usize..60, 0..80)) {
            let triangles = scene(n, &again);
            let fold = Fold::of(&triangles);
            prop_assert_eq!(fold.len() + fold.folded(), triangles.len());
            prop_assert!(fold.folded() >= again.len());
            let references = fold.references(&triangles);
            let folded = Bvh::from_device(&sah_sweep(&references)).unwrap();
            let folded_cost = quality(&folded, &SahModel::default()).sah_cost;
            let whole = fold.unfold(folded).with_boxes_of(&triangles);
            prop_assert!(validate(&whole, Some(&triangles)).is_ok());
            let cost = quality(&whole, &SahModel::default()).sah_cost;
            let said = folded_cost + fold.added_cost(&triangles, &SahModel::default());
            prop_assert!((cost - said).abs() <= 1e-9 * cost, "{} is not {}", cost, said);
        }
    }

    #[test]
    fn equal_boxes_are_one_reference_and_others_are_not() {
        let quad = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let half = |corners: [usize; 3]| {
            let [a, b, c] = corners.map(|k| quad[k]);
            Triangle { a, b, c }
        };
        let other = Triangle { a: [0.0; 3], b: [1.0, 1.0, 1e-30], c: [0.0; 3] };
        let fold = Fold::of(&[half([0, 1, 2]), other, half([0, 2, 3])]);
        assert_eq!((fold.len(), fold.folded()), (2, 1));
        assert_eq!((fold.class(0), fold.class(1), fold.class(2)), (&[0, 2][..], &[1][..], &[][..]));
    }

    #[test]
    fn a_planted_reference_to_no_class_is_found() {
        let triangles = scene(20, &[1, 2, 3]);
        let fold = Fold::of(&triangles);
        let mut tree = Bvh::from_device(&sah_sweep(&fold.references(&triangles))).unwrap();
        tree.triangle_order[3] = 1000;
        assert!(validate(&fold.unfold(tree).with_boxes_of(&triangles), Some(&triangles)).is_err());
    }
}

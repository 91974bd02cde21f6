//! Trees over references: a primitive may be in several leaves, each of which holds a piece of it (spatial splits; Stich, Friedrich & Dietrich 2009).

use super::clip::{clipped_area, corners, polygon_area};
use super::validate::{Check, TreeStats, validate};
use super::{Bvh, Content, TreeFault};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

impl Bvh {
    /// Whether a triangle of a valid tree over so many is in several leaves, so that its leaves have boxes of pieces: there are more references than triangles.
    #[must_use]
    pub fn has_splits(&self, triangles: usize) -> bool {
        self.triangle_order.len() > triangles
    }

    /// References: triangles, each counted once for every leaf that it is in.
    #[must_use]
    pub fn references(&self) -> usize {
        self.triangle_order.len()
    }
}

/// [`validate`](super::validate()) of a tree over `triangles`; of one [with splits](Bvh::has_splits) as [`validate_references`], and that the pieces of each triangle leave no hole in it: their areas
/// add up to its own.
///
/// # Errors
/// All faults, structure before boxes before holes.
pub fn validate_tree(tree: &Bvh, triangles: &[Triangle]) -> Result<TreeStats, Vec<TreeFault>> {
    if !tree.has_splits(triangles.len()) {
        return validate(tree, Some(triangles));
    }
    let boxes: Vec<Aabb> = triangles.par_iter().map(Triangle::aabb).collect();
    let stats = validate_references(tree, &boxes)?;
    let faults = holes(tree, triangles);
    if faults.is_empty() { Ok(stats) } else { Err(faults) }
}

/// Parts of its own area, and of the square of its extent, by which the pieces of a triangle may seem to be less: roundings of float64.
const OF_AREA: f64 = 1e-6;
const OF_EXTENT: f64 = 1e-13;

/// Triangles whose pieces are less than they.
fn holes(tree: &Bvh, triangles: &[Triangle]) -> Vec<TreeFault> {
    let mut held = vec![0u32; triangles.len()];
    tree.triangle_order.iter().for_each(|&triangle| held[triangle as usize] += 1);
    let of_leaf = |node: &super::BvhNode| -> Vec<(u32, f64)> {
        let Content::Leaf { first, count } = node.content else { return Vec::new() };
        let split = tree.triangles_of(first, count).iter().filter(|&&triangle| held[triangle as usize] > 1);
        let [min, max] = [node.aabb.min, node.aabb.max].map(|corner| corner.map(f64::from));
        split.map(|&t| (t, clipped_area(&corners(&triangles[t as usize]), &min, &max))).collect()
    };
    let parts: Vec<(u32, f64)> = tree.nodes.par_iter().flat_map_iter(of_leaf).collect();
    let mut areas = vec![0.0; triangles.len()];
    parts.iter().for_each(|&(triangle, area)| areas[triangle as usize] += area);
    let fault = |(triangle, &have): (usize, &f64)| {
        let of = &triangles[triangle];
        let need = polygon_area(&corners(of));
        let Aabb { min, max } = of.aabb();
        let extent = (0..3).map(|k| f64::from(max[k]) - f64::from(min[k])).fold(0.0, f64::max);
        let is_whole = have >= need * (1.0 - OF_AREA) - extent * extent * OF_EXTENT;
        (held[triangle] > 1 && !is_whole).then_some(TreeFault::Hole { triangle: triangle as u32, have, need })
    };
    areas.iter().enumerate().filter_map(fault).collect()
}

/// As [`validate`](super::validate()), but primitives may be in more than one leaf. `boxes` are those of the primitives, `triangle_order` holds their
/// numbers. Checks that
/// - links are those of a tree, and every position is in one leaf;
/// - every primitive is in at least one leaf;
/// - every box is finite, and equals the union of its children's;
/// - the pieces of each primitive, its box cut to the boxes of the leaves that hold it, span its box. That they leave no hole in it is not checked.
///
/// # Errors
/// All faults, structure before boxes.
pub fn validate_references(tree: &Bvh, boxes: &[Aabb]) -> Result<TreeStats, Vec<TreeFault>> {
    let mut check = Check::with_repeats(tree, boxes.len());
    check.structure();
    if !tree.nodes.is_empty() {
        check.boxes(None);
    }
    let stats = check.finish()?;
    pieces(tree, boxes)?;
    Ok(stats)
}

/// The faults of links and leaves, and of the boxes of leaves that are none; without a number of primitives the largest in the tree is the last.
pub(crate) fn reference_faults(tree: &Bvh, primitives: Option<usize>) -> Vec<TreeFault> {
    let most = || tree.triangle_order.iter().max().map_or(0, |&last| last as usize + 1);
    let mut check = match primitives {
        Some(primitives) => Check::with_repeats(tree, primitives),
        None => Check::with_repeats_and_gaps(tree, most()),
    };
    check.structure();
    if !tree.nodes.is_empty() {
        check.leaf_boxes();
    }
    check.finish().err().unwrap_or_default()
}

/// The piece at each position of the order: the box of its primitive, cut to that of its leaf.
///
/// # Errors
/// The primitives whose pieces do not span them.
///
/// # Panics
/// If the leaves are not [sound](reference_faults).
pub(crate) fn pieces(tree: &Bvh, boxes: &[Aabb]) -> Result<Vec<Aabb>, Vec<TreeFault>> {
    let mut pieces = vec![Aabb::EMPTY; tree.triangle_order.len()];
    let mut spanned = vec![Aabb::EMPTY; boxes.len()];
    for node in &tree.nodes {
        let Content::Leaf { first, count } = node.content else { continue };
        let held = &tree.triangle_order[first as usize..][..count as usize];
        for (to, &primitive) in pieces[first as usize..].iter_mut().zip(held) {
            if let Some(piece) = cut(&boxes[primitive as usize], &node.aabb) {
                *to = piece;
                let spanned = &mut spanned[primitive as usize];
                *spanned = spanned.union(piece);
            }
        }
    }
    let uncovered = (0..).zip(&spanned).zip(boxes).filter(|((_, have), need)| have != need);
    let mut faults: Vec<TreeFault> =
        uncovered.map(|((triangle, &have), &need)| TreeFault::Uncovered { triangle, have, need }).collect();
    let apart = pieces.iter().zip(&tree.triangle_order).filter(|(piece, _)| **piece == Aabb::EMPTY);
    faults.extend(apart.map(|(_, &triangle)| TreeFault::LeafApart { triangle }));
    if faults.is_empty() { Ok(pieces) } else { Err(faults) }
}

/// What two boxes share.
fn cut(one: &Aabb, other: &Aabb) -> Option<Aabb> {
    let min: [f32; 3] = std::array::from_fn(|k| one.min[k].max(other.min[k]));
    let max: [f32; 3] = std::array::from_fn(|k| one.max[k].min(other.max[k]));
    (0..3).all(|k| min[k] <= max[k]).then_some(Aabb { min, max })
}

#[cfg(test)]
mod tests {
    use super::super::{BvhNode, NO_NODE, ROOT};
    use super::*;

    fn unit(from: f32, to: f32) -> Aabb {
        Aabb { min: [from, 0.0, 0.0], max: [to, 1.0, 1.0] }
    }

    /// Primitive 0 from 0 to 4 in two halves, primitive 1 beside its second one.
    fn split() -> (Bvh, [Aabb; 2]) {
        let leaf = |aabb, first, count| BvhNode { aabb, parent: ROOT, content: Content::Leaf { first, count } };
        let root = BvhNode { aabb: unit(0.0, 5.0), parent: NO_NODE, content: Content::Internal { left: 1, right: 2 } };
        let nodes = vec![root, leaf(unit(0.0, 2.0), 0, 1), leaf(unit(2.0, 5.0), 1, 2)];
        (Bvh { nodes, triangle_order: vec![0, 1, 0] }, [unit(0.0, 4.0), unit(3.0, 5.0)])
    }

    #[test]
    fn a_primitive_may_be_in_two_leaves() {
        let (tree, boxes) = split();
        let stats = validate_references(&tree, &boxes).unwrap();
        assert_eq!((stats.nodes, stats.leaves, stats.triangles), (3, 2, 3));
        assert_eq!(pieces(&tree, &boxes).unwrap(), [unit(0.0, 2.0), unit(3.0, 5.0), unit(2.0, 4.0)]);
        assert!(validate(&tree, None).is_err());
    }

    #[test]
    fn planted_faults_are_named() {
        let faults = |change: &dyn Fn(&mut Bvh, &mut [Aabb; 2])| {
            let (mut tree, mut boxes) = split();
            change(&mut tree, &mut boxes);
            validate_references(&tree, &boxes).unwrap_err()
        };
        let missing = faults(&|tree, _| tree.triangle_order = vec![0, 0, 0]);
        assert_eq!(missing, [TreeFault::TriangleMissing { triangle: 1 }]);
        let uncovered = faults(&|_, boxes| boxes[0].min[0] = -1.0);
        let (have, need) = (unit(0.0, 4.0), unit(-1.0, 4.0));
        assert_eq!(uncovered, [TreeFault::Uncovered { triangle: 0, have, need }]);
        let apart = faults(&|tree, boxes| {
            tree.triangle_order = vec![1, 1, 0];
            boxes[0] = unit(2.0, 4.0);
        });
        assert_eq!(apart, [TreeFault::LeafApart { triangle: 1 }]);
        let unknown = faults(&|tree, _| tree.triangle_order[1] = 2);
        assert!(unknown.contains(&TreeFault::TriangleOutOfRange { node: 2, triangle: 2, triangles: 2 }), "{unknown:?}");
        let loose = faults(&|tree, _| tree.nodes[0].aabb = unit(0.0, 6.0));
        assert!(matches!(loose[..], [TreeFault::BoxOfChildren { node: 0, .. }]), "{loose:?}");
        let twice = faults(&|tree, _| tree.nodes[1].content = Content::Leaf { first: 0, count: 2 });
        assert!(matches!(twice[..], [TreeFault::PositionShared { .. }, ..]), "{twice:?}");
    }

    #[test]
    fn faults_of_leaves_are_found_without_primitives() {
        let (tree, _) = split();
        assert_eq!(reference_faults(&tree, None), []);
        let faults = |change: &dyn Fn(&mut Bvh)| {
            let mut tree = tree.clone();
            change(&mut tree);
            reference_faults(&tree, None)
        };
        assert!(matches!(
            faults(&|tree| tree.nodes[1].aabb.min[1] = f32::NAN)[..],
            [TreeFault::NotFinite { node: 1, .. }]
        ));
        assert!(matches!(faults(&|tree| tree.nodes[2].aabb.max[1] = -1.0)[..], [TreeFault::Inverted { node: 2, .. }]));
        let broken = faults(&|tree| tree.nodes[1].parent = 2);
        assert!(broken.contains(&TreeFault::ParentOfChild { node: 0, child: 1, parent: 2 }), "{broken:?}");
        assert_eq!(faults(&|tree| tree.nodes.clear()), [TreeFault::NodeCount { nodes: 0 }]);
        // Other boxes are made anew, and gaps in the numbers are the caller's.
        assert_eq!(faults(&|tree| tree.nodes[0].aabb.max[1] = f32::NAN), []);
        assert_eq!(faults(&|tree| tree.triangle_order = vec![7, 3, 7]), []);
    }
}

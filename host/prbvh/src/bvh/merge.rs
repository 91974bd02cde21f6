//! References of one triangle that came together: siblings become one, repeated ones in a leaf go.

use super::{Bvh, BvhNode, Content, NO_NODE, ROOT};
use prbvh_kernel::aabb::Aabb;

/// A tree of one reference per leaf after a merge, and what its references are.
pub(crate) struct Merged {
    /// Reference `k` is the one of the `k`-th leaf.
    pub(crate) tree: Bvh,
    /// Boxes of the references.
    pub(crate) boxes: Vec<Aabb>,
    /// Triangles of the references.
    pub(crate) primitives: Vec<u32>,
}

/// The tree of one reference per leaf with a leaf in place of each subtree whose references are all of one triangle, which `primitives` say by the references' numbers; none where there is no
/// such subtree. A leaf costs less than the node above two: its box has at most the areas of both and that of the node.
pub(crate) fn merge_siblings(tree: &Bvh, primitives: &[u32]) -> Option<Merged> {
    const SEVERAL: u32 = u32::MAX;
    let order = tree.preorder();
    let mut held = vec![SEVERAL; tree.nodes.len()];
    let mut is_merged = false;
    for &v in order.iter().rev() {
        held[v as usize] = match tree.nodes[v as usize].content {
            Content::Leaf { first, .. } => primitives[tree.triangle_order[first as usize] as usize],
            Content::Internal { left, right } if held[left as usize] == held[right as usize] => held[left as usize],
            Content::Internal { .. } => SEVERAL,
        };
        let is_internal = matches!(tree.nodes[v as usize].content, Content::Internal { .. });
        is_merged |= is_internal && held[v as usize] != SEVERAL;
    }
    if !is_merged {
        return None;
    }
    let mut merged = Merged {
        tree: Bvh { nodes: Vec::new(), triangle_order: Vec::new() },
        boxes: Vec::new(),
        primitives: Vec::new(),
    };
    merged.tree.nodes.push(BvhNode { parent: NO_NODE, ..tree.nodes[ROOT as usize] });
    let mut stack = vec![(ROOT, ROOT)];
    while let Some((from, to)) = stack.pop() {
        let nodes = &mut merged.tree.nodes;
        match tree.nodes[from as usize].content {
            Content::Internal { left, right } if held[from as usize] == SEVERAL => {
                let first = nodes.len() as u32;
                nodes.extend([left, right].map(|child| BvhNode { parent: to, ..tree.nodes[child as usize] }));
                nodes[to as usize].content = Content::Internal { left: first, right: first + 1 };
                stack.extend([(right, first + 1), (left, first)]);
            }
            _ => {
                let k = merged.boxes.len() as u32;
                nodes[to as usize].content = Content::Leaf { first: k, count: 1 };
                merged.tree.triangle_order.push(k);
                merged.boxes.push(tree.nodes[from as usize].aabb);
                merged.primitives.push(held[from as usize]);
            }
        }
    }
    Some(merged)
}

/// The tree with each triangle of a leaf in it once; boxes stay.
pub(crate) fn without_repeats(mut tree: Bvh) -> Bvh {
    let mut kept = Vec::with_capacity(tree.triangle_order.len());
    for node in &mut tree.nodes {
        if let Content::Leaf { first, count } = &mut node.content {
            let start = kept.len();
            for &triangle in &tree.triangle_order[*first as usize..][..*count as usize] {
                if !kept[start..].contains(&triangle) {
                    kept.push(triangle);
                }
            }
            (*first, *count) = (start as u32, (kept.len() - start) as u32);
        }
    }
    tree.triangle_order = kept;
    tree
}

#[cfg(test)]
mod tests {
    use super::super::{SahModel, quality, validate_references};
    use super::*;

    fn slab(from: f32, to: f32) -> Aabb {
        Aabb { min: [from, 0.0, 0.0], max: [to, 1.0, 1.0] }
    }

    /// Three pieces of triangle 0 from 0 to 3, the last two siblings, and triangle 1 beside them.
    fn tree() -> (Bvh, Vec<u32>, [Aabb; 2]) {
        let leaf = |aabb, parent, first| BvhNode { aabb, parent, content: Content::Leaf { first, count: 1 } };
        let internal =
            |aabb, parent, left| BvhNode { aabb, parent, content: Content::Internal { left, right: left + 1 } };
        let nodes = vec![
            internal(slab(0.0, 5.0), NO_NODE, 1),
            internal(slab(0.0, 4.0), ROOT, 3),
            leaf(slab(4.0, 5.0), ROOT, 3),
            leaf(slab(0.0, 1.0), 1, 0),
            internal(slab(1.0, 4.0), 1, 5),
            leaf(slab(1.0, 2.0), 4, 2),
            leaf(slab(2.0, 4.0), 4, 1),
        ];
        (Bvh { nodes, triangle_order: vec![0, 1, 2, 3] }, vec![0, 0, 0, 1], [slab(0.0, 4.0), slab(4.0, 5.0)])
    }

    fn named(tree: &Bvh, primitives: &[u32]) -> Bvh {
        let triangle_order = tree.triangle_order.iter().map(|&k| primitives[k as usize]).collect();
        Bvh { triangle_order, ..tree.clone() }
    }

    #[test]
    fn siblings_of_one_triangle_become_one() {
        let (tree, primitives, boxes) = tree();
        validate_references(&named(&tree, &primitives), &boxes).unwrap();
        let merged = merge_siblings(&tree, &primitives).unwrap();
        assert_eq!((merged.tree.nodes.len(), &merged.primitives[..]), (3, &[0, 1][..]));
        assert_eq!(merged.boxes, boxes);
        validate_references(&named(&merged.tree, &merged.primitives), &boxes).unwrap();
        let cost = |tree: &Bvh| quality(tree, &SahModel::default()).sah_cost;
        assert!(cost(&merged.tree) < cost(&tree));
        assert!(merge_siblings(&tree, &[0, 1, 0, 1]).is_none());
    }

    #[test]
    fn a_leaf_names_a_triangle_once() {
        let leaf =
            |first, count| BvhNode { aabb: slab(0.0, 4.0), parent: ROOT, content: Content::Leaf { first, count } };
        let root = BvhNode { parent: NO_NODE, content: Content::Internal { left: 1, right: 2 }, ..leaf(0, 0) };
        let tree = Bvh { nodes: vec![root, leaf(0, 3), leaf(3, 2)], triangle_order: vec![1, 0, 1, 1, 1] };
        let tree = without_repeats(tree);
        assert_eq!(tree.triangle_order, [1, 0, 1]);
        assert_eq!(tree.nodes[2].content, Content::Leaf { first: 2, count: 1 });
    }
}

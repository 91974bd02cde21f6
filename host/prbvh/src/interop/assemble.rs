//! Nodes that the caller makes.

use crate::bvh::{Bvh, Content, ROOT};
use prbvh_kernel::aabb::Aabb;

/// Builds the caller's tree from the leaves up: `leaf` makes a node of triangle ids, `internal` one of its two children and their
/// boxes. Returns the root and its box. These are the callbacks of Embree's `rtcBuildBVH` (`createLeaf`; `createNode`, `setNodeChildren` and
/// `setNodeBounds` in one), with this tree in the place of its own.
///
/// # Panics
/// If the links are no tree.
pub fn build<N>(
    tree: &Bvh,
    mut leaf: impl FnMut(&[u32], Aabb) -> N,
    mut internal: impl FnMut([N; 2], [Aabb; 2]) -> N,
) -> (N, Aabb) {
    // On the heap: a tree may be as deep as it has triangles.
    let mut stack = vec![(ROOT, false)];
    let mut made: Vec<(N, Aabb)> = Vec::new();
    let mut visits = 0;
    while let Some((v, has_children)) = stack.pop() {
        let node = &tree.nodes[v as usize];
        let new = match node.content {
            Content::Leaf { first, count } => leaf(&tree.triangle_order[first as usize..][..count as usize], node.aabb),
            Content::Internal { left, right } if !has_children => {
                visits += 1;
                assert!(visits <= tree.nodes.len(), "the links are no tree");
                stack.extend([(v, true), (right, false), (left, false)]);
                continue;
            }
            Content::Internal { .. } => match (made.pop(), made.pop()) {
                (Some((right, right_box)), Some((left, left_box))) => internal([left, right], [left_box, right_box]),
                _ => unreachable!("children are made before their parent"),
            },
        };
        made.push((new, node.aabb));
    }
    made.pop().expect("a tree has a root")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::testing::{Rng, chain, renumbered, tree};

    /// What an engine may have.
    enum Pointers {
        Leaf(Vec<u32>),
        Internal([(Box<Self>, Aabb); 2]),
    }

    fn flattened(root: Pointers, aabb: Aabb) -> Bvh {
        let (mut nodes, mut order) = (Vec::new(), Vec::new());
        let mut stack = vec![(root, aabb, None)];
        while let Some((node, aabb, parent)) = stack.pop() {
            let v = nodes.len() as u32;
            if let Some((parent, is_right)) = parent {
                let (_, Content::Internal { left, right }) = &mut nodes[parent as usize] else { unreachable!() };
                *(if is_right { right } else { left }) = v;
            }
            match node {
                Pointers::Leaf(triangles) => {
                    nodes.push((aabb, Content::Leaf { first: order.len() as u32, count: triangles.len() as u32 }));
                    order.extend(triangles);
                }
                Pointers::Internal([(left, left_box), (right, right_box)]) => {
                    nodes.push((aabb, Content::Internal { left: 0, right: 0 }));
                    stack.push((*right, right_box, Some((v, true))));
                    stack.push((*left, left_box, Some((v, false))));
                }
            }
        }
        Bvh::from_parts(nodes, order).unwrap()
    }

    #[test]
    fn a_tree_of_pointers_is_the_same_tree() {
        for (n, seed) in [(1, 1), (2, 2), (3, 3), (200, 4)] {
            let (_, tree) = tree(n, seed);
            let (root, aabb) = build(
                &renumbered(&tree, &mut Rng::new(seed)),
                |triangles, _| Pointers::Leaf(triangles.to_vec()),
                |[left, right], [left_box, right_box]| {
                    Pointers::Internal([(Box::new(left), left_box), (Box::new(right), right_box)])
                },
            );
            assert_eq!(crate::bvh::tree_hash(&flattened(root, aabb)), crate::bvh::tree_hash(&tree));
        }
    }

    #[test]
    fn a_chain_does_not_overflow_the_stack() {
        let (_, nodes) = chain(100_000);
        let tree = Bvh::from_device(&nodes).unwrap();
        let (depth, _) = build(&tree, |_, _| 0, |[left, right]: [usize; 2], _| 1 + left.max(right));
        assert_eq!(depth, 99_999);
    }
}

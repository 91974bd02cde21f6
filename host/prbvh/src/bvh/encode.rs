//! From a tree to the threaded nodes of a device.

use super::validate::{link_faults, structure_faults};
use super::{Bvh, Content, NO_NODE, TreeFault, summary};
use prbvh_kernel::node::{Node, RIGHT};

/// Why a tree has no form on a device.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The links or the leaves are those of no tree.
    #[error("no tree: {}", summary(.faults))]
    Broken {
        /// All faults.
        faults: Vec<TreeFault>,
    },
    /// A leaf holds several triangles.
    #[error(
        "the leaf at node {node} holds {triangles} triangles, but only trees of one triangle per leaf can be optimised"
    )]
    LeafSize {
        /// The leaf.
        node: u32,
        /// Its triangles.
        triangles: u32,
    },
}

impl Bvh {
    /// `nodes[2n-1]` as a device takes them (see [`prbvh_kernel::node`]), with the boxes of the tree. Internal nodes are numbered
    /// depth-first, parents before their children, and the leaves in the same walk, whatever numbers the tree has.
    ///
    /// # Errors
    /// [`EncodeError::Broken`], or [`EncodeError::LeafSize`] at the first leaf of several triangles.
    pub fn to_device(&self) -> Result<Vec<Node>, EncodeError> {
        self.threaded(&checked(self, structure_faults(self))?, |node, first, triangles| match triangles {
            1 => Ok(self.triangle_order[first as usize]),
            _ => Err(EncodeError::LeafSize { node, triangles }),
        })
    }

    /// The nodes as a depth-first walk meets them; a triangle may be in several leaves, and in none.
    ///
    /// # Errors
    /// [`EncodeError::Broken`].
    pub(crate) fn preorder_checked(&self) -> Result<Vec<u32>, EncodeError> {
        checked(self, link_faults(self))
    }

    /// As [`Bvh::to_device`] numbers them in this walk, with what `held` says of a leaf's node and range in place of its triangle.
    ///
    /// # Errors
    /// Those of `held`.
    pub(crate) fn threaded<E>(
        &self,
        walk: &[u32],
        held: impl Fn(u32, u32, u32) -> Result<u32, E>,
    ) -> Result<Vec<Node>, E> {
        let internal = walk.len() as u32 / 2;
        let mut ids = vec![NO_NODE; self.nodes.len()];
        let (mut next_internal, mut next_leaf) = (0, internal);
        for &v in walk {
            let next = match self.nodes[v as usize].content {
                Content::Internal { .. } => &mut next_internal,
                Content::Leaf { .. } => &mut next_leaf,
            };
            ids[v as usize] = *next;
            *next += 1;
        }
        let mut nodes = vec![Node { min: [0.0; 3], up: NO_NODE, max: [0.0; 3], down: 0 }; walk.len()];
        for &v in walk {
            let (id, node) = (ids[v as usize], &self.nodes[v as usize]);
            let down = match node.content {
                Content::Internal { left, right } => {
                    let (left, right) = (ids[left as usize], ids[right as usize]);
                    nodes[left as usize].up = right;
                    nodes[right as usize].up = id | RIGHT;
                    left
                }
                Content::Leaf { first, count } => held(v, first, count)?,
            };
            let up = nodes[id as usize].up;
            nodes[id as usize] = Node { min: node.aabb.min, up, max: node.aabb.max, down };
        }
        Ok(nodes)
    }
}

fn checked(tree: &Bvh, faults: Vec<TreeFault>) -> Result<Vec<u32>, EncodeError> {
    if faults.is_empty() { Ok(tree.preorder()) } else { Err(EncodeError::Broken { faults }) }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Rng, chain, renumbered, tree};
    use super::super::{BvhNode, ROOT, tree_hash};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn encoding_and_decoding_give_the_tree_back(n in 1usize..200, seed: u64) {
            let (_, tree) = tree(n, seed);
            let nodes = tree.to_device().unwrap();
            let decoded = Bvh::from_device(&nodes).unwrap();
            prop_assert_eq!(tree_hash(&decoded), tree_hash(&tree));
            // The numbers are a matter of the tree alone, and a tree so numbered keeps them.
            prop_assert_eq!(&renumbered(&tree, &mut Rng::new(seed)).to_device().unwrap(), &nodes);
            prop_assert_eq!(decoded.to_device().unwrap(), nodes);
        }
    }

    #[test]
    fn parents_come_before_their_children() {
        let nodes = tree(300, 4).1.to_device().unwrap();
        let tree = Bvh::from_device(&nodes).unwrap();
        assert!((1..).zip(&tree.nodes[1..]).all(|(v, node)| node.parent < v));
    }

    #[test]
    fn a_chain_does_not_overflow_the_stack() {
        let (_, nodes) = chain(100_000);
        assert_eq!(Bvh::from_device(&nodes).unwrap().to_device().unwrap().len(), nodes.len());
    }

    #[test]
    fn a_broken_tree_is_named() {
        let mut tree = tree(5, 1).1;
        tree.nodes[1].parent = 7;
        assert!(matches!(tree.to_device(), Err(EncodeError::Broken { faults }) if !faults.is_empty()));
        tree.nodes.clear();
        let faults = vec![TreeFault::NodeCount { nodes: 0 }];
        assert_eq!(tree.to_device(), Err(EncodeError::Broken { faults }));
    }

    #[test]
    fn a_leaf_of_several_triangles_is_named() {
        let (_, whole) = tree(3, 1);
        let leaf = BvhNode { content: Content::Leaf { first: 0, count: 3 }, ..whole.nodes[ROOT as usize] };
        let tree = Bvh { nodes: vec![leaf], triangle_order: whole.triangle_order };
        assert_eq!(tree.to_device(), Err(EncodeError::LeafSize { node: 0, triangles: 3 }));
    }
}

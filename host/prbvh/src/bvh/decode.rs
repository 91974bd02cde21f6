//! From the threaded nodes of a device to a tree.

use super::validate::structure_faults;
use super::{Bvh, BvhNode, Content, Link, NO_NODE, ROOT, TreeFault};
use prbvh_kernel::node::{Node, RIGHT};

impl Bvh {
    /// Decodes `nodes[2n-1]` as a device leaves them (see [`prbvh_kernel::node`]): internal nodes `[0, n-1)`, leaves `[n-1, 2n-1)`
    /// of one triangle each. Nodes keep their ids and boxes; position `k` of the triangle order belongs to leaf `n-1+k`.
    ///
    /// # Errors
    /// All faults of the links: what is returned otherwise is a tree with each of `n` triangles in one leaf. Boxes are not looked
    /// at; [`validate`](super::validate()) does that.
    pub fn from_device(nodes: &[Node]) -> Result<Self, Vec<TreeFault>> {
        let mut decoder = Decoder::new(nodes.len(), 0)?;
        decoder.push(nodes);
        decoder.finish()
    }
}

/// [`Bvh::from_device`] of nodes that come in pieces, so that they need not all be there at once.
pub(crate) struct Decoder {
    internal: u32,
    /// Links of the nodes that came, upwards.
    ups: Vec<u32>,
    /// Links of the internal nodes that came, downwards.
    downs: Vec<u32>,
    /// Boxes and triangles of the nodes that came; parents and children are not known yet.
    tree: Bvh,
}

impl Decoder {
    /// Nothing of `nodes` nodes has come yet. The tree gets room for `more` besides, so that who adds them need not copy it.
    ///
    /// # Errors
    /// If no tree has so many.
    pub(crate) fn new(nodes: usize, more: usize) -> Result<Self, Vec<TreeFault>> {
        if nodes.is_multiple_of(2) || nodes >= RIGHT as usize {
            return Err(vec![TreeFault::NodeCount { nodes }]);
        }
        let internal = nodes / 2;
        let tree = Bvh { nodes: Vec::with_capacity(nodes + more), triangle_order: Vec::with_capacity(internal + 1) };
        let (ups, downs) = (Vec::with_capacity(nodes), Vec::with_capacity(internal));
        Ok(Self { internal: internal as u32, ups, downs, tree })
    }

    /// Takes the next nodes.
    pub(crate) fn push(&mut self, nodes: &[Node]) {
        for node in nodes {
            let v = self.ups.len() as u32;
            self.ups.push(node.up);
            if v < self.internal {
                self.downs.push(node.down);
            } else {
                self.tree.triangle_order.push(node.down);
            }
            let content = Content::Leaf { first: v.saturating_sub(self.internal), count: 1 };
            self.tree.nodes.push(BvhNode { aabb: node.aabb(), parent: NO_NODE, content });
        }
    }

    /// The tree, when all nodes have come.
    ///
    /// # Errors
    /// As [`Bvh::from_device`].
    pub(crate) fn finish(self) -> Result<Bvh, Vec<TreeFault>> {
        // The check takes as much again as the links of the device, which are gone by then.
        let tree = self.linked()?;
        let faults = structure_faults(&tree);
        if faults.is_empty() { Ok(tree) } else { Err(faults) }
    }

    /// The tree with its links in both directions.
    fn linked(mut self) -> Result<Bvh, Vec<TreeFault>> {
        let mut faults = Vec::new();
        let root = self.ups[ROOT as usize];
        if root != NO_NODE {
            faults.push(TreeFault::RootParent { parent: root & !RIGHT });
        }
        for p in 0..self.internal {
            match self.pair(p) {
                Err(fault) => faults.push(fault),
                Ok([left, right]) => {
                    // The right child names its parent, and the left one its right sibling: no node can be the child of two.
                    self.tree.nodes[left as usize].parent = p;
                    self.tree.nodes[right as usize].parent = p;
                    self.tree.nodes[p as usize].content = Content::Internal { left, right };
                }
            }
        }
        let orphans = (0..).zip(&self.tree.nodes).skip(1).filter(|(_, node)| node.parent == NO_NODE);
        faults.extend(orphans.map(|(node, _)| TreeFault::Orphan { node }));
        if faults.is_empty() { Ok(self.tree) } else { Err(faults) }
    }

    /// Children of `p`, if the thread leads from the one to the other and back.
    fn pair(&self, p: u32) -> Result<[u32; 2], TreeFault> {
        let child = |link, value: u32| {
            let count = self.ups.len() as u32;
            if value >= count {
                Err(TreeFault::LinkOutOfRange { node: p, link, value, nodes: count })
            } else if value == ROOT {
                Err(TreeFault::RootIsChild { node: p })
            } else {
                Ok(value)
            }
        };
        let left = child(Link::Left, self.downs[p as usize])?;
        let up = self.ups[left as usize];
        if up & RIGHT != 0 {
            return Err(TreeFault::Thread { node: p, child: left, up });
        }
        let right = child(Link::Right, up)?;
        let up = self.ups[right as usize];
        if up != p | RIGHT {
            return Err(TreeFault::Thread { node: p, child: right, up });
        }
        Ok([left, right])
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Rng, chain, device_tree};
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn children_and_parents_are_those_of_the_thread() {
        let (_, nodes) = device_tree(50, &mut Rng::new(1));
        let tree = Bvh::from_device(&nodes).unwrap();
        for (v, node) in tree.nodes.iter().enumerate() {
            assert_eq!(node.aabb, nodes[v].aabb());
            match node.content {
                Content::Internal { left, right } => {
                    assert!(v < 49);
                    assert_eq!((left, right), (nodes[v].down, nodes[nodes[v].down as usize].up));
                    assert_eq!(tree.nodes[left as usize].parent as usize, v);
                    assert_eq!(tree.nodes[right as usize].parent as usize, v);
                }
                Content::Leaf { first, count } => {
                    assert_eq!((first as usize, count), (v - 49, 1));
                    assert_eq!(tree.triangle_order[first as usize], nodes[v].down);
                }
            }
        }
    }

    #[test]
    fn pieces_of_any_length_make_the_same_tree() {
        let (_, nodes) = device_tree(50, &mut Rng::new(1));
        for piece in [1, 7, 49, 50, 98] {
            let mut decoder = Decoder::new(nodes.len(), 0).unwrap();
            nodes.chunks(piece).for_each(|piece| decoder.push(piece));
            assert_eq!(decoder.finish(), Bvh::from_device(&nodes), "pieces of {piece}");
        }
    }

    #[test]
    fn one_triangle_is_a_root_that_is_a_leaf() {
        let (_, nodes) = device_tree(1, &mut Rng::new(1));
        let tree = Bvh::from_device(&nodes).unwrap();
        assert_eq!(tree.nodes.len(), 1);
        assert_eq!(tree.nodes[0].parent, NO_NODE);
        assert_eq!(tree.nodes[0].content, Content::Leaf { first: 0, count: 1 });
    }

    #[test]
    fn a_tree_as_deep_as_it_has_triangles() {
        assert_eq!(Bvh::from_device(&chain(200_000).1).unwrap().nodes.len(), 399_999);
    }

    fn faults(change: impl FnOnce(&mut Vec<Node>)) -> Vec<TreeFault> {
        let (_, mut nodes) = device_tree(8, &mut Rng::new(3));
        change(&mut nodes);
        Bvh::from_device(&nodes).unwrap_err()
    }

    #[test]
    fn each_broken_link_is_named() {
        let (_, whole) = device_tree(8, &mut Rng::new(3));
        let left = whole[0].down;
        let right = whole[left as usize].up;

        assert_eq!(faults(|nodes| nodes.clear()), [TreeFault::NodeCount { nodes: 0 }]);
        assert_eq!(faults(|nodes| nodes.truncate(14)), [TreeFault::NodeCount { nodes: 14 }]);
        assert_eq!(faults(|nodes| nodes[0].up = RIGHT | 3), [TreeFault::RootParent { parent: 3 }]);
        let out_of_range = |link, value| TreeFault::LinkOutOfRange { node: 0, link, value, nodes: 15 };
        assert!(faults(|nodes| nodes[0].down = 15).contains(&out_of_range(Link::Left, 15)));
        assert!(faults(|nodes| nodes[left as usize].up = 99).contains(&out_of_range(Link::Right, 99)));
        assert!(faults(|nodes| nodes[0].down = 0).contains(&TreeFault::RootIsChild { node: 0 }));
        let found = faults(|nodes| nodes[0].down = right);
        assert!(found.contains(&TreeFault::Thread { node: 0, child: right, up: RIGHT }));
        assert!(found.contains(&TreeFault::Orphan { node: left }));
        let found = faults(|nodes| nodes[right as usize].up = RIGHT | 1);
        assert!(found.contains(&TreeFault::Thread { node: 0, child: right, up: RIGHT | 1 }));
    }

    #[test]
    fn a_child_of_two_is_named() {
        let (_, whole) = device_tree(8, &mut Rng::new(3));
        let other = (1..7).find(|&p| whole[p].down != whole[0].down).unwrap();
        let right = whole[whole[0].down as usize].up;
        let found = faults(|nodes| nodes[other].down = whole[0].down);
        assert!(found.contains(&TreeFault::Thread { node: other as u32, child: right, up: RIGHT }), "{found:?}");
        assert!(found.contains(&TreeFault::Orphan { node: whole[other].down }), "{found:?}");
    }

    #[test]
    fn a_ring_apart_from_the_root_is_found() {
        // Root 0 with leaves 2 and 3; node 1 is its own left child's … parent: 1 → (1, 4) is a ring of one.
        let link = |up, down| Node { min: [0.0; 3], up, max: [1.0; 3], down };
        let nodes = [link(NO_NODE, 2), link(4, 1), link(3, 0), link(RIGHT, 1), link(RIGHT | 1, 2)];
        let found = Bvh::from_device(&nodes).unwrap_err();
        assert!(found.contains(&TreeFault::Cycle { node: 1 }), "{found:?}");
        assert!(
            found.contains(&TreeFault::Unreachable { node: 1 }) && found.contains(&TreeFault::Unreachable { node: 4 })
        );
    }

    #[test]
    fn triangles_out_of_range_and_twice_are_named() {
        let found = faults(|nodes| nodes[9].down = 8);
        assert!(found.contains(&TreeFault::TriangleOutOfRange { node: 9, triangle: 8, triangles: 8 }));
        let (_, whole) = device_tree(8, &mut Rng::new(3));
        let found = faults(|nodes| nodes[9].down = nodes[8].down);
        let twice = TreeFault::TriangleTwice { triangle: whole[8].down, first: 8, second: 9 };
        assert_eq!(found, [twice, TreeFault::TriangleMissing { triangle: whole[9].down }]);
    }

    proptest! {
        #[test]
        fn garbage_ends_with_faults(words in proptest::collection::vec(any::<[u32; 2]>(), 2..40)) {
            let nodes: Vec<Node> = words
                .iter()
                .map(|&[up, down]| Node { min: [0.0; 3], up, max: [1.0; 3], down })
                .collect();
            prop_assert!(Bvh::from_device(&nodes).is_err());
        }

        #[test]
        fn small_garbage_is_a_tree_or_faulty(words in proptest::collection::vec((0u32..8, any::<bool>(), 0u32..8), 1..10)) {
            let nodes: Vec<Node> = words
                .iter()
                .map(|&(up, right, down)| Node { min: [0.0; 3], up: up | if right { RIGHT } else { 0 }, max: [1.0; 3], down })
                .collect();
            if let Ok(tree) = Bvh::from_device(&nodes) {
                prop_assert!(super::super::validate(&tree, None).is_ok());
            }
        }
    }
}

//! Sound trees are found sound, and each kind of fault, planted alone, is found.

use super::super::testing::{Rng, chain, device_tree, renumbered, tree};
use super::super::{BvhNode, summary};
use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn random_trees_are_valid(n in 1usize..200, seed: u64) {
        let (triangles, tree) = tree(n, seed);
        let stats = validate(&tree, Some(&triangles)).map_err(|faults| TestCaseError::fail(summary(&faults)))?;
        prop_assert_eq!((stats.triangles, stats.nodes, stats.leaves), (n as u32, 2 * n as u32 - 1, n as u32));
        prop_assert_eq!(validate(&tree, None), Ok(stats));
        prop_assert_eq!(validate(&renumbered(&tree, &mut Rng::new(seed)), Some(&triangles)), Ok(stats));
    }

    #[test]
    fn random_links_end_with_faults(seed: u64, changes in 1usize..20) {
        let (triangles, mut tree) = tree(20, seed);
        let mut rng = Rng::new(seed);
        for _ in 0..changes {
            let content = Content::Internal { left: rng.below(45) as u32, right: rng.below(45) as u32 };
            let v = rng.below(39);
            // A leaf turned inside out loses its triangle whatever the links are.
            tree.nodes[19 + v % 20].content = content;
            tree.nodes[v].parent = rng.below(45) as u32;
        }
        prop_assert!(validate(&tree, Some(&triangles)).is_err());
    }
}

#[test]
fn depth_of_a_chain() {
    let (triangles, nodes) = chain(100_000);
    let tree = Bvh::from_device(&nodes).unwrap();
    assert_eq!(validate(&tree, Some(&triangles)).unwrap().max_depth, 99_999);
}

#[test]
fn several_triangles_in_a_leaf() {
    let (triangles, tree) = pair_of_leaves();
    let stats = TreeStats { triangles: 5, nodes: 3, leaves: 2, max_depth: 1 };
    assert_eq!(validate(&tree, Some(&triangles)), Ok(stats));
}

/// A root with leaves of two and three triangles.
fn pair_of_leaves() -> (Vec<Triangle>, Bvh) {
    let triangles = Rng::new(5).triangles(5);
    let triangle_order = vec![3, 0, 4, 2, 1];
    let aabb = |ids: &[u32]| ids.iter().map(|&t| triangles[t as usize].aabb()).fold(Aabb::EMPTY, Aabb::union);
    let leaf = |first: usize, count: usize| BvhNode {
        aabb: aabb(&triangle_order[first..first + count]),
        parent: ROOT,
        content: Content::Leaf { first: first as u32, count: count as u32 },
    };
    let root = BvhNode {
        aabb: leaf(0, 2).aabb.union(leaf(2, 3).aabb),
        parent: NO_NODE,
        content: Content::Internal { left: 1, right: 2 },
    };
    let nodes = vec![root, leaf(0, 2), leaf(2, 3)];
    (triangles, Bvh { nodes, triangle_order })
}

fn faults(change: impl FnOnce(&mut Bvh)) -> Vec<TreeFault> {
    let (triangles, mut tree) = pair_of_leaves();
    change(&mut tree);
    validate(&tree, Some(&triangles)).unwrap_err()
}

fn set_children(tree: &mut Bvh, node: usize, left: u32, right: u32) {
    tree.nodes[node].content = Content::Internal { left, right };
}

fn set_range(tree: &mut Bvh, node: usize, first: u32, count: u32) {
    tree.nodes[node].content = Content::Leaf { first, count };
}

#[test]
fn node_count() {
    assert_eq!(
        validate(&Bvh { nodes: vec![], triangle_order: vec![] }, None),
        Err(vec![TreeFault::NodeCount { nodes: 0 }])
    );
}

#[test]
fn root_with_a_parent() {
    assert_eq!(faults(|tree| tree.nodes[0].parent = 2), [TreeFault::RootParent { parent: 2 }]);
}

#[test]
fn second_root() {
    let found = faults(|tree| tree.nodes[2].parent = NO_NODE);
    assert_eq!(
        found,
        [TreeFault::ParentOfChild { node: 0, child: 2, parent: NO_NODE }, TreeFault::ExtraRoot { node: 2 }]
    );
}

#[test]
fn parent_that_has_other_children() {
    let found = faults(|tree| tree.nodes[2].parent = 1);
    assert_eq!(
        found,
        [TreeFault::ParentOfChild { node: 0, child: 2, parent: 1 }, TreeFault::ChildOfParent { node: 2, parent: 1 }]
    );
}

#[test]
fn links_out_of_range() {
    let link = |link, node, value| TreeFault::LinkOutOfRange { node, link, value, nodes: 3 };
    assert!(faults(|tree| tree.nodes[1].parent = 3).contains(&link(Link::Parent, 1, 3)));
    assert!(faults(|tree| set_children(tree, 0, 4, 2)).contains(&link(Link::Left, 0, 4)));
    assert!(faults(|tree| set_children(tree, 0, 1, 7)).contains(&link(Link::Right, 0, 7)));
}

#[test]
fn same_child_twice() {
    let found = faults(|tree| set_children(tree, 0, 1, 1));
    for fault in [
        TreeFault::SameChildren { node: 0, child: 1 },
        TreeFault::Shared { node: 1 },
        TreeFault::ChildOfParent { node: 2, parent: 0 },
        TreeFault::Unreachable { node: 2 },
    ] {
        assert!(found.contains(&fault), "{fault} is not in {found:?}");
    }
}

#[test]
fn root_as_a_child() {
    let found = faults(|tree| set_children(tree, 0, 0, 2));
    for fault in [
        TreeFault::RootIsChild { node: 0 },
        TreeFault::Cycle { node: 0 },
        TreeFault::ChildOfParent { node: 1, parent: 0 },
        TreeFault::Unreachable { node: 1 },
    ] {
        assert!(found.contains(&fault), "{fault} is not in {found:?}");
    }
}

#[test]
fn ring_apart_from_the_root() {
    let (_, mut tree) = tree(2, 1);
    let node =
        |parent, left, right| BvhNode { aabb: tree.nodes[0].aabb, parent, content: Content::Internal { left, right } };
    let ring = [node(4, 4, 4), node(3, 3, 3)];
    tree.nodes.extend(ring);
    let found = validate(&tree, None).unwrap_err();
    assert_eq!(found.iter().filter(|fault| matches!(fault, TreeFault::Cycle { .. })).count(), 2);
    assert!(found.contains(&TreeFault::Unreachable { node: 3 }) && found.contains(&TreeFault::Unreachable { node: 4 }));
}

#[test]
fn empty_leaf() {
    let found = faults(|tree| set_range(tree, 1, 0, 0));
    assert_eq!(found[0], TreeFault::EmptyLeaf { node: 1 });
    assert!(found.contains(&TreeFault::PositionUnused { position: 1 }));
    assert!(found.contains(&TreeFault::TriangleMissing { triangle: 3 }));
}

#[test]
fn leaf_beyond_the_order() {
    for (first, count) in [(2, 4), (6, 1), (u32::MAX, u32::MAX), (0, u32::MAX)] {
        let found = faults(|tree| set_range(tree, 2, first, count));
        assert!(found.contains(&TreeFault::LeafRange { node: 2, first, count, positions: 5 }), "{found:?}");
    }
}

#[test]
fn leaves_that_overlap() {
    let found = faults(|tree| set_range(tree, 2, 1, 4));
    assert!(found.contains(&TreeFault::PositionShared { node: 2, other: 1, position: 1 }), "{found:?}");
}

#[test]
fn position_in_no_leaf() {
    assert_eq!(faults(|tree| tree.triangle_order.push(0)), [TreeFault::PositionUnused { position: 5 }]);
}

#[test]
fn triangle_out_of_range() {
    let found = faults(|tree| tree.triangle_order[2] = 5);
    assert_eq!(
        found,
        [
            TreeFault::TriangleOutOfRange { node: 2, triangle: 5, triangles: 5 },
            TreeFault::TriangleMissing { triangle: 4 }
        ]
    );
}

#[test]
fn triangle_in_two_leaves() {
    let (_, nodes) = device_tree(4, &mut Rng::new(9));
    let mut tree = Bvh::from_device(&nodes).unwrap();
    let lost = tree.triangle_order[3];
    tree.triangle_order[3] = tree.triangle_order[0];
    let twice = TreeFault::TriangleTwice { triangle: tree.triangle_order[0], first: 3, second: 6 };
    assert_eq!(validate(&tree, None), Err(vec![twice, TreeFault::TriangleMissing { triangle: lost }]));
}

#[test]
fn more_triangles_than_the_tree_has() {
    let (mut triangles, tree) = pair_of_leaves();
    triangles.push(triangles[0]);
    assert_eq!(validate(&tree, Some(&triangles)), Err(vec![TreeFault::TriangleMissing { triangle: 5 }]));
}

#[test]
fn box_that_is_not_finite() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let found = faults(|tree| tree.nodes[1].aabb.max[2] = bad);
        assert!(matches!(found[..], [TreeFault::NotFinite { node: 1, .. }]), "{found:?}");
    }
}

#[test]
fn box_that_ends_before_it_starts() {
    let found = faults(|tree| tree.nodes[1].aabb.min[0] = 2.0);
    assert!(found.iter().any(|fault| matches!(fault, TreeFault::Inverted { node: 1, .. })), "{found:?}");
    assert!(found.iter().any(|fault| matches!(fault, TreeFault::BoxOfTriangles { node: 1, .. })), "{found:?}");
}

#[test]
fn box_off_by_one_bit() {
    let found = faults(|tree| tree.nodes[0].aabb.max[1] = tree.nodes[0].aabb.max[1].next_up());
    assert!(matches!(found[..], [TreeFault::BoxOfChildren { node: 0, .. }]), "{found:?}");
    // Inward and not at the scene's border, so that the parent's box stays right.
    let (triangles, mut tree) = tree(64, 2);
    let root = tree.nodes[0].aabb;
    let inner = tree.nodes.iter().rposition(|node| {
        let parent = tree.nodes.get(node.parent as usize).map_or(root, |parent| parent.aabb);
        node.aabb.min[0] > parent.min[0]
    });
    let v = inner.unwrap();
    tree.nodes[v].aabb.min[0] = tree.nodes[v].aabb.min[0].next_up();
    let found = validate(&tree, Some(&triangles)).unwrap_err();
    assert!(matches!(found[..], [TreeFault::BoxOfTriangles { node, .. }] if node as usize == v), "{found:?}");
}

#[test]
fn the_sign_of_zero_is_no_fault() {
    let zero = |sign: f32| Triangle { a: [0.0 * sign, 0.0, 0.0], b: [0.0 * sign, 1.0, 0.0], c: [0.0 * sign, 0.0, 1.0] };
    let triangles = [zero(-1.0), zero(1.0)];
    let leaf = |t: u32| BvhNode {
        aabb: triangles[t as usize].aabb(),
        parent: 0,
        content: Content::Leaf { first: t, count: 1 },
    };
    for flip in [-1.0f32, 1.0] {
        let mut aabb = leaf(0).aabb;
        aabb.min[0] *= flip;
        let root = BvhNode { aabb, parent: NO_NODE, content: Content::Internal { left: 1, right: 2 } };
        let tree = Bvh { nodes: vec![root, leaf(0), leaf(1)], triangle_order: vec![0, 1] };
        assert!(validate(&tree, Some(&triangles)).is_ok());
    }
}

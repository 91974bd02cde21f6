//! Single reinsertions against brute force, and the bookkeeping of the tree.

use super::search::cost_at;
use super::*;
use crate::bvh::testing::{Rng, chain, device_tree};
use crate::bvh::{Bvh, NO_NODE, ROOT, SahModel, quality, validate};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use proptest::prelude::*;

fn tree_of(n: usize, seed: u64) -> (Vec<Triangle>, RbvhTree) {
    let (triangles, nodes) = device_tree(n, &mut Rng::new(seed));
    (triangles, RbvhTree::new(Bvh::from_device(&nodes).unwrap()))
}

fn checked(tree: &RbvhTree, triangles: &[Triangle]) -> Bvh {
    let bvh = Bvh::from_device(&tree.nodes()).unwrap_or_else(|faults| panic!("{faults:?}"));
    validate(&bvh, Some(triangles)).unwrap_or_else(|faults| panic!("{faults:?}"));
    bvh
}

fn cost(tree: &RbvhTree) -> f64 {
    TreeAreas { root: tree.root_area(), leaves: tree.leaf_area(), internal: tree.internal_area() }
        .cost(tree.internal() + 1)
}

fn eligible(tree: &RbvhTree) -> Vec<u32> {
    (1..tree.internal()).filter(|&v| tree.parent(v) != ROOT).collect()
}

/// Nodes that hang on the root; after a removal others do not.
fn attached(tree: &RbvhTree) -> Vec<u32> {
    let mut found = Vec::new();
    let mut pending = vec![ROOT];
    while let Some(v) = pending.pop() {
        found.push(v);
        if v < tree.internal() {
            pending.extend(tree.node(v).children);
        }
    }
    found
}

/// Area that an insertion at `target` adds: all boxes of a copy of the tree, before and after.
fn naive_cost(tree: &RbvhTree, aabb: Aabb, target: u32) -> f64 {
    fn total(tree: &RbvhTree, v: u32, target: u32, aabb: Aabb) -> (f64, Aabb) {
        let node = tree.node(v);
        let (below, own) = if v < tree.internal() {
            let [a, b] = node.children.map(|child| total(tree, child, target, aabb));
            let own = a.1.union(b.1);
            (a.0 + b.0 + tree::area(&own), own)
        } else {
            (0.0, node.aabb)
        };
        if v == target { (below + tree::area(&own.union(aabb)), own.union(aabb)) } else { (below, own) }
    }
    total(tree, ROOT, target, aabb).0 - total(tree, ROOT, NO_NODE, aabb).0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn each_child_goes_where_it_adds_least(n in 4usize..40, seed: u64, pick: usize, hint: usize) {
        let (triangles, mut tree) = tree_of(n, seed);
        let candidates = eligible(&tree);
        prop_assume!(!candidates.is_empty());
        let v = candidates[pick % candidates.len()];
        let removed = tree.remove(v);
        let mut search = Search::new(tree.internal());
        for (node, slot) in removed.children.into_iter().zip(removed.slots) {
            let aabb = tree.node(node).aabb;
            let targets = attached(&tree);
            let place = search.best_place(&tree, aabb, targets[hint % targets.len()], u32::MAX);
            prop_assert!(targets.contains(&place.target));
            let least = targets.iter().map(|&t| naive_cost(&tree, aabb, t)).fold(f64::INFINITY, f64::min);
            let found = naive_cost(&tree, aabb, place.target);
            let tolerance = 1e-5 * tree.root_area();
            prop_assert!(found <= least + tolerance, "{found} instead of {least}");
            prop_assert!((f64::from(place.cost) - found).abs() <= tolerance, "says {}, is {found}", place.cost);
            let before = tree.internal_area();
            tree.insert(node, place.target, slot);
            prop_assert!((tree.internal_area() - before - found).abs() <= tolerance);
        }
        checked(&tree, &triangles);
    }

    #[test]
    fn the_cost_at_a_place_is_what_it_adds(n in 4usize..30, seed: u64) {
        let (_, mut tree) = tree_of(n, seed);
        let candidates = eligible(&tree);
        prop_assume!(!candidates.is_empty());
        let removed = tree.remove(candidates[0]);
        let aabb = tree.node(removed.children[0]).aabb;
        for target in attached(&tree) {
            let (have, need) = (f64::from(cost_at(&tree, aabb, target)), naive_cost(&tree, aabb, target));
            prop_assert!((have - need).abs() <= 1e-5 * tree.root_area(), "{target}: {have} instead of {need}");
        }
    }

    #[test]
    fn any_insertions_keep_a_tree_and_its_areas(n in 4usize..60, seed: u64) {
        let (triangles, mut tree) = tree_of(n, seed);
        let mut rng = Rng::new(seed);
        for _ in 0..20 {
            let candidates = eligible(&tree);
            if candidates.is_empty() {
                break;
            }
            let removed = tree.remove(candidates[rng.below(candidates.len())]);
            for (node, slot) in removed.children.into_iter().zip(removed.slots) {
                let targets = attached(&tree);
                // The root often: it is a case of its own.
                let target = if rng.below(4) == 0 { ROOT } else { targets[rng.below(targets.len())] };
                tree.insert(node, target, slot);
            }
            let bvh = checked(&tree, &triangles);
            let measured = quality(&bvh, &SahModel::default()).sah_cost;
            prop_assert!((cost(&tree) / measured - 1.0).abs() < 1e-11, "{} instead of {measured}", cost(&tree));
        }
    }

    #[test]
    fn undo_and_restore_bring_every_bit_back(n in 4usize..60, seed: u64) {
        let (_, mut tree) = tree_of(n, seed);
        let mut rng = Rng::new(seed);
        let kept = tree.nodes();
        tree.keep();
        for round in 0..12 {
            let candidates = eligible(&tree);
            if candidates.is_empty() {
                break;
            }
            let (before, area, mark) = (tree.nodes(), tree.internal_area(), tree.begin());
            let removed = tree.remove(candidates[rng.below(candidates.len())]);
            for (node, slot) in removed.children.into_iter().zip(removed.slots) {
                let targets = attached(&tree);
                let target = if rng.below(4) == 0 { ROOT } else { targets[rng.below(targets.len())] };
                tree.insert(node, target, slot);
            }
            if round % 3 == 0 {
                tree.undo(mark);
                prop_assert_eq!(&tree.nodes(), &before);
                prop_assert_eq!(tree.internal_area(), area);
                let again = RbvhTree::new(Bvh::from_device(&before).unwrap());
                for v in 0..before.len() as u32 {
                    prop_assert_eq!((again.parent(v), again.half_area(v)), (tree.parent(v), tree.half_area(v)));
                }
            }
        }
        tree.restore();
        prop_assert_eq!(tree.nodes(), kept);
    }

    #[test]
    fn the_worst_are_picked_without_a_sort_of_all(n in 2usize..400, seed: u64, part in 0.001f64..1.0) {
        let (_, tree) = tree_of(n, seed);
        let mut selection = Selection::new(&tree, part, 0);
        let measure = |v: u32| {
            let [a, b] = tree.node(v).children.map(|child| f64::from(tree.half_area(child)));
            let own = f64::from(tree.half_area(v));
            let part = |child: f64| child.max(1e-6 * own);
            if own > 0.0 { own / part(0.5 * (a + b)) * (own / part(a.min(b))) * own } else { 0.0 }
        };
        let mut sorted = eligible(&tree);
        sorted.sort_by(|&a, &b| measure(b).total_cmp(&measure(a)));
        // Twice: the second time has a floor from the first.
        for _ in 0..2 {
            selection.pick_worst(&tree);
            let count = ((part * sorted.len() as f64).ceil() as usize).max(32).min(sorted.len());
            prop_assert_eq!(selection.batch.len(), count);
            for (&have, &need) in selection.batch.iter().zip(&sorted) {
                let (have, need) = (measure(have), measure(need));
                prop_assert!((have - need).abs() <= 1e-5 * need, "{have} instead of {need}");
            }
        }
        selection.pick_random(&tree);
        let mut picked = selection.batch.clone();
        picked.sort_unstable();
        picked.dedup();
        prop_assert_eq!(picked.len(), selection.batch.len());
        prop_assert!(picked.iter().all(|v| sorted.contains(v)));
        prop_assert!(picked.len() * 2 >= sorted.len().min(32) || sorted.is_empty());
    }
}

#[test]
fn a_number_that_stands_for_another_node_is_not_due() {
    let (_, tree) = tree_of(40, 3);
    let mut selection = Selection::new(&tree, 1.0, 0);
    selection.pick_worst(&tree);
    let &[a, b, c, ..] = &selection.batch[..] else { panic!("three nodes are picked") };
    selection.recycled([a, b]);
    assert_eq!([a, b, c].map(|v| selection.is_due(&tree, v)), [false, false, true]);
    selection.pick_worst(&tree);
    assert!(selection.is_due(&tree, a));
}

#[test]
fn a_child_without_area_does_not_make_its_parent_infinitely_bad() {
    let point = |x: f32| Triangle { a: [x; 3], b: [x; 3], c: [x; 3] };
    let triangles: Vec<Triangle> = (0..20).map(|k| point(k as f32)).collect();
    let (_, mut nodes) = chain(20);
    for (leaf, triangle) in nodes[19..].iter_mut().zip(&triangles) {
        (leaf.min, leaf.max) = (triangle.aabb().min, triangle.aabb().max);
    }
    let tree = RbvhTree::new(Bvh::from_device(&nodes).unwrap());
    let mut selection = Selection::new(&tree, 1.0, 0);
    selection.pick_worst(&tree);
    assert_eq!(selection.batch.len(), eligible(&tree).len());
    // First the one with two such children; then by their own area, since every node has one.
    let areas: Vec<f32> = selection.batch.iter().map(|&v| tree.half_area(v)).collect();
    assert!(areas[0] == 3.0 && areas[1..].windows(2).all(|pair| pair[0] >= pair[1]), "{areas:?}");
}

use super::super::testing::{Rng, chain, renumbered, tree};
use super::super::{BvhNode, NO_NODE, tree_hash, validate};
use super::*;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use proptest::prelude::*;

fn bound(tree: &mut Bvh, links: u32) -> Option<DepthBound> {
    bound_depth(tree, MaxDepth::new(links), &SahModel::default()).unwrap()
}

/// A tree as deep as it has leaves.
fn deep(n: usize) -> (Vec<Triangle>, Bvh) {
    let (triangles, nodes) = chain(n);
    (triangles, Bvh::from_device(&nodes).unwrap())
}

/// Triangle `k` lies in those before it; `size` is the edge of its box.
fn nested(n: usize, size: impl Fn(usize) -> f32) -> (Vec<Triangle>, Bvh) {
    let triangle = |k: usize| {
        let s = size(k);
        Triangle { a: [0.0; 3], b: [s, 0.0, s], c: [0.0, s, s] }
    };
    let triangles: Vec<Triangle> = (0..n).map(triangle).collect();
    let tree = deep(n).1.with_boxes_of(&triangles);
    (triangles, tree)
}

/// Everything about the leaves but their parents.
fn leaves(tree: &Bvh) -> Vec<Option<(Content, Aabb)>> {
    let leaf = |node: &BvhNode| matches!(node.content, Content::Leaf { .. }).then_some((node.content, node.aabb));
    tree.nodes.iter().map(leaf).collect()
}

#[test]
fn logarithms_are_rounded_up() {
    for (x, expected) in [(1, 0), (2, 1), (3, 2), (4, 2), (5, 3), (1 << 31, 31), ((1 << 31) + 1, 32), (u128::MAX, 128)]
    {
        assert_eq!(ceil_log2(x), expected, "{x}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn every_bound_is_met_and_the_leaves_stay(n in 2usize..120, seed: u64, is_chain: bool) {
        let (triangles, whole) = if is_chain { deep(n) } else { tree(n, seed) };
        let before = quality(&whole, &SahModel::default());
        for links in ceil_log2(n as u128)..before.max_depth + 2 {
            let mut tree = whole.clone();
            let bounded = bound(&mut tree, links);
            prop_assert!(validate(&tree, Some(&triangles)).is_ok(), "{:?}", validate(&tree, Some(&triangles)));
            prop_assert_eq!(MaxDepth::new(links).fault(&tree), None);
            prop_assert_eq!(&tree.triangle_order, &whole.triangle_order);
            prop_assert_eq!(leaves(&tree), leaves(&whole));
            if links >= before.max_depth {
                prop_assert!(bounded.is_none() && tree == whole);
                continue;
            }
            let bounded = bounded.unwrap();
            let after = quality(&tree, &SahModel::default());
            prop_assert_eq!((bounded.depth_before, bounded.depth_after), (before.max_depth, after.max_depth));
            prop_assert_eq!((bounded.cost_before, bounded.cost_after), (before.sah_cost, after.sah_cost));
            prop_assert!(after.max_depth <= links && bounded.subtrees > 0, "{bounded:?}");
            // What is said to be new is all that changed.
            let changed = whole.nodes.iter().zip(&tree.nodes).filter(|(a, b)| a.content != b.content).count();
            prop_assert!(changed <= bounded.nodes as usize, "{changed} nodes changed, {bounded:?}");
        }
    }

    #[test]
    fn neither_numbers_nor_threads_nor_scale_matter(n in 2usize..200, seed: u64, spare in 0u32..4) {
        let (triangles, whole) = tree(n, seed);
        let links = ceil_log2(n as u128) + spare;
        let mut expected = whole.clone();
        bound(&mut expected, links);
        let mut other = renumbered(&whole, &mut Rng::new(seed));
        bound(&mut other, links);
        prop_assert_eq!(tree_hash(&other), tree_hash(&expected));
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut other = whole.clone();
            pool.install(|| bound(&mut other, links));
            prop_assert!(other == expected, "{threads} threads");
        }
        for factor in [2f32.powi(100), 2f32.powi(-100)] {
            let point = |p: [f32; 3]| p.map(|x| x * factor);
            let scaled: Vec<_> =
                triangles.iter().map(|t| Triangle { a: point(t.a), b: point(t.b), c: point(t.c) }).collect();
            let mut other = whole.clone().with_boxes_of(&scaled);
            bound(&mut other, links);
            let topology = |tree: &Bvh| tree.nodes.iter().map(|node| (node.parent, node.content)).collect::<Vec<_>>();
            prop_assert_eq!(topology(&other), topology(&expected), "times {}", factor);
        }
    }
}

/// A chain of `n` pairs of equal triangles, pair by pair along x.
fn chain_of_pairs(n: u32) -> (Vec<Triangle>, Bvh) {
    let at = |x: f32| Triangle { a: [x, 0.0, 0.0], b: [x + 1.0, 0.0, 1.0], c: [x, 1.0, 1.0] };
    let triangles: Vec<Triangle> = (0..2 * n).map(|k| at(10.0 * (k / 2) as f32)).collect();
    let node = |parent, content| BvhNode { aabb: Aabb::EMPTY, parent, content };
    let (pair, leaf) = (|k: u32| n - 1 + k, |k: u32| 2 * n - 1 + k);
    let rest = |p: u32| if p + 2 < n { p + 1 } else { pair(n - 1) };
    let mut nodes: Vec<BvhNode> = (0..n - 1)
        .map(|p| node(p.checked_sub(1).unwrap_or(NO_NODE), Content::Internal { left: pair(p), right: rest(p) }))
        .collect();
    nodes.extend((0..n).map(|k| {
        let content = Content::Internal { left: leaf(2 * k), right: leaf(2 * k + 1) };
        node(k.min(n - 2), content)
    }));
    nodes.extend((0..2 * n).map(|k| node(pair(k / 2), Content::Leaf { first: k, count: 1 })));
    let tree = Bvh { nodes, triangle_order: (0..2 * n).collect() }.with_boxes_of(&triangles);
    assert!(validate(&tree, Some(&triangles)).is_ok());
    (triangles, tree)
}

#[test]
fn as_little_as_can_be_is_built_anew() {
    const N: u32 = 40;
    let (triangles, whole) = chain_of_pairs(N);
    let mut tree = whole.clone();
    let bounded = bound(&mut tree, 20).unwrap();
    assert!(validate(&tree, Some(&triangles)).is_ok() && bounded.subtrees == 1, "{bounded:?}");
    // The top of the chain stays: 80 leaves are no more than what 20 levels hold, also from well below the root.
    for v in 0..8 {
        assert_eq!(tree.nodes[v].content, whole.nodes[v].content, "node {v}");
    }
    // The pairs hang elsewhere, but they stay: no tree that parts them costs less.
    for leaves in tree.nodes[2 * N as usize - 1..].chunks(2) {
        assert_eq!(leaves[0].parent, leaves[1].parent, "{leaves:?}");
    }
}

#[test]
fn nested_triangles_cost_next_to_nothing_more() {
    type Size = fn(usize) -> f32;
    let halves: Size = |k| 0.5f32.powi(k as i32);
    let hundredths: Size = |k| 0.99f32.powi(k as i32);
    let equal_steps: Size = |k| 1.0 - k as f32 / 5000.0;
    for (name, n, most, size) in [
        ("halves", 110, 1e-12, halves),
        ("by a hundredth", 2000, 0.03, hundredths),
        ("by equal steps", 5000, 0.01, equal_steps),
    ] {
        let (triangles, mut tree) = nested(n, size);
        let bounded = bound(&mut tree, MaxDepth::default().get().unwrap()).unwrap();
        println!("{name}: {bounded}");
        assert!(validate(&tree, Some(&triangles)).is_ok());
        assert!(bounded.depth_after <= 63 && bounded.rise() < most, "{name}: {bounded}");
    }
}

#[test]
fn a_chain_of_many_levels() {
    let (triangles, mut tree) = deep(20_000);
    assert_eq!(bound(&mut tree, 15).unwrap().depth_after, 15);
    assert!(validate(&tree, Some(&triangles)).is_ok());
    let (_, mut tree) = deep(20_000);
    let bounded = bound(&mut tree, 1000).unwrap();
    assert!(bounded.depth_after <= 1000 && bounded.depth_before == 19_999, "{bounded:?}");
}

#[test]
fn a_bound_that_no_tree_keeps_is_refused_and_changes_nothing() {
    let (_, whole) = deep(33);
    let mut tree = whole.clone();
    let error = bound_depth(&mut tree, MaxDepth::new(5), &SahModel::default()).unwrap_err();
    assert_eq!(error, TooShallow { max_depth: 5, leaves: 33, least: 6 });
    assert!(tree == whole);
    assert_eq!(MaxDepth::new(5).check(32), Ok(()));
    assert_eq!(MaxDepth::OFF.check(usize::MAX), Ok(()));
    assert_eq!(MaxDepth::new(1).check(1), Ok(()));
    assert_eq!(bound_depth(&mut tree, MaxDepth::OFF, &SahModel::default()), Ok(None));
}

#[test]
fn a_planted_leaf_that_is_too_deep_is_found() {
    let (_, mut tree) = deep(40);
    let fault = MaxDepth::new(20).fault(&tree).unwrap();
    let Content::Internal { left, .. } = tree.nodes[20].content else { panic!() };
    assert_eq!(fault, TreeFault::TooDeep { node: left, depth: 21, max_depth: 20 });
    bound(&mut tree, 20);
    assert_eq!(MaxDepth::new(20).fault(&tree), None);
    // The deepest leaf changes places with a subtree below the root, which was shallower than that by itself.
    let depth = quality(&tree, &SahModel::default()).max_depth;
    assert!(MaxDepth::new(depth - 1).fault(&tree).is_some() && MaxDepth::new(depth).fault(&tree).is_none());
    assert_eq!(MaxDepth::OFF.fault(&tree), None);
}

#[test]
fn a_bound_has_a_text() {
    for (text, bound) in [("63", MaxDepth::default()), ("7", MaxDepth::new(7)), ("off", MaxDepth::OFF)] {
        assert_eq!((text.parse(), bound.to_string()), (Ok(bound), text.to_owned()));
    }
    for text in ["0", "none"] {
        assert_eq!(text.parse(), Ok(MaxDepth::OFF));
    }
    for text in ["-1", "deep", "", "4294967296", "1.5"] {
        assert_eq!(text.parse::<MaxDepth>(), Err(NoMaxDepth), "{text}");
    }
}

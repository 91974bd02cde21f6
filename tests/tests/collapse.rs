//! Adaptive leaves against a naive recursion, on every device, in every order.

use prbvh::build::{DeviceTree, MortonBits, lbvh};
use prbvh::bvh::{Bvh, Content, SahModel, quality, tree_hash, validate};
use prbvh::collapse::{CollapseError, CollapseSettings, collapse};
use prbvh::optimize::{Limits, PrbvhSettings, prbvh};
use prbvh::scene::{SafeRange, built_in};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::soup;
use prbvh_tests::oracle::{NaiveTree, random_tree};
use std::ops::ControlFlow;

/// What is left of a subtree: its leaves in depth-first order, each with its depth, and its cost in f32.
struct Naive {
    leaves: Vec<(u32, Vec<u32>)>,
    cost: f32,
}

fn adaptive(sah: SahModel, max_leaf: Option<u32>) -> CollapseSettings {
    CollapseSettings::default().with(|settings| {
        settings.sah = sah;
        settings.max_leaf = max_leaf;
    })
}

/// The definition, by recursion over a stack of its own: a tree may be a chain.
fn naive(tree: &NaiveTree, settings: &CollapseSettings) -> Naive {
    let root = tree.boxes[0].half_area();
    let relative = |aabb: &Aabb| if root > 0.0 { aabb.half_area() / root } else { 1.0 };
    let (c_t, c_i) = (settings.sah.c_traversal as f32, settings.sah.c_intersect as f32);
    let mut done: Vec<Option<Naive>> = tree.children.iter().map(|_| None).collect();
    let mut stack = vec![(0u32, false)];
    while let Some((v, ready)) = stack.pop() {
        let area = relative(&tree.boxes[v as usize]);
        match tree.children[v as usize][..] {
            [left, right] if !ready => stack.extend([(v, true), (right, false), (left, false)]),
            [left, right] => {
                let [mut left, right] = [left, right].map(|child| done[child as usize].take().expect("done"));
                let keep = c_t * area + (left.cost + right.cost);
                let size = |side: &Naive| side.leaves.iter().map(|leaf| leaf.1.len()).sum::<usize>();
                let size = size(&left) + size(&right);
                left.leaves.extend(right.leaves);
                let as_leaf = c_i * area * size as f32;
                let fits = settings.max_leaf.is_none_or(|most| size <= most as usize);
                done[v as usize] = Some(if fits && as_leaf < keep {
                    let all = left.leaves.into_iter().flat_map(|leaf| leaf.1).collect();
                    Naive { leaves: vec![(0, all)], cost: as_leaf }
                } else {
                    let deeper = |(depth, ids)| (depth + 1, ids);
                    Naive { leaves: left.leaves.into_iter().map(deeper).collect(), cost: keep }
                });
            }
            _ => {
                let ids = vec![tree.references[v as usize]];
                done[v as usize] = Some(Naive { leaves: vec![(0, ids)], cost: c_i * area });
            }
        }
    }
    done[0].take().expect("the root is done")
}

/// Leaves of a tree in depth-first order with their depths.
fn leaves(tree: &Bvh) -> Vec<(u32, Vec<u32>)> {
    let mut found = Vec::new();
    let mut stack = vec![(0u32, 0u32)];
    while let Some((v, depth)) = stack.pop() {
        match tree.nodes[v as usize].content {
            Content::Internal { left, right } => stack.extend([(right, depth + 1), (left, depth + 1)]),
            Content::Leaf { first, count } => {
                let ids = tree.triangle_order[first as usize..][..count as usize].to_vec();
                found.push((depth, ids));
            }
        }
    }
    found
}

/// Collapses on every device in every order; the common tree, checked against the recursion.
fn check(nodes: &[Node], settings: &CollapseSettings, triangles: &[Triangle], what: &str) -> Bvh {
    let expected = naive(&NaiveTree::decode(nodes), settings);
    let mut first: Option<(String, Bvh)> = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let before = device.memory().bytes;
            let tree = DeviceTree::upload(&mut **device, nodes).unwrap();
            let collapsed = collapse(&mut **device, &tree, settings).unwrap();
            assert_eq!(tree.download(&mut **device).unwrap(), nodes, "the tree stays as it is");
            tree.free(&mut **device);
            let device_cost = collapsed.device_cost;
            let result = collapsed.free(&mut **device);
            assert_eq!(device.memory().bytes, before, "{what}, {name}: all buffers are given back");
            match &first {
                Some((first_name, tree)) => assert!(*tree == result, "{what}: {first_name} and {name} differ"),
                None => {
                    validate(&result, Some(triangles)).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
                    let measured = quality(&result, &settings.sah).sah_cost;
                    // Sums in f32 lose digits with the depth, which is at most `n`.
                    let part = 1e-5 + 1e-8 * triangles.len() as f64;
                    let close = |cost: f64| (cost - measured).abs() <= part * measured;
                    assert!(close(device_cost), "{what}: the device says {device_cost}, f64 says {measured}");
                    let oracle = f64::from(expected.cost);
                    assert!(close(oracle), "{what}: the oracle says {oracle}, f64 says {measured}");
                    first = Some((name.clone(), result));
                }
            }
        }
    });
    let (_, tree) = first.expect("there is always the CPU");
    assert!(leaves(&tree) == expected.leaves, "{what}: other leaves than the recursion's");
    // In depth-first order the triangles of the leaves follow each other.
    let order: Vec<u32> = expected.leaves.into_iter().flat_map(|leaf| leaf.1).collect();
    assert_eq!(tree.triangle_order, order, "{what}");
    tree
}

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

#[test]
fn random_trees_collapse_as_the_recursion_says() {
    let models = [(3.0, 2.0), (1.0, 1.0), (1.2, 1.0), (0.0, 1.0), (1.0, 0.0)];
    for (k, n) in [1, 2, 3, 4, 5, 64, 65, 1000].into_iter().enumerate() {
        let triangles = soup(n, 0.3, n as u64);
        let tree = random_tree(&boxes_of(&triangles), k as u64).encode();
        for (c_traversal, c_intersect) in models {
            for max_leaf in [None, Some(1), Some(3), Some(8)] {
                let settings = adaptive(SahModel { c_traversal, c_intersect }, max_leaf);
                check(&tree, &settings, &triangles, &format!("{n} triangles, {settings:?}"));
            }
        }
    }
}

/// The LBVH of a scene after some iterations.
fn optimised(triangles: &[Triangle]) -> Vec<Node> {
    let mut device = prbvh::device::cpu::CpuDevice::new(2).unwrap();
    let (tree, _) = lbvh(&mut device, triangles, MortonBits::Sixty).unwrap();
    let settings = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(5));
    prbvh(&mut device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap();
    tree.download(&mut device).unwrap()
}

#[test]
fn the_built_in_scene_gets_cheaper() {
    let scene = built_in(20_000);
    let triangles = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let nodes = optimised(&triangles);
    let before = quality(&Bvh::from_device(&nodes).unwrap(), &SahModel::default());
    let tree = check(&nodes, &CollapseSettings::default(), &triangles, "built-in");
    let after = quality(&tree, &SahModel::default());
    assert!(after.sah_cost < 0.97 * before.sah_cost, "{} is not below {}", after.sah_cost, before.sah_cost);
    assert!(after.leaves < before.leaves && after.max_depth <= before.max_depth && after.triangles == 20_000);
    let handed_out = tree.with_boxes_of(&scene.triangles);
    validate(&handed_out, Some(&scene.triangles)).unwrap_or_else(|faults| panic!("{faults:?}"));
    let again = quality(&handed_out, &SahModel::default()).sah_cost;
    assert!((again / after.sah_cost - 1.0).abs() < 1e-6, "the scale does not matter: {again}, {}", after.sah_cost);

    let limited = CollapseSettings::default().with(|s| s.max_leaf = Some(4));
    let tree = check(&nodes, &limited, &triangles, "leaves of at most 4");
    let counts: Vec<u32> = leaves(&tree).iter().map(|leaf| leaf.1.len() as u32).collect();
    assert_eq!(counts.iter().max(), Some(&4));
    assert!(quality(&tree, &SahModel::default()).sah_cost >= after.sah_cost);
}

#[test]
fn a_tie_stays_a_node() {
    // Two triangles that fill the root's box: as a leaf 2 c_I, as a node c_T + 2 c_I.
    let corner = |a: [f32; 3]| Triangle { a: [0.0; 3], b: a, c: [1.0, 1.0, 0.0] };
    let triangles = [corner([1.0, 0.0, 0.0]), corner([0.0, 1.0, 0.0])];
    let tree = random_tree(&boxes_of(&triangles), 1).encode();
    let with = |c_traversal| adaptive(SahModel { c_traversal, c_intersect: 2.0 }, None);
    assert_eq!(check(&tree, &with(0.0), &triangles, "equal costs").nodes.len(), 3);
    assert_eq!(check(&tree, &with(0.001), &triangles, "a leaf is cheaper").nodes.len(), 1);
}

#[test]
fn coincident_triangles_become_a_root_that_is_a_leaf() {
    let triangles = vec![soup(1, 0.3, 7)[0]; 300];
    let tree = random_tree(&boxes_of(&triangles), 3).encode();
    let tree = check(&tree, &CollapseSettings::default(), &triangles, "coincident");
    assert_eq!((tree.nodes.len(), tree.nodes[0].content), (1, Content::Leaf { first: 0, count: 300 }));
    // Points: no box has an area, so that every ratio counts as 1.
    let points = vec![Triangle { a: [1.0; 3], b: [1.0; 3], c: [1.0; 3] }; 50];
    let tree = random_tree(&boxes_of(&points), 3).encode();
    assert_eq!(check(&tree, &CollapseSettings::default(), &points, "points").nodes.len(), 1);
}

#[test]
fn a_chain_collapses_too() {
    let n = 10_000u32;
    let triangles = soup(n as usize, 0.01, 9);
    let boxes = boxes_of(&triangles);
    let mut tree = NaiveTree {
        children: vec![Vec::new(); 2 * n as usize - 1],
        boxes: vec![boxes[0]; n as usize - 1],
        references: vec![0; n as usize - 1],
    };
    tree.boxes.extend(&boxes);
    tree.references.extend(0..n);
    for p in (0..n - 1).rev() {
        let right = if p + 2 < n { p + 1 } else { 2 * n - 2 };
        tree.children[p as usize] = vec![n - 1 + p, right];
        tree.boxes[p as usize] = tree.boxes[(n - 1 + p) as usize].union(tree.boxes[right as usize]);
    }
    let single = CollapseSettings::default().with(|s| s.max_leaf = Some(1));
    let kept = check(&tree.encode(), &single, &triangles, "chain");
    assert_eq!(quality(&kept, &SahModel::default()).max_depth, n - 1);
    check(&tree.encode(), &CollapseSettings::default(), &triangles, "chain");
}

#[test]
fn what_is_no_tree_is_refused() {
    let triangles = soup(8, 0.3, 5);
    let mut nodes = random_tree(&boxes_of(&triangles), 5).encode();
    // A right child that names another parent than its own: that one is never complete.
    let right = nodes[nodes[3].down as usize].up;
    nodes[right as usize].up = 4 | prbvh_kernel::node::RIGHT;
    with_devices(|devices| {
        for (name, device) in devices {
            let before = device.memory().bytes;
            let tree = DeviceTree::upload(&mut **device, &nodes).unwrap();
            let error = collapse(&mut **device, &tree, &CollapseSettings::default()).unwrap_err();
            assert!(matches!(error, CollapseError::InvalidTree { .. }), "{name}: {error}");
            for (c_traversal, max_leaf) in [(f64::NAN, None), (-1.0, None), (3.0, Some(0))] {
                let settings = adaptive(SahModel { c_traversal, c_intersect: 2.0 }, max_leaf);
                let error = collapse(&mut **device, &tree, &settings).unwrap_err();
                assert!(matches!(error, CollapseError::Setting { .. }), "{name}: {error}");
            }
            tree.free(&mut **device);
            assert_eq!(device.memory().bytes, before);
        }
    });
}

#[test]
fn the_comparison_would_find_another_tree() {
    let triangles = soup(100, 0.3, 6);
    let boxes = boxes_of(&triangles);
    let settings = CollapseSettings::default();
    let hash = |seed| tree_hash(&check(&random_tree(&boxes, seed).encode(), &settings, &triangles, "seeds"));
    assert_ne!(hash(1), hash(2));
}

#[test]
fn the_pipeline_hands_out_both_qualities() {
    let scene = built_in(3000);
    let prbvh = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(10));
    let run = |adaptive| {
        let mut device = prbvh::device::cpu::CpuDevice::new(2).unwrap();
        let settings = prbvh::pipeline::Settings::default().with(|s| {
            s.prbvh = prbvh.clone();
            s.adaptive = adaptive;
        });
        let result = prbvh::pipeline::optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(()));
        result.unwrap()
    };
    let single = run(None);
    let both = run(Some(CollapseSettings::default()));
    assert_eq!((single.quality, single.adaptive), (both.quality, None));
    let adaptive = both.adaptive.expect("asked for");
    assert!(adaptive.sah_cost < both.quality.sah_cost && adaptive.leaves < 3000);
    assert_eq!(quality(&both.tree, &SahModel::default()), adaptive);
    assert_eq!(quality(&single.tree, &SahModel::default()), both.quality);
}

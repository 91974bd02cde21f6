//! TRBVH: treelets against the best of all trees over their leaves, on every device, on inputs of every kind.

use prbvh::build::{
    DEFAULT_PASSES, DeviceTree, MortonBits, Pass, Restructured, TreeletSize, UnfitTree, atrbvh, lbvh,
    restructure_optimally, restructure_optimally_unchecked, trbvh,
};
use prbvh::bvh::{Bvh, quality, tree_hash, validate};
use prbvh::device::Device;
use prbvh::scene::built_in;
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::atrbvh::{OPTIMAL_TREELET, RELATIVE_THRESHOLD, RestructureParams};
use prbvh_kernel::node::{Node, RIGHT};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{APPLIED, FAULTS, REPORT_WORDS};
use prbvh_tests::best_tree::least_internal_area;
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{Random, inputs, nested, soup, working};
use prbvh_tests::oracle::{NaiveTree, comb, half_area, random_tree, tree_of};
use std::num::NonZeroU32;

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

fn valid(nodes: &[Node], triangles: &[Triangle], what: &str) -> Bvh {
    let tree = Bvh::from_device(nodes).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    validate(&tree, Some(triangles)).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    tree
}

fn cost(nodes: &[Node], triangles: &[Triangle], what: &str) -> f64 {
    quality(&valid(nodes, triangles, what), &Default::default()).sah_cost
}

fn case(kernel: Kernel, nodes: &[Node], leaves: u32) -> Case {
    let params = RestructureParams { count: 1, first: 0, treelet: leaves, internal: nodes.len() as u32 / 2 };
    Case::new(kernel, 1, &params).with(&[0u32]).with(nodes).zeros(REPORT_WORDS as usize)
}

/// Boxes of the leaves of the treelet below the root, and the area of the internal nodes of the tree that are not in it.
fn treelet(tree: &NaiveTree, leaves: usize) -> (Vec<Aabb>, f64) {
    let mut slots = vec![0u32];
    let mut opened = 0.0;
    while slots.len() < leaves {
        let openable = (0..slots.len()).filter(|&k| !tree.children[slots[k] as usize].is_empty());
        let area = |k: &usize| tree.boxes[slots[*k] as usize].half_area();
        let Some(largest) = openable.min_by(|a, b| area(b).total_cmp(&area(a)).then(a.cmp(b))) else { break };
        let v = slots[largest] as usize;
        opened += half_area(&tree.boxes[v]);
        slots[largest] = tree.children[v][0];
        slots.push(tree.children[v][1]);
    }
    (slots.iter().map(|&v| tree.boxes[v as usize]).collect(), tree.internal_area() - opened)
}

/// Whether the treelet of a tree is as good as any over its leaves, up to what is not worth it and rounding.
fn is_best(tree: &NaiveTree, (leaves, rest): &(Vec<Aabb>, f64)) -> bool {
    let have = tree.internal_area() - rest;
    let least = least_internal_area(leaves);
    assert!(have > least * (1.0 - 1e-6), "better than the best: {have} {least}");
    have <= least * (1.0 + 1.5 * f64::from(RELATIVE_THRESHOLD))
}

#[test]
fn a_treelet_is_the_best_of_all() {
    let (mut replaced, mut clustered_worse) = (0, 0);
    for seed in 0..40 {
        let n = 3 + (seed as usize * 7) % 60;
        let tree = random_tree(&boxes_of(&soup(n, 0.2, seed)), seed);
        for leaves in [3, 5, 6, 7] {
            let of = treelet(&tree, leaves as usize);
            let result = case(Kernel::TrbvhRestructure, &tree.encode(), leaves).run_everywhere();
            let report = result.get::<u32>("report");
            assert_eq!(report[FAULTS], 0);
            let mut made = NaiveTree::decode(&result.get::<Node>("nodes"));
            let boxes = made.boxes.clone();
            made.refit(0);
            assert!(made.boxes == boxes, "seed {seed}, {leaves} leaves: boxes");
            assert!(is_best(&made, &of), "seed {seed}, {leaves} leaves");
            assert_eq!(report[APPLIED] == 1, made != tree, "seed {seed}, {leaves} leaves");
            replaced += report[APPLIED];
            // A planted fault: what is merely clustered is not always the best.
            let clustered = case(Kernel::AtrbvhRestructure, &tree.encode(), leaves).run_everywhere();
            clustered_worse += u32::from(!is_best(&NaiveTree::decode(&clustered.get::<Node>("nodes")), &of));
        }
    }
    assert!(replaced > 120 && clustered_worse > 10, "{replaced} replaced, {clustered_worse} clustered worse");
}

#[test]
fn no_box_breaks_a_treelet() {
    let mut random = Random(3);
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 0.0, -0.0, 1.0, 1e-40];
    for seed in 0..20 {
        let mut tree = random_tree(&boxes_of(&soup(40, 0.2, seed)), seed);
        for aabb in &mut tree.boxes {
            let mut corner = || [0; 3].map(|_| values[random.bits() as usize % values.len()]);
            *aabb = Aabb { min: corner(), max: corner() };
        }
        let case = case(Kernel::TrbvhRestructure, &tree.encode(), OPTIMAL_TREELET);
        with_devices(|devices| {
            for (name, device) in devices {
                let result = case.run_on(&mut **device).unwrap();
                // Panics if the links are no tree any more.
                let _ = NaiveTree::decode(&result.get::<Node>("nodes"));
                assert_eq!(result.get::<u32>("report")[FAULTS], 0, "{name}");
            }
        });
    }
}

/// Restructures a copy of `nodes` on every device; all make the same tree in the same passes, and each that replaced something lowers the cost.
fn check(nodes: &[Node], triangles: &[Triangle], passes: u32, what: &str) -> (Vec<Node>, Vec<Pass>) {
    let mut first: Option<(Vec<Node>, Vec<Pass>)> = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let device = &mut **device;
            let before = device.memory().bytes;
            let tree = DeviceTree::upload(device, nodes).unwrap();
            let mut costs = vec![cost(nodes, triangles, what)];
            let observe = &mut |_: &Pass, device: &mut dyn Device| {
                costs.push(cost(&tree.download(device).unwrap(), triangles, what));
            };
            let passes = NonZeroU32::new(passes).unwrap();
            let Restructured { passes, .. } = restructure_optimally_unchecked(device, &tree, passes, observe).unwrap();
            let result = (tree.download(device).unwrap(), passes);
            tree.free(device);
            assert_eq!(device.memory().bytes, before, "{what}, {name}: all buffers are given back");
            let has_area = nodes[0].aabb().half_area() > 0.0;
            let fell = |(pass, pair): (&Pass, &[f64])| {
                if pass.restructured > 0 { pair[1] < pair[0] } else { pair[1] == pair[0] }
            };
            let falls = result.1.iter().zip(costs.windows(2)).all(fell);
            assert!(!has_area || falls, "{what}, {name}: {:?} {costs:?}", result.1);
            let first = first.get_or_insert_with(|| result.clone());
            assert_eq!(first.1, result.1, "{what}, {name}");
            let words = bytemuck::cast_slice::<Node, u32>;
            assert!(words(&first.0) == words(&result.0), "{what}, {name}");
        }
    });
    first.expect("there is always the CPU")
}

#[test]
fn passes_agree_on_every_input() {
    let equal = vec![soup(1, 0.3, 2)[0]; 70_000];
    let mut inputs = inputs();
    inputs.push(("three times", soup(200, 0.1, 3).into_iter().flat_map(|t| [t; 3]).collect()));
    for (name, triangles) in inputs {
        let triangles = working(&triangles);
        let nodes = tree_of(&triangles, 5).encode();
        let (result, passes) = check(&nodes, &triangles, 3, name);
        assert!(passes.len() <= 3);
        let least = OPTIMAL_TREELET.min(triangles.len() as u32);
        assert!(passes.iter().zip([1, 2, 4]).all(|(pass, times)| pass.gamma == times * least), "{name}: {passes:?}");
        if triangles.len() < 3 {
            assert_eq!(result, nodes, "{name}");
        }
    }
    // Large, and nothing to gain.
    let triangles = working(&equal);
    with_devices(|devices| {
        for (name, device) in devices.iter_mut().skip(4) {
            let (tree, _, passes) = trbvh(&mut **device, &triangles, MortonBits::Sixty, DEFAULT_PASSES).unwrap();
            assert_eq!((passes.len(), passes[0].restructured), (1, 0), "{name}");
            tree.free(&mut **device);
        }
    });
}

#[test]
fn a_chain_becomes_cheaper_level_by_level() {
    let triangles = working(&nested(300));
    let mut tree = comb(&boxes_of(&triangles));
    // The smallest hang near the root, so that every box is about the largest.
    tree.refit(0);
    let dear = tree.encode();
    let (result, passes) = check(&dear, &triangles, 3, "a dear chain");
    assert!(passes[0].levels > 250, "{passes:?}");
    let (before, after) = (cost(&dear, &triangles, "before"), cost(&result, &triangles, "after"));
    assert!(after < 0.99 * before, "{before} {after}");
}

#[test]
fn links_that_are_no_tree_are_refused() {
    let triangles = working(&soup(100, 0.1, 1));
    let mut broken = random_tree(&boxes_of(&triangles), 1).encode();
    let leaf = broken.len() - 1;
    broken[leaf].up = broken[leaf - 1].up | RIGHT;
    with_devices(|devices| {
        for (name, device) in devices {
            let device = &mut **device;
            let tree = DeviceTree::upload(device, &broken).unwrap();
            let refused = restructure_optimally(device, &tree, DEFAULT_PASSES, &mut |_, _| {}).unwrap_err();
            tree.free(device);
            assert!(matches!(refused, UnfitTree::Broken { .. }), "{name}: {refused}");
        }
    });
}

#[test]
fn a_hall_costs_much_less_than_its_lbvh() {
    let triangles = working(&built_in(20_000).triangles);
    let mut results = Vec::new();
    with_devices(|devices| {
        for (name, device) in devices.iter_mut().skip(4) {
            let device = &mut **device;
            let take = |tree: DeviceTree, device: &mut dyn Device| {
                let nodes = tree.download(device).unwrap();
                tree.free(device);
                (tree_hash(&valid(&nodes, &triangles, name)), cost(&nodes, &triangles, name))
            };
            let optimal = trbvh(device, &triangles, MortonBits::Sixty, DEFAULT_PASSES).unwrap().0;
            let clustered = atrbvh(device, &triangles, MortonBits::Sixty, TreeletSize::DEFAULT).unwrap().0;
            let plain = lbvh(device, &triangles, MortonBits::Sixty).unwrap().0;
            results.push([take(optimal, device), take(clustered, device), take(plain, device)]);
        }
    });
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{results:?}");
    let [optimal, clustered, plain] = [0, 1, 2].map(|k| results[0][k].1);
    eprintln!("LBVH {plain:.2}, TRBVH {optimal:.2}, ATRBVH {clustered:.2}");
    assert!(optimal < 0.8 * plain && optimal < 1.05 * clustered, "{optimal} {clustered} {plain}");
}

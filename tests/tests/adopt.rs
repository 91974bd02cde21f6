//! What an engine brings along: trees of its own, with leaves of any size, spatial splits, boxes, and values that make no sense.

use prbvh::build::{DeviceTree, MortonBits, UnfitTree, lbvh, ploc, sah_binned, sah_sweep};
use prbvh::bvh::{Bvh, BvhNode, Content, SahModel, TreeFault, quality, tree_hash, validate, validate_references};
use prbvh::collapse::{CollapseError, CollapseSettings, collapse};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{Device, DeviceError};
use prbvh::interop::obvhs::from_bvh2;
use prbvh::optimize::{IterationRow, OptimizeError, PrbvhSettings, RbvhSettings, measure, prbvh, rbvh};
use prbvh::pipeline::{Initial, Leaves, Optimizer, PipelineError, Settings, optimize, optimize_tree};
use prbvh::scene::{Aabb, SafeRange, Scene, Triangle, built_in};
use prbvh_kernel::node::Node;
use prbvh_tests::bench::obvhs::triangles as peer_triangles;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::soup;
use prbvh_tests::walk::{enters, lines, meets, nearest, through};
use proptest::prelude::*;
use std::ops::ControlFlow;

fn go_on(_: &IterationRow) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn cpu() -> CpuDevice {
    CpuDevice::new(2).unwrap()
}

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

fn cost(tree: &Bvh) -> f64 {
    quality(tree, &SahModel::default()).sah_cost
}

/// An LBVH with leaves of up to four triangles.
fn with_leaves(scene: &Scene) -> Bvh {
    let adaptive = Some(CollapseSettings::default().with(|s| s.max_leaf = Some(4)));
    let settings = Settings::default().with(|s| {
        s.optimizer = Optimizer::None;
        s.adaptive = adaptive;
    });
    let tree = optimize(scene, &mut cpu(), &settings, &mut go_on).unwrap().tree;
    assert!(tree.nodes.len() < 2 * scene.triangles.len() - 1, "leaves of several triangles");
    tree
}

/// Each leaf whose box is wide, cut in two at the middle of its longest side: both halves hold what the leaf held.
fn with_splits(tree: &Bvh, wider: f32) -> Bvh {
    let mut split = tree.clone();
    for v in 0..tree.nodes.len() {
        let Content::Leaf { first, count } = tree.nodes[v].content else { continue };
        let aabb = tree.nodes[v].aabb;
        let extents = [0, 1, 2].map(|k| aabb.max[k] - aabb.min[k]);
        let axis = (0..3).max_by(|&a, &b| extents[a].total_cmp(&extents[b])).unwrap();
        // Pieces of a primitive that ends before the cut would be apart from the other half.
        if count != 1 || extents[axis] < wider {
            continue;
        }
        let middle = 0.5 * (aabb.min[axis] + aabb.max[axis]);
        let (mut low, mut high) = (aabb, aabb);
        (low.max[axis], high.min[axis]) = (middle, middle);
        let again = split.triangle_order.len() as u32;
        split.triangle_order.push(tree.triangle_order[first as usize]);
        let left = split.nodes.len() as u32;
        let child = |aabb, first| BvhNode { aabb, parent: v as u32, content: Content::Leaf { first, count: 1 } };
        split.nodes.extend([child(low, first), child(high, again)]);
        split.nodes[v].content = Content::Internal { left, right: left + 1 };
    }
    assert!(split.nodes.len() > tree.nodes.len() + 20, "some leaves are wide");
    split
}

/// What 10,000 rays meet through the tree is what they meet at all.
fn same_hits(tree: &Bvh, triangles: &[Triangle], what: &str) {
    let mut met = 0;
    for line in lines(&tree.nodes[0].aabb, 10_000, 7) {
        let hit = |triangle: u32| meets(&triangles[triangle as usize], &line);
        let found = through(tree, &line, hit);
        // Only what is near the ray need be asked.
        let near = (0..triangles.len() as u32).filter(|&t| enters(&triangles[t as usize].aabb(), &line).is_some());
        assert_eq!(found, nearest(near, hit), "{what}: {line:?}");
        met += u32::from(found.is_some());
    }
    assert!(met > 2000, "{what}: {met} rays meet something");
}

/// Sorted triangles of each leaf, sorted.
fn leaves(tree: &Bvh) -> Vec<Vec<u32>> {
    let held = |node: &BvhNode| match node.content {
        Content::Leaf { first, count } => {
            let mut held = tree.triangle_order[first as usize..][..count as usize].to_vec();
            held.sort_unstable();
            Some(held)
        }
        Content::Internal { .. } => None,
    };
    let mut leaves: Vec<Vec<u32>> = tree.nodes.iter().filter_map(held).collect();
    leaves.sort_unstable();
    leaves
}

#[test]
fn leaves_may_stay_what_they_are() {
    let scene = built_in(3000);
    let given = with_leaves(&scene);
    let mut first = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let mut tree = given.clone();
            let done =
                optimize_tree(&mut tree, Leaves::Whole, &mut **device, &Settings::default(), &mut go_on).unwrap();
            validate(&tree, Some(&scene.triangles)).unwrap();
            assert_eq!(leaves(&tree), leaves(&given), "{name}");
            assert_eq!((done.initial.sah_cost, done.quality.sah_cost), (cost(&given), cost(&tree)), "{name}");
            assert!(cost(&tree) < 0.9 * cost(&given), "{name}: {} of {}", cost(&tree), cost(&given));
            let hash = tree_hash(&tree);
            assert_eq!(*first.get_or_insert_with(|| hash.clone()), hash, "{name}");
        }
    });
}

#[test]
fn leaves_may_be_made_anew() {
    let scene = built_in(3000);
    let mut tree = with_leaves(&scene);
    let before = cost(&tree);
    let boxes = scene.boxes();
    let done = optimize_tree(&mut tree, Leaves::Split(&boxes), &mut cpu(), &Settings::default(), &mut go_on).unwrap();
    validate(&tree, Some(&scene.triangles)).unwrap();
    assert!(done.quality.sah_cost < 0.9 * before && done.quality.sah_cost == cost(&tree));
    assert!(leaves(&tree).iter().all(|leaf| leaf.len() <= 4));
    same_hits(&tree, &scene.triangles, "leaves made anew");
    let again = tree.clone();
    optimize_tree(&mut tree, Leaves::Split(&boxes), &mut cpu(), &Settings::default(), &mut go_on).unwrap();
    assert!(cost(&tree) <= cost(&again), "never worse");
}

#[test]
fn spatial_splits_stay_splits() {
    let scene = built_in(2000);
    let boxes = scene.boxes();
    let settings = Settings::default().with(|s| s.optimizer = Optimizer::None);
    let plain = optimize(&scene, &mut cpu(), &settings, &mut go_on).unwrap().tree;
    let given = with_splits(&plain, 0.5);
    validate_references(&given, &boxes).unwrap();
    same_hits(&given, &scene.triangles, "splits as given");
    for leaves in [Leaves::Whole, Leaves::Split(&boxes)] {
        let mut tree = given.clone();
        let done = optimize_tree(&mut tree, leaves, &mut cpu(), &Settings::default(), &mut go_on).unwrap();
        validate_references(&tree, &boxes).unwrap();
        assert_eq!(tree.triangle_order.len(), given.triangle_order.len());
        assert!(done.quality.sah_cost < 0.95 * done.initial.sah_cost, "{leaves:?}");
        same_hits(&tree, &scene.triangles, "splits optimised");
    }
    // The same as an initial tree of a scene.
    let settings = Settings::default().with(|s| s.initial = given.clone().into());
    let done = optimize(&scene, &mut cpu(), &settings, &mut go_on).unwrap();
    validate_references(&done.tree, &boxes).unwrap();
    assert!(done.quality.sah_cost < done.initial.sah_cost);
    assert_eq!(done.quality.triangles as usize, given.triangle_order.len());
}

#[test]
fn a_tree_of_a_scene_may_have_any_leaves() {
    let scene = built_in(2000);
    let tree = with_leaves(&scene);
    let settings = Settings::default().with(|s| s.initial = Initial::from(tree.clone()));
    for optimizer in [Optimizer::Prbvh, Optimizer::Rbvh(RbvhSettings::default()), Optimizer::None] {
        let settings = settings.clone().with(|s| s.optimizer = optimizer);
        let done = optimize(&scene, &mut cpu(), &settings, &mut go_on).unwrap();
        validate(&done.tree, Some(&scene.triangles)).unwrap();
        assert_eq!(done.tree.nodes.len(), 2 * scene.triangles.len() - 1);
        assert!(done.quality.sah_cost <= done.initial.sah_cost);
    }
    assert_eq!(settings.initial.to_string(), "tree");
    let other = built_in(1999);
    let refused = optimize(&other, &mut cpu(), &settings, &mut go_on).unwrap_err();
    let PipelineError::GivenTree { faults } = &refused else { panic!("{refused}") };
    assert!(
        matches!(faults[..], [TreeFault::TriangleOutOfRange { triangle: 1999, triangles: 1999, .. }]),
        "{faults:?}"
    );
}

#[test]
fn a_tree_of_obvhs_goes_in_and_out() {
    let scene = built_in(3000);
    let primitives = peer_triangles(&scene);
    let params = obvhs::BvhBuildParams::medium_build();
    let theirs = obvhs::bvh2::builder::build_bvh2_from_tris(&primitives, params, &mut std::time::Duration::default());
    let mut tree = from_bvh2(&theirs).unwrap();
    let largest = leaves(&tree).iter().map(Vec::len).max();
    assert!(largest > Some(1), "its usual leaves hold several");
    let done = optimize_tree(&mut tree, Leaves::Whole, &mut cpu(), &Settings::default(), &mut go_on).unwrap();
    assert!(done.quality.sah_cost < done.initial.sah_cost);
    validate_references(&tree, &scene.boxes()).unwrap();
    same_hits(&tree, &scene.triangles, "of obvhs");
}

#[test]
fn boxes_are_primitives() {
    let boxes: Vec<Aabb> = boxes_of(&soup(2000, 0.1, 3));
    let scene = Scene::from_boxes("boxes", &boxes).unwrap();
    let settings = Settings::default().with(|s| s.adaptive = Some(CollapseSettings::default()));
    for settings in [Settings::default(), settings] {
        let done = optimize(&scene, &mut cpu(), &settings, &mut go_on).unwrap();
        validate_references(&done.tree, &boxes).unwrap();
        assert_eq!(done.tree.triangle_order.len(), boxes.len());
        assert!(done.quality.sah_cost < done.initial.sah_cost);
        for line in lines(&done.tree.nodes[0].aabb, 10_000, 5) {
            let hit = |k: u32| enters(&boxes[k as usize], &line);
            assert_eq!(through(&done.tree, &line, hit), nearest(0..boxes.len() as u32, hit));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_tree_comes_out_as_one_over_the_same(n in 1usize..120, most in 1u32..9, seed: u64) {
        let scene = Scene::from_triangles("soup", soup(n, 0.3, seed)).unwrap();
        let boxes = scene.boxes();
        let adaptive = Some(CollapseSettings::default().with(|s| s.max_leaf = Some(most)));
        let made = Settings::default().with(|s| { s.optimizer = Optimizer::None; s.adaptive = adaptive; });
        let given = optimize(&scene, &mut cpu(), &made, &mut go_on).unwrap().tree;
        for how in [Leaves::Whole, Leaves::Split(&boxes)] {
            let mut tree = given.clone();
            let done = optimize_tree(&mut tree, how, &mut cpu(), &Settings::default(), &mut go_on).unwrap();
            prop_assert!(validate(&tree, Some(&scene.triangles)).is_ok());
            prop_assert!(done.quality.sah_cost <= done.initial.sah_cost);
            if matches!(how, Leaves::Whole) {
                prop_assert_eq!(leaves(&tree), leaves(&given));
            }
        }
    }
}

#[test]
fn what_is_no_tree_is_refused_and_stays() {
    let scene = built_in(500);
    let good = with_leaves(&scene);
    let boxes = scene.boxes();
    type Plant = fn(&mut Bvh);
    let faults: [(&str, Plant); 5] = [
        ("empty", |tree| tree.nodes.clear()),
        ("ring", |tree| tree.nodes[3].parent = 3),
        ("range", |tree| tree.triangle_order.truncate(9)),
        ("not a number", |tree| {
            let leaf = tree.nodes.iter_mut().find(|node| matches!(node.content, Content::Leaf { .. })).unwrap();
            leaf.aabb.min[0] = f32::NAN;
        }),
        ("inverted", |tree| {
            let leaf = tree.nodes.iter_mut().find(|node| matches!(node.content, Content::Leaf { .. })).unwrap();
            leaf.aabb.min[0] = leaf.aabb.max[0] + 1.0;
        }),
    ];
    for (name, plant) in faults {
        let mut bad = good.clone();
        plant(&mut bad);
        let before = format!("{bad:?}");
        for how in [Leaves::Whole, Leaves::Split(&boxes)] {
            let refused = optimize_tree(&mut bad, how, &mut cpu(), &Settings::default(), &mut go_on).unwrap_err();
            assert!(matches!(refused, PipelineError::GivenTree { .. }), "{name}, {how:?}: {refused}");
            assert_eq!(format!("{bad:?}"), before);
        }
    }
    let mut tree = good.clone();
    let short = &boxes[..boxes.len() - 1];
    assert!(optimize_tree(&mut tree, Leaves::Split(short), &mut cpu(), &Settings::default(), &mut go_on).is_err());
    let adaptive = Settings::default().with(|s| s.adaptive = Some(CollapseSettings::default()));
    let refused = optimize_tree(&mut tree, Leaves::Whole, &mut cpu(), &adaptive, &mut go_on).unwrap_err();
    assert!(refused.to_string().starts_with("adaptive is given"), "{refused}");
    assert_eq!(tree, good);
}

/// Boxes of any scale are optimised, to the same tree.
#[test]
fn trees_of_any_scale_are_optimised() {
    let scene = built_in(1000);
    let given = with_leaves(&scene);
    let topology = |tree: &Bvh| tree.nodes.iter().map(|node| (node.parent, node.content)).collect::<Vec<_>>();
    let mut expected = given.clone();
    optimize_tree(&mut expected, Leaves::Whole, &mut cpu(), &Settings::default(), &mut go_on).unwrap();
    for exponent in [-100, -60, 60, 100] {
        let mut tree = given.clone();
        for node in &mut tree.nodes {
            let scaled = |corner: [f32; 3]| corner.map(|x| x * 2f32.powi(exponent));
            node.aabb = Aabb { min: scaled(node.aabb.min), max: scaled(node.aabb.max) };
        }
        optimize_tree(&mut tree, Leaves::Whole, &mut cpu(), &Settings::default(), &mut go_on).unwrap();
        assert_eq!(topology(&tree), topology(&expected), "2^{exponent}");
    }
}

fn scaled(triangles: &[Triangle], by: f32) -> Vec<Triangle> {
    let scale = |p: [f32; 3]| p.map(|x| x * by);
    triangles.iter().map(|t| Triangle { a: scale(t.a), b: scale(t.b), c: scale(t.c) }).collect()
}

/// What does not scale by itself says that it does not.
#[test]
fn out_of_range_is_an_error_at_every_entry() {
    let triangles = soup(300, 0.1, 1);
    for by in [1e-24, 1e18] {
        let far = scaled(&triangles, by);
        let mut device = cpu();
        let names_the_range = |error: &dyn std::error::Error| {
            let text = error.to_string();
            assert!(text.contains("scene::SafeRange") && text.contains("2^-40"), "{text}");
        };
        let nodes = sah_sweep(&far);
        let tree = DeviceTree::upload(&mut device, &nodes).unwrap();
        for settings in [PrbvhSettings::default(), PrbvhSettings::published()] {
            let refused = prbvh(&mut device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap_err();
            names_the_range(&refused);
        }
        names_the_range(&measure(&mut device, &tree).unwrap_err());
        let refused = collapse(&mut device, &tree, &CollapseSettings::default()).unwrap_err();
        assert!(matches!(refused, CollapseError::Range(_)));
        let mut own = nodes.clone();
        let refused = rbvh(&mut own, &RbvhSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap_err();
        names_the_range(&refused);
        names_the_range(&lbvh(&mut device, &far, MortonBits::default()).unwrap_err());
        names_the_range(&ploc(&mut device, &far, MortonBits::default(), prbvh::build::DEFAULT_RADIUS).unwrap_err());
        tree.free(&mut device);
        assert_eq!(device.memory().bytes, 0);
        // Builders on the host split as they would in range, and leave the boxes.
        let links = |nodes: &[Node]| nodes.iter().map(|node| (node.up, node.down)).collect::<Vec<_>>();
        let working = SafeRange::of(&far).apply(&far);
        assert_eq!(links(&nodes), links(&sah_sweep(&working)));
        assert_eq!(links(&sah_binned(&far)), links(&sah_binned(&working)));
        // And what scales does.
        let scene = Scene::from_triangles("far", far).unwrap();
        let done = optimize(&scene, &mut device, &Settings::default(), &mut go_on).unwrap();
        assert!(done.quality.sah_cost < done.initial.sah_cost);
        assert!((done.outcome.best().cost / done.quality.sah_cost - 1.0).abs() < 1e-4);
    }
}

#[test]
fn working_coordinates_are_in_range_whatever_their_areas() {
    let flat = |x: f32| Aabb { min: [x, 0.0, 0.0], max: [x, 1e-18, 1e-18] };
    assert!(SafeRange::check(&flat(2f32.powi(54))).is_ok(), "as SafeRange makes them");
    assert!(SafeRange::check(&flat(1.0)).is_err(), "an area that vanishes beside nothing");
    assert!(SafeRange::check(&Aabb { min: [3.0; 3], max: [3.0; 3] }).is_ok(), "a point");
    assert!(SafeRange::check(&Aabb { min: [0.0; 3], max: [2f32.powi(55), 0.0, 0.0] }).is_err());
    assert!(SafeRange::check(&Aabb { min: [f32::NAN, 0.0, 0.0], max: [1.0; 3] }).is_err());
    assert!(SafeRange::check(&Aabb::EMPTY).is_err());
}

#[test]
fn broken_links_empty_trees_and_buffers_of_others_are_errors_on_every_device() {
    let triangles = soup(50, 0.2, 1);
    let mut broken = sah_sweep(&triangles);
    // Beyond the nodes: without the check a kernel would read there.
    broken[3].down = 1_000_000;
    let mut elsewhere = cpu();
    let foreign = DeviceTree::upload(&mut elsewhere, &sah_sweep(&triangles)).unwrap();
    with_devices(|devices| {
        for (name, device) in devices {
            let device = &mut **device;
            let tree = DeviceTree::upload(device, &broken).unwrap();
            for settings in [PrbvhSettings::default(), PrbvhSettings::published()] {
                let refused = prbvh(device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap_err();
                let OptimizeError::Tree(UnfitTree::Broken { faults }) = &refused else { panic!("{name}: {refused}") };
                let is_it =
                    |fault: &TreeFault| matches!(fault, TreeFault::LinkOutOfRange { node: 3, value: 1_000_000, .. });
                assert!(faults.iter().any(is_it), "{name}: {faults:?}");
                let refused = prbvh(device, &foreign, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap_err();
                assert!(refused.to_string().contains("buffer of this device"), "{name}: {refused}");
            }
            assert!(matches!(
                collapse(device, &tree, &CollapseSettings::default()),
                Err(CollapseError::InvalidTree { .. })
            ));
            assert!(measure(device, &tree).is_err());
            tree.free(device);
            assert!(matches!(DeviceTree::upload(device, &[]), Err(DeviceError::Buffer { label: "nodes", .. })));
            let none: &[Triangle] = &[];
            assert!(lbvh(device, none, MortonBits::default()).is_err());
        }
    });
    assert!(sah_sweep(&[]).is_empty() && sah_binned(&[]).is_empty());
    let refused = rbvh(&mut [], &RbvhSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap_err();
    assert!(refused.to_string().contains("0 nodes"), "{refused}");
}

#[test]
fn settings_that_make_no_sense_are_refused_at_every_entry() {
    let scene = built_in(200);
    let mut device = cpu();
    let mut nodes = sah_sweep(&SafeRange::of(&scene.triangles).apply(&scene.triangles));
    let tree = DeviceTree::upload(&mut device, &nodes).unwrap();
    let bad = PrbvhSettings::published().with(|s| s.mu = 0);
    let refused = prbvh(&mut device, &tree, &bad, &mut |_, _, _| ControlFlow::Continue(())).unwrap_err();
    assert_eq!(refused.to_string(), "mu is 0, but must be at least 1");
    let settings = Settings::default().with(|s| s.prbvh = bad);
    let refused = optimize(&scene, &mut device, &settings, &mut go_on).unwrap_err();
    assert!(matches!(&refused, PipelineError::Setting(error) if error.name == "mu"), "{refused}");
    let rbvh_settings = RbvhSettings::default().with(|s| s.batch = f64::NAN);
    let refused = rbvh(&mut nodes, &rbvh_settings, &mut |_, _| ControlFlow::Continue(())).unwrap_err();
    assert!(refused.to_string().starts_with("batch is NaN"), "{refused}");
    let settings = Settings::default().with(|s| s.optimizer = Optimizer::Rbvh(rbvh_settings));
    let refused = optimize(&scene, &mut device, &settings, &mut go_on).unwrap_err();
    assert!(refused.to_string().starts_with("batch is NaN"), "{refused}");
}

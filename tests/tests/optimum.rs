//! Every builder and optimiser against the best of all trees, and over many small triangles beside one that is far away.

use prbvh::build::MOST_AGGLOMERATED;
use prbvh::bvh::{Bvh, Content, MaxDepth, validate};
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::Limits;
use prbvh::pipeline::{Initial, Optimized, Optimizer, Settings, optimize};
use prbvh::scene::Scene;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::best_tree::least_area_by_subsets;
use prbvh_tests::fixtures::soup;
use prbvh_tests::oracle::half_area;
use std::ops::ControlFlow;

/// Builders over whole triangles.
const BUILDERS: [&str; 17] = [
    "lbvh",
    "ploc",
    "atrbvh",
    "trbvh",
    "hploc",
    "sah-sweep",
    "sah-binned",
    "agglomerative",
    "aac:fast",
    "aac:hq",
    "kmeans:k=2,p=5,i=5",
    "kmeans:q3",
    "insertion:greedy",
    "insertion",
    "online",
    "hunt",
    "phr:fast",
];

fn run(scene: &Scene, initial: &str, optimizer: &str, iterations: u32) -> Optimized {
    let mut settings = Settings::default().with(|s| {
        s.initial = Initial::of_name(initial).unwrap().unwrap();
        s.optimizer = Optimizer::of_name(optimizer).unwrap();
        s.max_depth = MaxDepth::OFF;
    });
    *settings.limits_mut() = Limits::iterations(iterations);
    let mut device = CpuDevice::new(2).unwrap();
    let done = optimize(scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    validate(&done.tree, Some(&scene.triangles)).unwrap_or_else(|faults| panic!("{initial}, {optimizer}: {faults:?}"));
    done
}

/// The half areas of the internal nodes.
fn internal_area(tree: &Bvh) -> f64 {
    let internal = tree.nodes.iter().filter(|node| matches!(node.content, Content::Internal { .. }));
    internal.map(|node| half_area(&node.aabb)).sum()
}

#[test]
fn every_builder_has_a_name() {
    for name in Initial::NAMES.split(", ").filter(|name| *name != "sbvh") {
        assert!(BUILDERS.iter().any(|builder| builder.split(':').next() == Some(name)), "{name}");
    }
}

#[test]
fn nothing_is_better_than_the_best_tree_over_up_to_twelve_boxes() {
    let mut scenes = Vec::new();
    for (n, seed) in [(9, 1), (9, 2), (10, 3), (10, 4), (11, 5), (12, 6), (12, 7)] {
        let triangles = soup(n, 0.4, seed);
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        scenes.push((Scene::from_triangles("few", triangles).unwrap(), least_area_by_subsets(&boxes)));
    }
    // What is far above: others are within a few per cent on average.
    let most = |name: &str| match name {
        "lbvh" | "insertion:greedy" => 1.3,
        "kmeans:k=2,p=5,i=5" | "kmeans:q3" => 1.25,
        _ => 1.12,
    };
    for optimizer in ["none", "prbvh", "rbvh", "rotations"] {
        for name in BUILDERS {
            let mut sum = 0.0;
            for (scene, least) in &scenes {
                let ratio = internal_area(&run(scene, name, optimizer, 100).tree) / least;
                assert!(ratio > 1.0 - 1e-6, "{name}, {optimizer}: {ratio} of the best of {}", scene.triangles.len());
                sum += ratio;
            }
            let mean = sum / scenes.len() as f64;
            let most = match optimizer {
                "none" => most(name),
                "rotations" => 1.12,
                _ => 1.03,
            };
            assert!(mean < most, "{name}, {optimizer}: {mean} of the best on average");
        }
    }
}

/// So many triangles in a ten-millionth of the scene, and one on its other side.
fn dense_beside_far(count: usize) -> Scene {
    let mut triangles = soup(count - 1, 0.01, 12);
    let far = 1e7;
    triangles.push(Triangle { a: [far; 3], b: [far + 100.0, far, far], c: [far, far + 100.0, far] });
    Scene::from_triangles("dense beside far", triangles).unwrap()
}

#[test]
fn many_triangles_beside_a_far_one_have_trees_of_bounded_depth() {
    let all = dense_beside_far(200_001);
    // These insert one by one, on one thread.
    let few = dense_beside_far(8001);
    for name in BUILDERS {
        let is_slow = name == "agglomerative" || name.starts_with("insertion") || name == "online";
        let scene = if is_slow { &few } else { &all };
        assert!(scene.triangles.len() <= MOST_AGGLOMERATED || name != "agglomerative");
        let done = run(scene, name, "prbvh", 2);
        assert!(done.initial.max_depth <= 120, "{name}: {} levels", done.initial.max_depth);
        assert!(done.quality.sah_cost <= done.initial.sah_cost, "{name}");
    }
}

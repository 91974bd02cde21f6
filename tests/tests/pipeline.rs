//! The whole way from triangles to the best tree: the same on every device after every iteration.

use prbvh::build::{MortonBits, lbvh};
use prbvh::bvh::{Bvh, quality, tree_hash, validate};
use prbvh::device::Device;
use prbvh::optimize::{Epsilon, IterationRow, Limits, Order, PrbvhSettings, StopReason, Strategy, WorstFirst, prbvh};
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene::{SafeRange, Scene, built_in};
use prbvh_kernel::setup::Triangle;
use prbvh_tests::devices::devices;
use prbvh_tests::fixtures::{grid, soup};
use std::ops::ControlFlow;

/// What is wrong with the claim of the conservative strategy: the cost never rises, and falls by what was predicted.
///
/// A decrease is a sum of areas in f32, each with a few roundings of 2^-24 of itself. No area is part of two decreases, so the areas of
/// both trees bound them all together: a few millionths of the cost at worst. Roundings mostly cancel: 1e-8 was seen.
fn prediction_fault(before: f64, after: f64, predicted: f64) -> Option<String> {
    let falls = before - after;
    let as_predicted = (falls - predicted).abs() <= 1e-6 * before;
    (falls < 0.0 || !as_predicted).then(|| format!("{before} falls by {falls}, not by {predicted}"))
}

/// Each round by itself.
fn by_rows(settings: &PrbvhSettings) -> PrbvhSettings {
    settings.clone().with(|s| s.news = std::time::Duration::ZERO)
}

/// Row and tree hash after each iteration, and the tree that is kept.
fn trace(device: &mut dyn Device, scene: &Scene, bits: MortonBits, settings: &PrbvhSettings) -> Vec<String> {
    let triangles = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let (tree, _) = lbvh(device, &triangles, bits).unwrap();
    let mut steps = Vec::new();
    let mut costs = Vec::new();
    // Else the observer finds the tree of a later row.
    let settings = &by_rows(settings);
    let outcome = prbvh(device, &tree, settings, &mut |row: &IterationRow, tree, device| {
        let nodes = tree.download(device).unwrap();
        let tree = Bvh::from_device(&nodes).unwrap_or_else(|faults| panic!("{faults:?}"));
        validate(&tree, Some(&triangles)).unwrap_or_else(|faults| panic!("{faults:?}"));
        let IterationRow { iteration, mu, cost, predicted_decrease, searched, visits, .. } = *row;
        let IterationRow { found, owned, applied, most_steps, .. } = *row;
        assert!(applied <= owned && owned <= found && found <= searched);
        // A new top is no reinsertion.
        assert!(searched == 0 || (predicted_decrease > 0.0) == (applied > 0), "{row:?}");
        let measured = quality(&tree, &Default::default()).sah_cost;
        assert!((cost / measured - 1.0).abs() < 1e-5, "device says {cost}, f64 says {measured}");
        let adds_up = (settings.order, settings.strategy) == (Order::Published, Strategy::Conservative);
        if let (true, Some(before)) = (adds_up, costs.last())
            && let Some(fault) = prediction_fault(*before, measured, predicted_decrease)
        {
            panic!("{} at iteration {iteration}: {fault}", scene.name);
        }
        costs.push(measured);
        let hash = tree_hash(&tree);
        let floats = [cost, predicted_decrease].map(f64::to_bits);
        steps.push(format!(
            "{iteration} {mu} {floats:x?} {searched} {visits} {found} {owned} {applied} {most_steps} {hash}"
        ));
        ControlFlow::Continue(())
    })
    .unwrap();
    let kept = Bvh::from_device(&tree.download(device).unwrap()).unwrap();
    let kept_cost = quality(&kept, &Default::default()).sah_cost;
    let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(kept_cost <= costs[0] && (kept_cost / best - 1.0).abs() < 1e-6, "kept {kept_cost}, best {best}");
    steps.push(format!("{:?} {}", outcome.stop, tree_hash(&kept)));
    tree.free(device);
    assert_eq!(device.memory().bytes, 0, "all buffers are given back");
    steps
}

fn same_everywhere(scene: &Scene, bits: MortonBits, settings: &PrbvhSettings) -> Vec<String> {
    let mut first: Option<(String, Vec<String>)> = None;
    for (name, mut device) in devices() {
        let steps = trace(&mut *device, scene, bits, settings);
        match &first {
            None => first = Some((name, steps)),
            Some((first_name, expected)) => {
                for (expected, step) in expected.iter().zip(&steps) {
                    assert_eq!(expected, step, "{}: {first_name} and {name}", scene.name);
                }
                assert_eq!(expected.len(), steps.len());
            }
        }
    }
    first.expect("there is always the CPU").1
}

#[test]
fn the_built_in_scene_is_the_same_everywhere_after_every_iteration() {
    for settings in [PrbvhSettings::default(), PrbvhSettings::published()] {
        let steps = same_everywhere(&built_in(6000), MortonBits::Sixty, &settings);
        assert!(steps.len() > 10, "{}: {} steps", settings.order, steps.len());
    }
}

#[test]
fn other_settings_are_the_same_everywhere() {
    let scene = Scene::from_triangles("soup", soup(1500, 0.2, 1)).unwrap();
    for mu in [1, 4, 5000] {
        let settings = PrbvhSettings::published().with(|s| {
            s.mu = mu;
            s.limits = Limits::iterations(12);
        });
        same_everywhere(&scene, MortonBits::Thirty, &settings);
    }
    let usual = WorstFirst::default();
    for worst_first in [
        usual.with(|s| {
            s.first = 1;
            s.growth = 1.0;
            s.tail_part = 0.0;
        }),
        usual.with(|s| {
            s.first = 5000;
            s.lock_rounds = 1;
        }),
        usual.with(|s| {
            s.most_part = 1.0;
            s.growth = 4.0;
            s.lock_rounds = 5;
            s.climb = 0;
            s.slack = 1.0;
            s.tail_part = 1.0;
        }),
    ] {
        let settings = PrbvhSettings::default().with(|s| {
            s.worst_first = worst_first;
            s.limits = Limits::iterations(30);
        });
        same_everywhere(&scene, MortonBits::Thirty, &settings);
    }
}

#[test]
fn tiny_scenes_are_the_same_everywhere() {
    for n in [1, 2, 3, 4, 5] {
        let scene = Scene::from_triangles("tiny", soup(n, 0.2, n as u64)).unwrap();
        for strategy in [Strategy::Aggressive, Strategy::Conservative] {
            same_everywhere(&scene, MortonBits::Sixty, &PrbvhSettings::published().with(|s| s.strategy = strategy));
        }
        same_everywhere(&scene, MortonBits::Sixty, &PrbvhSettings::default());
    }
}

#[test]
fn the_conservative_strategy_falls_as_predicted_and_is_the_same_everywhere() {
    let conservative = PrbvhSettings::published().with(|s| s.strategy = Strategy::Conservative);
    let steps = same_everywhere(&built_in(6000), MortonBits::Sixty, &conservative);
    assert!(steps.len() > 10 && steps[steps.len() - 1].starts_with("Converged"), "{:?}", steps.last());
    let scenes = [
        ("soup", soup(2000, 0.2, 8)),
        ("grid", grid(30)),
        ("twice", soup(600, 0.1, 9).repeat(2)),
        ("one place", soup(1, 0.1, 9).repeat(50)),
    ];
    for (name, triangles) in scenes {
        let scene = Scene::from_triangles(name, triangles).unwrap();
        for mu in [1, 9] {
            let settings = conservative.clone().with(|s| {
                s.mu = mu;
                s.limits = Limits::iterations(40);
            });
            same_everywhere(&scene, MortonBits::Sixty, &settings);
        }
    }
}

#[test]
fn worst_first_ends_below_the_published_order_and_is_the_same_everywhere() {
    let scene = built_in(6000);
    let cost = |settings: &Settings| run(&scene, settings, u32::MAX).quality.sah_cost;
    let (published, worst_first) = (cost(&published()), cost(&Settings::default()));
    assert!(worst_first < published, "{worst_first} against {published}");
    let scenes = [
        ("soup", soup(2000, 0.2, 8)),
        ("grid", grid(30)),
        ("twice", soup(600, 0.1, 9).repeat(2)),
        ("one place", soup(1, 0.1, 9).repeat(50)),
        ("two", soup(2, 0.1, 9)),
    ];
    for (name, triangles) in scenes {
        let scene = Scene::from_triangles(name, triangles).unwrap();
        same_everywhere(&scene, MortonBits::Sixty, &PrbvhSettings::default());
    }
}

/// The first rounds of a run are several to a submission, unless somebody wants the tree of each.
#[test]
fn rounds_that_run_together_are_those_that_run_one_by_one() {
    let scene = built_in(6000);
    for limit in [1, 3, 8, 1000] {
        let together = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(limit));
        let [together, one_by_one] = [together.clone(), by_rows(&together)].map(|prbvh| {
            let result = run(&scene, &Settings::default().with(|s| s.prbvh = prbvh), u32::MAX);
            let timeless = |row: &IterationRow| {
                (*row).with(|row| {
                    row.time_s = 0.0;
                    row.device_s = 0.0;
                })
            };
            let rows: Vec<_> = result.outcome.rows.iter().map(timeless).collect();
            (rows, tree_hash(&result.tree))
        });
        assert_eq!(together, one_by_one, "{limit} rounds at most");
    }
}

#[test]
fn the_aggressive_strategy_does_not_fall_as_predicted() {
    let result = run(&built_in(6000), &published(), u32::MAX);
    let faults = result
        .outcome
        .rows
        .windows(2)
        .filter_map(|rows| prediction_fault(rows[0].cost, rows[1].cost, rows[1].predicted_decrease));
    assert!(faults.count() > 5);
}

fn published() -> Settings {
    Settings::default().with(|s| s.prbvh = PrbvhSettings::published())
}

fn run(scene: &Scene, settings: &Settings, stop_at: u32) -> prbvh::pipeline::Optimized {
    let (_, mut device) = devices().remove(0);
    optimize(scene, &mut *device, settings, &mut |row| {
        if row.iteration >= stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap()
}

#[test]
fn the_cost_falls_well_below_the_initial_one() {
    let result = run(&built_in(20_000), &Settings::default(), u32::MAX);
    assert_eq!(result.outcome.stop, StopReason::Converged);
    assert!(result.quality.sah_cost < 0.8 * result.initial.sah_cost, "{:?} {:?}", result.initial, result.quality);
}

#[test]
fn a_cancelled_run_keeps_the_best_tree_so_far() {
    let scene = built_in(5000);
    let result = run(&scene, &Settings::default(), 3);
    assert_eq!(result.outcome.stop, StopReason::Cancelled);
    // Sixteen rounds are submitted at a time, or fewer.
    assert!((4..=17).contains(&result.outcome.rows.len()), "{}", result.outcome.rows.len());
    assert!(result.quality.sah_cost < result.initial.sah_cost);
    let nothing = run(&scene, &Settings::default(), 0);
    assert_eq!(nothing.quality, nothing.initial);
}

#[test]
fn limits_end_a_run() {
    let scene = built_in(5000);
    let mut settings = Settings::default();
    settings.prbvh.limits.max_iterations = 2;
    let result = run(&scene, &settings, u32::MAX);
    assert_eq!((result.outcome.stop, result.outcome.rows.len()), (StopReason::MaxIterations, 3));
    settings.prbvh.limits.max_time = Some(std::time::Duration::ZERO);
    let result = run(&scene, &settings, u32::MAX);
    assert_eq!((result.outcome.stop, result.outcome.rows.len()), (StopReason::MaxTime, 1));
    assert_eq!(result.quality, result.initial);
}

#[test]
fn an_epsilon_of_zero_ends() {
    let scene = Scene::from_triangles("soup", soup(300, 0.2, 3)).unwrap();
    let mut settings = published();
    settings.prbvh.epsilon = Epsilon::Absolute(0.0);
    assert_eq!(run(&scene, &settings, u32::MAX).outcome.stop, StopReason::Converged);
}

#[test]
fn powers_of_two_change_no_topology() {
    let triangles = soup(800, 0.1, 4);
    let result = run(&Scene::from_triangles("soup", triangles.clone()).unwrap(), &Settings::default(), u32::MAX);
    for exponent in [-60, -7, 1, 60] {
        let scale = |p: [f32; 3]| p.map(|x| x * 2f32.powi(exponent));
        let scaled = triangles.iter().map(|t| Triangle { a: scale(t.a), b: scale(t.b), c: scale(t.c) });
        let scaled = run(&Scene::from_triangles("scaled", scaled.collect()).unwrap(), &Settings::default(), u32::MAX);
        assert_eq!(scaled.outcome.rows.len(), result.outcome.rows.len());
        let topology = |tree: &Bvh| tree.nodes.iter().map(|node| (node.parent, node.content)).collect::<Vec<_>>();
        assert!(topology(&scaled.tree) == topology(&result.tree), "2^{exponent}");
        assert!((scaled.quality.sah_cost / result.quality.sah_cost - 1.0).abs() < 1e-6);
    }
}

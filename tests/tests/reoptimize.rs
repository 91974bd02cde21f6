//! A tree that follows a scene in motion, on every device.

use prbvh::build::{DeviceTree, sah_sweep};
use prbvh::bvh::{Bvh, SahModel, quality, tree_hash, validate, validate_references};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Device};
use prbvh::optimize::{Budget, ReoptimizeError, Reoptimizer, WorstFirst};
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene::{Aabb, Scene, Triangle, built_in};
use prbvh_tests::bench::frames;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::soup;
use proptest::prelude::*;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

fn built(scene: &Scene, device: &mut dyn Device) -> Bvh {
    optimize(scene, device, &Settings::default(), &mut |_| ControlFlow::Continue(())).unwrap().tree
}

fn cost(tree: &Bvh) -> f64 {
    quality(tree, &SahModel::default()).sah_cost
}

fn cpu() -> CpuDevice {
    CpuDevice::new(2).unwrap()
}

/// Costs after each frame, of a budget that is the same everywhere.
fn follow(scene: &Scene, tree: &Bvh, frames: &[Vec<Triangle>], device: &mut dyn Device, visits: u32) -> Vec<f64> {
    let before = device.memory().bytes;
    let mut costs = Vec::new();
    {
        let mut moving = Reoptimizer::new(&mut *device, tree, &scene.triangles).unwrap();
        let memory = moving.device().memory();
        for frame in frames {
            moving.refit(frame).unwrap();
            let step = moving.step(Budget::Visits(visits)).unwrap();
            assert!(step.visits < 3 * u64::from(visits), "{step:?}");
            let tree = moving.tree().unwrap();
            validate(&tree, Some(frame)).unwrap();
            let said = moving.cost().unwrap();
            assert!((said / cost(&tree) - 1.0).abs() < 1e-5, "{said} is not {}", cost(&tree));
            costs.push(said);
        }
        assert_eq!(moving.device().memory(), memory, "a frame allocates nothing");
    }
    assert_eq!(device.memory().bytes, before, "the buffers go back");
    costs
}

#[test]
fn a_tree_follows_its_scene_and_stays_good_on_every_device() {
    let scene = built_in(3000);
    let tree = built(&scene, &mut cpu());
    let frames: Vec<Vec<Triangle>> = (1..=12).map(|k| frames::at(&scene, k as f32 / 12.0)).collect();
    let last = &frames[frames.len() - 1];
    let rebuilt = cost(&built(&Scene::from_triangles("last", last.clone()).unwrap(), &mut cpu()));
    let refitted = cost(&tree.clone().with_boxes_of(last));
    assert!(refitted > 1.1 * rebuilt, "{refitted} is hardly more than {rebuilt}: the frames show nothing");
    let mut first = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let costs = follow(&scene, &tree, &frames, &mut **device, 30_000);
            let end = costs[costs.len() - 1];
            assert!(end < 1.06 * rebuilt, "{name}: {end}, rebuilt {rebuilt}, refitted {refitted}");
            // Nothing depends on the device, so neither does what a search takes.
            assert_eq!(*first.get_or_insert_with(|| costs.clone()), costs, "{name}");
        }
    });
}

#[test]
fn refits_rotate_unless_told_otherwise() {
    let scene = built_in(3000);
    let tree = built(&scene, &mut cpu());
    let frames: Vec<Vec<Triangle>> = (1..=6).map(|k| frames::at(&scene, k as f32 / 6.0)).collect();
    let last = &frames[frames.len() - 1];
    let followed = |rotates: bool| {
        let mut device = cpu();
        let mut moving = Reoptimizer::new(&mut device, &tree, &scene.triangles).unwrap();
        moving.set_rotations(rotates);
        frames.iter().for_each(|frame| moving.refit(frame).unwrap());
        moving.tree().unwrap()
    };
    let (plain, rotated) = (followed(false), followed(true));
    validate(&rotated, Some(last)).unwrap();
    assert_eq!(tree_hash(&plain), tree_hash(&tree.clone().with_boxes_of(last)), "no link changes");
    assert!(cost(&rotated) < 0.97 * cost(&plain), "{} is hardly less than {}", cost(&rotated), cost(&plain));
}

#[test]
fn steps_go_on_where_the_last_one_stopped() {
    let scene = built_in(4000);
    let settings = Settings::default().with(|s| s.optimizer = prbvh::pipeline::Optimizer::None);
    let start = optimize(&scene, &mut cpu(), &settings, &mut |_| ControlFlow::Continue(())).unwrap().tree;
    let mut device = cpu();
    let mut moving = Reoptimizer::new(&mut device, &start, &scene.triangles).unwrap();
    let before = moving.cost().unwrap();
    let mut applied = 0;
    for _ in 0..100 {
        applied += moving.step(Budget::Visits(10_000)).unwrap().applied;
    }
    let small = moving.cost().unwrap();
    assert!(small < 0.75 * before, "{small} of {before}: small steps come down");
    assert!(applied > 300, "{applied} moves");
    // A tree that is good already has little left to move, and steps end.
    let end = (0..400).find(|_| moving.step(Budget::Visits(100_000)).unwrap().applied == 0);
    assert!(end.is_some());
    validate(&moving.tree().unwrap(), Some(&scene.triangles)).unwrap();
}

#[test]
fn a_budget_of_time_is_kept_about() {
    let scene = built_in(20_000);
    let mut device = cpu();
    let tree = Bvh::from_device(&sah_sweep(&scene.triangles)).unwrap();
    let mut moving = Reoptimizer::new(&mut device, &tree, &scene.triangles).unwrap();
    moving.step(Budget::Visits(20_000)).unwrap();
    let begin = Instant::now();
    let step = moving.step(Budget::Time(Duration::from_millis(30))).unwrap();
    assert!(step.searched > 0);
    // Others run beside the tests.
    assert!(begin.elapsed() < Duration::from_secs(3), "{:?}", begin.elapsed());
    assert_eq!(moving.step(Budget::Time(Duration::ZERO)).unwrap().visits, 0);
    assert_eq!(moving.step(Budget::Visits(0)).unwrap().visits, 0);
}

#[test]
fn it_owns_a_device_or_borrows_one() {
    let scene = built_in(300);
    let tree = built(&scene, &mut cpu());
    let owned: Box<dyn Device> = Box::new(cpu());
    let mut owner = Reoptimizer::new(owned, &tree, &scene.boxes()).unwrap();
    owner.step(Budget::Visits(1000)).unwrap();
    let references = owner.primitives();
    let handle = owner.device_tree().nodes.clone();
    // The tree in its buffer, for whoever goes on with it there.
    let shared = DeviceTree::new(references, handle);
    shared.check(owner.device()).unwrap();
    let mut device: Box<dyn Device> = Box::new(device::Stoppable::new(Box::new(cpu()), &prbvh::stop::Stop::default()));
    let mut borrower = Reoptimizer::new(&mut *device, &tree, &scene.triangles).unwrap();
    borrower.step(Budget::Visits(1000)).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn what_comes_and_goes_is_followed(n in 1usize..60, more in 0usize..40, seed: u64, out in prop::collection::vec(any::<bool>(), 100)) {
        let mut boxes: Vec<Aabb> = soup(n + more, 0.3, seed).iter().map(Triangle::aabb).collect();
        let scene = Scene::from_boxes("boxes", &boxes[..n]).unwrap();
        let mut device = cpu();
        let tree = built(&scene, &mut device);
        let bytes = device.memory().bytes;
        {
            let mut moving = Reoptimizer::new(&mut device, &tree, &boxes[..n]).unwrap();
            prop_assert_eq!(moving.insert(&boxes[n..]).unwrap(), n as u32..(n + more) as u32);
            moving.step(Budget::Visits(2000)).unwrap();
            prop_assert!(validate_references(&moving.tree().unwrap(), &boxes).is_ok());
            let gone: Vec<u32> = (1..boxes.len() as u32).filter(|&k| out[k as usize]).rev().collect();
            moving.remove(&gone).unwrap();
            let mut k = 0;
            boxes.retain(|_| { k += 1; k == 1 || !out[k - 1] });
            moving.step(Budget::Visits(2000)).unwrap();
            let tree = moving.tree().unwrap();
            prop_assert!(validate_references(&tree, &boxes).is_ok());
            prop_assert_eq!(tree.triangle_order.len(), boxes.len());
            for aabb in &mut boxes {
                aabb.max = aabb.max.map(|x| x + 0.5);
            }
            moving.refit(&boxes).unwrap();
            prop_assert!(validate_references(&moving.tree().unwrap(), &boxes).is_ok());
        }
        prop_assert_eq!(device.memory().bytes, bytes);
    }
}

#[test]
fn what_cannot_be_followed_is_refused_by_name() {
    let scene = built_in(100);
    let tree = built(&scene, &mut cpu());
    let mut device = cpu();
    let text = |result: Result<(), ReoptimizeError>| result.unwrap_err().to_string();
    let mut broken = tree.clone();
    broken.nodes[5].parent = 5;
    assert!(text(Reoptimizer::new(&mut device, &broken, &scene.triangles).map(drop)).starts_with("the tree is broken"));
    let mut twice = tree.clone();
    twice.triangle_order[0] = twice.triangle_order[1];
    assert!(text(Reoptimizer::new(&mut device, &twice, &scene.triangles).map(drop)).contains("triangle"));
    let fewer = &scene.triangles[1..];
    assert!(Reoptimizer::new(&mut device, &tree, fewer).is_err());
    let tiny: Vec<Triangle> = scene
        .triangles
        .iter()
        .map(|t| Triangle { a: t.a.map(|x| x * 1e-30), b: t.b.map(|x| x * 1e-30), c: t.c.map(|x| x * 1e-30) })
        .collect();
    assert!(text(Reoptimizer::new(&mut device, &tree, &tiny).map(drop)).contains("scene::SafeRange"));
    assert_eq!(device.memory().bytes, 0);

    let mut moving = Reoptimizer::new(&mut device, &tree, &scene.triangles).unwrap();
    let before = moving.tree().unwrap();
    assert_eq!(text(moving.refit(fewer)), "99 primitives, but the tree is over 100");
    let mut bad = scene.triangles.clone();
    bad[42].b[1] = f32::NAN;
    assert_eq!(text(moving.refit(&bad)), "frame, triangle 42: coordinate NaN is not a finite float32");
    let mut inverted = scene.boxes();
    inverted[7].min[2] = inverted[7].max[2] + 1.0;
    assert!(text(moving.refit(&inverted)).starts_with("frame, box 7: the box from"));
    assert!(text(moving.insert(&bad).map(drop)).contains("triangle 42"));
    assert!(text(moving.remove(&[3, 100])).starts_with("primitive 100 cannot be removed: the tree is over 100"));
    let all: Vec<u32> = (0..100).collect();
    assert!(text(moving.remove(&all)).contains("of which one stays"));
    assert_eq!(
        text(moving.set(WorstFirst::default().with(|s| s.lock_rounds = 0))),
        "worst_first.lock_rounds is 0, but must be from 1 to 1000"
    );
    assert_eq!(moving.tree().unwrap(), before, "all of this left the tree as it was");
    assert!(text(moving.refit(&tiny)).contains("scene::SafeRange"));
    moving.refit(&scene.triangles).unwrap();
    moving.remove(&[]).unwrap();
    let none: &[Aabb] = &[];
    assert_eq!(moving.insert(none).unwrap(), 100..100);
}

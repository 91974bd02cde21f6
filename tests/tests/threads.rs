//! Threads are those that the caller gave, and no others are started.
#![cfg(target_os = "linux")]

use prbvh::build::Bins;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{Budget, Reoptimizer};
use prbvh::pipeline::{Initial, Leaves, Settings, optimize, optimize_tree};
use prbvh::scene::{self, Scene};
use prbvh::trace::TraceScene;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// Threads of this process.
fn threads() -> usize {
    std::fs::read_dir(Path::new("/proc/self/task")).unwrap().count()
}

/// The only test of this program: a test beside it would have threads, too.
#[test]
fn a_pool_that_is_given_is_all_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.obj");
    let corners: String = (0..9000).map(|k| format!("v {} {} {}\n", k % 17, k % 29, k % 31)).collect();
    let faces: String = (0..3000).map(|k| format!("f {} {} {}\n", 3 * k + 1, 3 * k + 2, 3 * k + 3)).collect();
    std::fs::write(&path, corners + &faces).unwrap();

    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap());
    pool.install(|| ());
    let before = threads();
    let scene = pool.install(|| scene::load(&path)).unwrap();
    let scene = pool.install(|| Scene::from_triangles("again", scene.triangles)).unwrap();
    let boxes = pool.install(|| scene.boxes());
    // From here on outside of the pool: the device has it.
    let mut device = CpuDevice::in_pool(Arc::clone(&pool));
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    for initial in [Initial::Lbvh, Initial::SahSweep, Initial::SahBinned { bins: Bins::DEFAULT }] {
        let settings = Settings::default().with(|s| {
            s.initial = initial;
            s.fold_duplicates = true;
        });
        optimize(&scene, &mut device, &settings, go_on).unwrap();
    }
    let mut tree = optimize(&scene, &mut device, &Settings::default(), go_on).unwrap().tree;
    optimize_tree(&mut tree, Leaves::Split(&boxes), &mut device, &Settings::default(), go_on).unwrap();
    {
        let mut moving = Reoptimizer::new(&mut device, &tree, &scene.triangles).unwrap();
        moving.refit(&scene.triangles).unwrap();
        moving.step(Budget::Visits(10_000)).unwrap();
    }
    TraceScene::new(&mut device, &tree, &scene.triangles, &[[0.0; 3], [1.0; 3]]).unwrap().free(&mut device);
    assert_eq!(threads(), before, "nothing was started");

    // What the count would show: work outside of any pool starts rayon's own.
    let _ = scene.boxes();
    assert!(threads() > before);
}

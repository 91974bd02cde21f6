//! RBVH on whole trees: valid after every batch, honest about its cost, never worse than what it got, and it always ends.

use prbvh::build::{Bins, UnfitTree, sah_binned};
use prbvh::bvh::{Bvh, SahModel, TreeFault, quality, tree_hash, validate};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Device};
use prbvh::optimize::{IterationRow, Limits, OptimizeError, Outcome, RbvhSettings, StopReason, rbvh};
use prbvh::pipeline::{Initial, Optimizer, Settings, optimize};
use prbvh::scene::{SafeRange, Scene, built_in};
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::fixtures::soup;
use proptest::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU32, Ordering};

fn cost(nodes: &[Node]) -> f64 {
    quality(&Bvh::from_device(nodes).unwrap(), &SahModel::default()).sah_cost
}

/// Runs RBVH and checks the tree and the row after every batch, and what is kept in the end.
fn checked(nodes: &mut [Node], triangles: &[Triangle], settings: &RbvhSettings) -> Outcome {
    let mut costs = Vec::new();
    let outcome = rbvh(nodes, settings, &mut |row, tree| {
        let bvh = Bvh::from_device(&tree.nodes()).unwrap_or_else(|faults| panic!("{faults:?}"));
        validate(&bvh, Some(triangles)).unwrap_or_else(|faults| panic!("{faults:?}"));
        let measured = quality(&bvh, &SahModel::default()).sah_cost;
        assert!((row.cost - measured).abs() <= 1e-11 * measured, "says {}, is {measured}", row.cost);
        assert!(row.applied <= row.owned && row.owned <= row.found);
        assert_eq!((row.iteration as usize, row.mu), (costs.len(), 0));
        costs.push(row.cost);
        ControlFlow::Continue(())
    })
    .unwrap();
    let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((cost(nodes) - best).abs() <= 1e-11 * best, "kept {}, best {best}", cost(nodes));
    assert!(best <= costs[0]);
    validate(&Bvh::from_device(nodes).unwrap(), Some(triangles)).unwrap();
    outcome
}

fn working(triangles: &[Triangle]) -> Vec<Triangle> {
    SafeRange::of(triangles).apply(triangles)
}

/// A bad tree: triangle `k` is the left child at depth `k + 1`.
fn chain(triangles: &[Triangle]) -> Vec<Node> {
    let one = |k: usize| sah_binned(&triangles[k..=k])[0];
    let n = triangles.len();
    let mut nodes: Vec<Node> = vec![one(0); 2 * n - 1];
    for k in 0..n {
        nodes[n - 1 + k] = Node { down: k as u32, ..one(k) };
    }
    for p in (0..n - 1).rev() {
        let right = if p + 2 < n { p + 1 } else { n - 1 + p + 1 };
        let left = n - 1 + p;
        let aabb = nodes[left].aabb().union(nodes[right].aabb());
        nodes[left].up = right as u32;
        nodes[right].up = p as u32 | prbvh_kernel::node::RIGHT;
        nodes[p] = Node { min: aabb.min, up: u32::MAX, max: aabb.max, down: left as u32 };
    }
    nodes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn every_batch_leaves_a_tree_with_the_cost_that_it_says(n in 1usize..200, seed: u64, undo: bool, size in 0.01f32..1.0) {
        let triangles = working(&soup(n, size, seed));
        let settings = RbvhSettings::default().with(|s| { s.undo = undo; s.seed = seed; s.limits = Limits::iterations(60); });
        let mut nodes = chain(&triangles);
        let before = cost(&nodes);
        checked(&mut nodes, &triangles, &settings);
        prop_assert!(n < 20 || cost(&nodes) < before);
    }
}

#[test]
fn degenerate_scenes_end() {
    let one = soup(1, 0.3, 1)[0];
    let point = Triangle { a: [1.0; 3], b: [1.0; 3], c: [1.0; 3] };
    let segment =
        |k: usize| Triangle { a: [k as f32, 0.0, 0.0], b: [k as f32 + 2.0, 0.0, 0.0], c: [k as f32, 0.0, 0.0] };
    let flat: Vec<Triangle> = soup(150, 0.2, 2)
        .into_iter()
        .map(|t| Triangle { a: [t.a[0], 0.0, t.a[2]], b: [t.b[0], 0.0, t.b[2]], c: [t.c[0], 0.0, t.c[2]] })
        .collect();
    let scales: Vec<Triangle> = (0..150)
        .map(|k| {
            let scale = |p: [f32; 3]| p.map(|x| x * 10f32.powi(k % 9 - 4));
            let t = soup(1, 1.0, k as u64)[0];
            Triangle { a: scale(t.a), b: scale(t.b), c: scale(t.c) }
        })
        .collect();
    let scenes = [vec![one; 100], vec![point; 100], (0..100).map(segment).collect(), flat, scales];
    for triangles in scenes.iter().chain(&[1, 2, 3, 4, 5].map(|n| soup(n, 0.3, 7))) {
        let triangles = working(triangles);
        for undo in [true, false] {
            let settings = RbvhSettings::default().with(|s| {
                s.undo = undo;
                s.epsilon = 0.0;
                s.limits = Limits::iterations(3000);
            });
            let outcome = checked(&mut chain(&triangles), &triangles, &settings);
            assert!(outcome.stop == StopReason::Converged || !undo, "{:?}", outcome.stop);
        }
    }
}

#[test]
fn the_seed_alone_decides() {
    let triangles = working(&built_in(3000).triangles);
    let start = sah_binned(&triangles);
    let run = |seed| {
        let mut nodes = start.clone();
        let outcome =
            rbvh(&mut nodes, &RbvhSettings::default().with(|s| s.seed = seed), &mut |_, _| ControlFlow::Continue(()));
        assert_eq!(outcome.unwrap().stop, StopReason::Converged);
        nodes
    };
    assert!(run(1) == run(1));
    assert!(run(1) != run(2), "nothing was picked at random");
    assert!(cost(&run(1)) < cost(&start));
}

#[test]
fn a_cancelled_run_keeps_the_best_tree_so_far() {
    let triangles = working(&built_in(2000).triangles);
    let start = chain(&triangles);
    let run = |undo, stop_at| {
        let mut nodes = start.clone();
        let mut best = f64::INFINITY;
        let settings = RbvhSettings::default().with(|s| s.undo = undo);
        let outcome = rbvh(&mut nodes, &settings, &mut |row, _| {
            best = best.min(row.cost);
            if row.iteration >= stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let outcome = outcome.unwrap();
        assert_eq!((outcome.stop, outcome.rows.len() as u32), (StopReason::Cancelled, stop_at + 1));
        assert!((cost(&nodes) / best - 1.0).abs() < 1e-11);
        nodes
    };
    assert!(run(true, 0) == start);
    assert!(cost(&run(true, 3)) < cost(&start) && cost(&run(false, 3)) < cost(&start));
}

#[test]
fn what_is_no_tree_is_refused() {
    let mut nodes = sah_binned(&soup(8, 0.2, 1));
    nodes[0].down = 99;
    let refused = rbvh(&mut nodes, &RbvhSettings::default(), &mut |_, _| ControlFlow::Continue(())).unwrap_err();
    let OptimizeError::Tree(UnfitTree::Broken { faults }) = &refused else { panic!("{refused}") };
    assert!(matches!(faults[0], TreeFault::LinkOutOfRange { node: 0, value: 99, .. }), "{faults:?}");
}

#[test]
fn the_pipeline_runs_any_optimizer_and_says_the_true_cost() {
    let scene = built_in(4000);
    let run = |optimizer| {
        let mut device = CpuDevice::new(2).unwrap();
        let mut rows = Vec::<IterationRow>::new();
        let settings = Settings::default().with(|s| s.optimizer = optimizer);
        let result = optimize(&scene, &mut device, &settings, &mut |row| {
            rows.push(*row);
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(device.memory().bytes, 0);
        let best = result.outcome.best().cost;
        assert!((best / result.quality.sah_cost - 1.0).abs() < 1e-5, "{best} {:?}", result.quality);
        assert_eq!(rows.len(), result.outcome.rows.len());
        result
    };
    let none = run(Optimizer::None);
    assert_eq!((none.quality, none.outcome.stop), (none.initial, StopReason::NoOptimizer));
    let rbvh = run(Optimizer::Rbvh(RbvhSettings::default()));
    assert_eq!((rbvh.initial, rbvh.outcome.stop), (none.initial, StopReason::Converged));
    let prbvh = run(Optimizer::Prbvh);
    let ratio = prbvh.quality.sah_cost / rbvh.quality.sah_cost;
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
    assert_ne!(tree_hash(&rbvh.tree), tree_hash(&none.tree));
}

/// A CPU device that counts what the host does through it.
struct Counting(CpuDevice, AtomicU32);

impl device::Layer for Counting {
    fn inner(&self) -> &dyn Device {
        &self.0
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.0
    }

    fn run_on_host(&self, work: &mut (dyn FnMut() + Send)) {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.run_on_host(work);
    }
}

#[test]
fn builders_of_the_host_run_on_the_threads_of_the_device() {
    let scene = Scene::from_triangles("soup", soup(100, 0.2, 3)).unwrap();
    let host_work = |initial| {
        let mut device = Counting(CpuDevice::new(1).unwrap(), AtomicU32::new(0));
        let settings = Settings::default().with(|s| {
            s.initial = initial;
            s.optimizer = Optimizer::None;
        });
        optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        device.1.into_inner()
    };
    let lbvh = host_work(Initial::Lbvh);
    assert_eq!([host_work(Initial::SahSweep), host_work(Initial::SahBinned { bins: Bins::DEFAULT })], [lbvh + 1; 2]);
}

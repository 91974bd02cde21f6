//! Plans: what a run leaves out, by the command, and that no omission changes a tree.

use prbvh::build::{
    Bins, CodeCensus, Codes, DEFAULT_HPLOC_RADIUS, DEFAULT_PASSES, DEFAULT_RADIUS, KMeansSettings, MortonBits,
    TreeletSize, atrbvh, hploc, lbvh, ploc,
};
use prbvh::collapse::CollapseSettings;
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{Limits, PrbvhSettings, RotationSettings, Strategy, WorstFirst};
use prbvh::pipeline::{Initial, Optimizer, PipelineError, Settings, optimize, optimize_by};
use prbvh::plan::{DeviceCode, Omission, Plan, PlanMismatch, Status};
use prbvh::scene::Scene;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use prbvh_lab::stability::CATALOGUE;
use prbvh_tests::command::run;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{flat, grid, inputs, soup, working};
use serde_json::Value;
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use tempfile::tempdir;

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

/// Triangles as OBJ.
fn obj(triangles: &[Triangle]) -> String {
    let corner = |p: [f32; 3]| format!("v {:?} {:?} {:?}\n", p[0], p[1], p[2]);
    let triangle = |t: &Triangle| format!("{}{}{}f -3 -2 -1\n", corner(t.a), corner(t.b), corner(t.c));
    triangles.iter().map(triangle).collect()
}

/// With a triangle beside the first one, in the same cell of 30-bit codes.
fn with_near_pair(mut triangles: Vec<Triangle>) -> Vec<Triangle> {
    let near = |p: [f32; 3]| p.map(|x| x - 1e-5);
    let Triangle { a, b, c } = triangles[0];
    triangles.push(Triangle { a: near(a), b: near(b), c: near(c) });
    triangles
}

fn census(triangles: &[Triangle]) -> CodeCensus {
    let scene = Scene::from_triangles("census", triangles.to_vec()).unwrap();
    CodeCensus::of(triangles, scene.census.min, scene.census.max)
}

/// The nodes of the LBVH and, for a PLOC, an ATRBVH and an H-PLOC, of these.
fn built(device: &mut dyn Device, triangles: &[Triangle], codes: Codes) -> Vec<Vec<Node>> {
    let trees = [
        lbvh(device, triangles, codes).unwrap().0,
        ploc(device, triangles, codes, DEFAULT_RADIUS).unwrap().0,
        atrbvh(device, triangles, codes, TreeletSize::DEFAULT).unwrap().0,
        hploc(device, triangles, codes, DEFAULT_HPLOC_RADIUS).unwrap().0,
    ];
    trees
        .map(|tree| {
            let nodes = tree.download(device).unwrap();
            tree.free(device);
            nodes
        })
        .into()
}

/// Small scenes whose codes differ in few bits, in many, or in none.
fn scenes() -> Vec<(&'static str, Vec<Triangle>)> {
    let line =
        |k: u16| Triangle { a: [f32::from(k), 0.0, 0.0], b: [f32::from(k), 0.0, 0.0], c: [f32::from(k), 0.0, 0.0] };
    let mut scenes = inputs();
    scenes.extend([
        ("single", soup(1, 0.2, 1)),
        ("one place", soup(1, 0.2, 1).repeat(300)),
        ("twice", soup(200, 0.2, 1).repeat(2)),
        ("line", (0..=1024).map(line).collect()),
        ("two places", [line(0), line(1)].repeat(40)),
        ("few", soup(60, 0.1, 3)),
    ]);
    scenes
}

#[test]
fn enough_bits_make_the_trees_of_all_bits_on_every_device() {
    let mut thirty = 0;
    let mut fewer = 0;
    with_devices(|devices| {
        for (name, triangles) in scenes() {
            let census = census(&triangles);
            for bits in [MortonBits::Thirty, MortonBits::Sixty] {
                let enough = census.enough(bits);
                thirty += usize::from(enough.bits != bits);
                fewer += usize::from(enough.high != Codes::ALL);
                for (device_name, device) in &mut *devices {
                    let triangles = working(&triangles);
                    let all = built(&mut **device, &triangles, bits.into());
                    let few = built(&mut **device, &triangles, enough);
                    assert!(all == few, "{name} on {device_name}: {bits:?}, {enough:x?}");
                }
            }
        }
    });
    assert!(thirty >= 5 && fewer >= 5, "{thirty} scenes need 30 bits, {fewer} differ in fewer");
}

#[test]
fn a_bit_too_few_makes_another_tree() {
    let triangles = with_near_pair(soup(3000, 0.1, 11));
    let census = census(&triangles);
    assert_eq!((census.differing_high, census.low_tells_more), (Codes::ALL, Some(true)));
    assert_eq!(census.enough(MortonBits::Sixty), Codes::from(MortonBits::Sixty));
    let triangles = working(&triangles);
    let mut device = CpuDevice::new(1).unwrap();
    let enough = census.enough(MortonBits::Sixty);
    // PLOC makes a tree of any order.
    let nodes = |device: &mut CpuDevice, codes: Codes| {
        let (tree, _, _) = ploc(device, &triangles, codes, DEFAULT_RADIUS).unwrap();
        tree.download(device).unwrap()
    };
    let all = nodes(&mut device, enough);
    let mut fewer = enough;
    fewer.high &= 0xff_ffff;
    assert!(all != nodes(&mut device, fewer));
    let (tree, _) = lbvh(&mut device, &triangles, enough).unwrap();
    let mut thirty = enough;
    thirty.bits = MortonBits::Thirty;
    let (of_30, _) = lbvh(&mut device, &triangles, thirty).unwrap();
    assert!(tree.download(&mut device).unwrap() != of_30.download(&mut device).unwrap());
}

fn settings(max_leaf: Option<u32>) -> Settings {
    let adaptive = CollapseSettings::default().with(|s| s.max_leaf = max_leaf);
    let prbvh = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(5));
    Settings::default().with(|s| {
        s.adaptive = Some(adaptive);
        s.prbvh = prbvh;
    })
}

#[test]
fn no_omission_changes_the_tree() {
    let all = [Omission::LowerCodes, Omission::EqualBits, Omission::Collapse];
    with_devices(|devices| {
        for (name, triangles) in
            [("few", soup(60, 0.1, 3)), ("one place", soup(1, 0.2, 1).repeat(50)), ("one", soup(1, 0.1, 2))]
        {
            let scene = Scene::from_triangles(name, triangles).unwrap();
            for (device_name, device) in &mut *devices {
                let settings = settings(Some(1));
                let mut observe = |_: &_| ControlFlow::Continue(());
                let with = optimize(&scene, &mut **device, &settings, &mut observe).unwrap();
                let plan = Plan::of(&scene, device.info(), &settings, &all).unwrap();
                assert!(plan.collapses && !with.plan.collapses);
                let without = optimize_by(plan, &scene, &mut **device, &settings, &mut observe).unwrap();
                assert!(with.collapse_timings.is_empty() && !without.collapse_timings.is_empty());
                let hash = prbvh::bvh::tree_hash;
                assert_eq!(hash(&with.tree), hash(&without.tree), "{name} on {device_name}");
                assert_eq!(with.adaptive, without.adaptive, "{name} on {device_name}");
            }
        }
    });
}

#[test]
fn a_collapse_that_matters_is_not_left_out() {
    let scene = Scene::from_triangles("few", soup(60, 0.1, 3)).unwrap();
    let mut device = CpuDevice::new(1).unwrap();
    for max_leaf in [None, Some(2)] {
        let result = optimize(&scene, &mut device, &settings(max_leaf), &mut |_| ControlFlow::Continue(())).unwrap();
        assert!(result.plan.collapses && !result.collapse_timings.is_empty());
    }
}

/// Worst first, and the published order with both strategies.
fn orders() -> [PrbvhSettings; 3] {
    let conservative = PrbvhSettings::published().with(|s| s.strategy = Strategy::Conservative);
    [PrbvhSettings::default(), PrbvhSettings::published(), conservative]
}

#[test]
fn a_run_takes_the_memory_that_its_plan_says() {
    let initials = [
        Initial::Lbvh,
        Initial::Ploc { radius: DEFAULT_RADIUS },
        Initial::Atrbvh { treelet: TreeletSize::DEFAULT },
        Initial::Trbvh { passes: DEFAULT_PASSES },
        Initial::Hploc { radius: DEFAULT_HPLOC_RADIUS },
        Initial::KMeans { kmeans: KMeansSettings::default() },
        Initial::SahSweep,
    ];
    for (n, initial) in [1, 2, 3, 700, 20_000].into_iter().flat_map(|n| initials.clone().map(|initial| (n, initial))) {
        let scene = Scene::from_triangles("soup", soup(n, 0.1, 6)).unwrap();
        for order in orders() {
            for adaptive in [None, Some(CollapseSettings::default().with(|s| s.max_leaf = Some(2)))] {
                let prbvh = order.clone().with(|s| s.limits = Limits::iterations(2));
                let settings = Settings::default().with(|s| {
                    s.initial = initial.clone();
                    s.prbvh = prbvh;
                    s.adaptive = adaptive;
                });
                let mut device = CpuDevice::new(2).unwrap();
                let result = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
                let said = result.plan.phases.iter().filter(|phase| phase.runs).map(|phase| phase.peak_bytes).max();
                let (said, taken) = (said.unwrap(), device.memory().peak_bytes);
                // Only the collapse does not know beforehand how many nodes it keeps: at most two more per triangle.
                let unknown = if result.plan.collapses { 2 * n as u64 * size_of::<Node>() as u64 } else { 0 };
                assert!((taken..=taken + unknown).contains(&said), "{n} {initial} {order:?}: {said}, not {taken}");
            }
        }
    }
}

#[test]
fn rotations_take_the_memory_that_their_plan_says() {
    for (n, annealing) in [1, 2, 3, 700, 20_000].into_iter().flat_map(|n| [(n, 0), (n, 2)]) {
        let scene = Scene::from_triangles("soup", soup(n, 0.1, 6)).unwrap();
        // On the host, so that no builder takes more.
        let initial = Initial::SahSweep;
        let rotations = RotationSettings::default().with(|s| {
            s.annealing_passes = annealing;
            s.limits = Limits::iterations(3);
        });
        let settings = Settings::default().with(|s| {
            s.initial = initial;
            s.optimizer = Optimizer::Rotations(rotations);
        });
        let mut device = CpuDevice::new(2).unwrap();
        let result = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        let said = result.plan.phases.iter().filter(|phase| phase.runs).map(|phase| phase.peak_bytes).max();
        assert_eq!(said, Some(device.memory().peak_bytes), "{n}, {annealing}");
    }
}

/// A plan by the command.
fn planned(name: &str, triangles: &[Triangle], arguments: &[&str]) -> Value {
    let folder = tempdir().unwrap();
    let file = format!("{name}.obj");
    std::fs::write(folder.path().join(&file), obj(triangles)).unwrap();
    run(PRBVH, folder.path(), &[&["plan", &file, "--device", "cpu", "--json"], arguments].concat()).ok().json()
}

/// What a plan leaves out, and what it does not do.
fn omissions(plan: &Value) -> BTreeSet<String> {
    let items = plan["plan"]["items"].as_array().unwrap().iter();
    let kept = items.filter(|item| item["status"] == "left-out" || item["status"] == "not-done");
    kept.map(|item| format!("{} {}", item["status"].as_str().unwrap(), item["omission"].as_str().unwrap())).collect()
}

#[test]
fn different_scenes_have_different_plans() {
    let made = [
        ("many", with_near_pair(soup(5000, 0.1, 4)), "needs the lower words and all passes"),
        ("few", soup(60, 0.1, 3), "needs no lower words"),
        ("single", soup(1, 0.2, 1), "needs no pass"),
        ("one-place", soup(1, 0.2, 1).repeat(30), "needs no pass and has duplicates"),
        ("twice", with_near_pair(soup(4000, 0.1, 4)).repeat(2), "needs the lower words and has duplicates"),
    ];
    let mut seen = BTreeSet::new();
    for (name, triangles, why) in &made {
        assert!(seen.insert(omissions(&planned(name, triangles, &[]))), "{name} {why}");
    }
    let flat = planned("flat", &flat(500), &[]);
    assert_eq!(flat["census"]["flat_axes"], serde_json::json!([false, true, false]));
    let grid = planned("grid", &grid(16), &[]);
    assert!((grid["census"]["extent_ratio"].as_f64(), grid["area_decades"].as_f64()) == (Some(1.0), Some(0.0)));
    let twice = planned("twice", &soup(40, 0.1, 4).repeat(2), &[]);
    assert_eq!((&twice["census"]["duplicates"], &twice["duplicate_boxes"]), (&40.into(), &40.into()));
}

#[test]
fn a_plan_follows_the_settings() {
    let scene = soup(500, 0.1, 4);
    let left_out = |arguments: &[&str], what: &str| {
        omissions(&planned("soup", &scene, arguments)).contains(&format!("left-out {what}"))
    };
    let published = ["--order", "published"];
    assert!(left_out(&published, "paths"));
    assert!(!left_out(&["--order", "published", "--strategy", "conservative"], "paths"));
    assert!(left_out(&[], "untouched") && !left_out(&published, "untouched"));
    assert!(!left_out(&["--leaves", "adaptive"], "collapse"));
    assert!(left_out(&["--leaves", "adaptive", "--max-leaf", "1"], "collapse"));
    assert!(left_out(&["--initial", "sah-sweep"], "codes") && !left_out(&[], "codes"));
    assert!(left_out(&["--optimizer", "none"], "device-optimizer"));
    assert!(left_out(&["--morton-bits", "30"], "lower-codes"));
}

#[test]
fn a_plan_of_worst_first_follows_its_settings_and_the_scene() {
    let device = CpuDevice::new(1).unwrap();
    let status = |triangles, worst_first, omission| {
        let scene = Scene::from_triangles("soup", soup(triangles, 0.1, 4)).unwrap();
        let prbvh = PrbvhSettings::default().with(|s| s.worst_first = worst_first);
        let settings = Settings::default().with(|s| s.prbvh = prbvh);
        let plan = Plan::of(&scene, device.info(), &settings, &[]).unwrap();
        let item = plan.items.iter().find(|item| item.omission == omission).unwrap();
        (item.status, item.saved.dispatches_per_iteration)
    };
    let usual = WorstFirst::default();
    assert_eq!(status(4, usual, Omission::Tail), (Status::Needed, 0));
    assert_eq!(status(3, usual, Omission::Tail), (Status::NoneThere, 0));
    assert_eq!(status(4, usual.with(|s| s.tail_part = 0.0), Omission::Tail), (Status::LeftOut, 0));
    assert_eq!(status(2049, usual, Omission::Tops), (Status::Needed, 0));
    assert_eq!(status(2048, usual, Omission::Tops), (Status::NoneThere, 0));
    assert_eq!(status(2049, usual.with(|s| s.top = 0), Omission::Tops), (Status::LeftOut, 0));
    assert_eq!(status(4, usual, Omission::MoreLocks), (Status::Needed, 0));
    // A lock and a check; a small round has all of them in one dispatch.
    let one = usual.with(|s| s.lock_rounds = 1);
    assert_eq!(status(4, one, Omission::MoreLocks), (Status::LeftOut, 0));
    assert_eq!(status(4, one.with(|s| s.first = 100), Omission::MoreLocks), (Status::LeftOut, 2));
}

#[test]
fn the_report_of_a_run_has_the_items_of_its_plan() {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join("few.obj"), obj(&soup(60, 0.1, 3))).unwrap();
    let json = |command| run(PRBVH, folder.path(), &[command, "few.obj", "--device", "cpu", "--json"]).ok().json();
    let (report, plan) = (json("optimize"), json("plan"));
    assert_eq!(report["plan_items"], plan["plan"]["items"]);
    let left_out = report["plan_items"].as_array().unwrap().iter().filter(|item| item["status"] == "left-out").count();
    assert!(left_out > 0 && report["plan"].as_array().unwrap().len() == left_out);
    let table = run(PRBVH, folder.path(), &["plan", "few.obj", "--device", "cpu"]).ok().stdout;
    for part in ["few on CPU", "ratio of extents", "optimise, worst first", "left out", "keys of nodes", "none there"] {
        assert!(table.contains(part), "{part} is missing in {table}");
    }
    run(PRBVH, folder.path(), &["plan", "few.obj", "--out", "x"]).refused(&["--out is for `prbvh optimize`"]);
}

#[test]
fn locks_are_planned_by_the_device() {
    let scene = Scene::from_triangles("soup", soup(50, 0.1, 4)).unwrap();
    for atomics_64 in [true, false] {
        let mut info = CpuDevice::new(1).unwrap().info().clone();
        info.atomics_64 = atomics_64;
        let plan = Plan::of(&scene, &info, &Settings::default(), &[]).unwrap();
        let lock = plan.items.iter().find(|item| item.omission == Omission::LockWord).unwrap();
        // One of each round of locks, and what follows the search of a small round is one dispatch in place of eight.
        let lock_rounds = u64::from(Settings::default().prbvh.worst_first.lock_rounds);
        let saved = if atomics_64 { lock_rounds + 7 } else { 0 };
        assert_eq!((lock.status == Status::LeftOut, lock.saved.dispatches_per_iteration), (atomics_64, saved));
    }
}

/// A run of a plan whose codes were changed.
fn run_of(plan: Plan, scene: &Scene, settings: &Settings) -> Result<(), PipelineError> {
    let mut device = CpuDevice::new(1).unwrap();
    optimize_by(plan, scene, &mut device, settings, &mut |_| ControlFlow::Continue(())).map(|_| ())
}

#[test]
fn a_plan_with_a_planted_fault_is_refused() {
    let scene = Scene::from_triangles("soup", with_near_pair(soup(2000, 0.1, 4))).unwrap();
    let info = CpuDevice::new(1).unwrap().info().clone();
    let settings = settings(Some(2));
    let plan = Plan::of(&scene, &info, &settings, &[]).unwrap();
    assert!(run_of(plan.clone(), &scene, &settings).is_ok());
    type Fault = (Omission, fn(&mut Plan));
    let planted: [Fault; 4] = [
        (Omission::Collapse, |plan| plan.collapses = false),
        (Omission::LowerCodes, |plan| plan.codes.bits = MortonBits::Thirty),
        (Omission::EqualBits, |plan| plan.codes.high &= 0xffff),
        (Omission::EqualBits, |plan| plan.codes.low = 0),
    ];
    for (omission, plant) in planted {
        let mut plan = plan.clone();
        plant(&mut plan);
        match run_of(plan, &scene, &settings) {
            Err(PipelineError::Plan(PlanMismatch::Needed { what })) => assert_eq!(what, omission),
            other => panic!("{omission}: {other:?}"),
        }
    }
    let other = Scene::from_triangles("soup", soup(2001, 0.1, 4)).unwrap();
    let refused = run_of(plan.clone(), &other, &settings);
    assert!(matches!(refused, Err(PipelineError::Plan(PlanMismatch::Scene { .. }))), "{refused:?}");
    let folding = settings.clone().with(|s| s.fold_duplicates = true);
    let pairs = Scene::from_triangles("pairs", soup(40, 0.1, 4).repeat(2)).unwrap();
    let folded = Plan::of(&pairs, &info, &folding, &[]).unwrap();
    let refused = run_of(folded, &pairs, &settings);
    let is_needed = matches!(refused, Err(PipelineError::Plan(PlanMismatch::Needed { what: Omission::Duplicates })));
    assert!(is_needed, "{refused:?}");
}

#[test]
fn a_run_takes_the_kernels_of_its_plan_and_no_others() {
    let initials = [
        Initial::Lbvh,
        Initial::Ploc { radius: DEFAULT_RADIUS },
        Initial::Atrbvh { treelet: TreeletSize::DEFAULT },
        Initial::Trbvh { passes: DEFAULT_PASSES },
        Initial::Hploc { radius: DEFAULT_HPLOC_RADIUS },
        Initial::KMeans { kmeans: KMeansSettings::default() },
        Initial::SahBinned { bins: Bins::DEFAULT },
    ];
    let scenes = [("soup", soup(700, 0.1, 6)), ("copies", soup(1, 0.1, 6).repeat(300)), ("one", soup(1, 0.1, 6))];
    // Those that the data decide about.
    let by_data = ["kept_restore", "refit_climb", "collapse_jump", "worst_books"];
    with_devices(|devices| {
        for ((name, triangles), initial) in
            scenes.iter().flat_map(|scene| initials.clone().map(|initial| (scene, initial)))
        {
            let scene = Scene::from_triangles(*name, triangles.clone()).unwrap();
            let runs = orders().map(|order| (order, Optimizer::Prbvh));
            let rotations = Optimizer::Rotations(RotationSettings::default().with(|s| s.annealing_passes = 2));
            let others = [Optimizer::None, rotations].map(|optimizer| (PrbvhSettings::default(), optimizer));
            for (order, optimizer) in runs.into_iter().chain(others) {
                let prbvh = order.with(|s| s.limits = Limits::iterations(30));
                let how = format!("{}, {}", prbvh.order, prbvh.strategy);
                let settings = settings(Some(2)).with(|s| {
                    s.initial = initial.clone();
                    s.prbvh = prbvh;
                    s.optimizer = optimizer;
                });
                for (device_name, device) in &mut *devices {
                    let result =
                        optimize(&scene, &mut **device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
                    let what = format!("{name}, {initial}, {how}, {} on {device_name}", settings.optimizer);
                    let plan = &result.plan;
                    assert_eq!(plan.unplanned(&result.ran), Vec::<&str>::new(), "{what}");
                    let ran = DeviceCode::of(&result.ran, device.info());
                    let idle =
                        plan.code.kernels.iter().filter(|name| !ran.kernels.contains(name) && !by_data.contains(name));
                    if *name == "soup" {
                        assert_eq!(idle.collect::<Vec<_>>(), Vec::<&&str>::new(), "{what}");
                    }
                    assert!(plan.code.runs.spirv_bytes < plan.code.all.spirv_bytes, "{what}");
                    // A planted fault: a kernel that is needed is not in the plan.
                    let mut plan = plan.clone();
                    if let Some(first) = ran.kernels.first() {
                        plan.code.kernels.retain(|name| name != first);
                        assert_eq!(plan.unplanned(&result.ran), [*first], "{what}");
                    }
                }
            }
        }
    });
}

#[test]
fn the_catalogue_has_many_plans() {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join("few.obj"), obj(&soup(60, 0.1, 3))).unwrap();
    std::fs::write(folder.path().join("lit.obj"), obj(&soup(60, 0.1, 3)) + "vn 0 0 1\nvt 0.5 0.5\n").unwrap();
    let plan = |more: &[&str]| run(PRBVH, folder.path(), &[&["plan", "--device", "cpu"], more].concat());
    let json = plan(&["few.obj", "lit.obj", "--catalogue", "--json"]).ok().json();
    assert!(json["different"].as_u64().unwrap() >= 5, "{} plans", json["different"]);
    let plans = json["plans"].as_array().unwrap();
    assert_eq!((plans.len(), json["kinds"].as_array().unwrap().len()), (2 + CATALOGUE.len(), 2 + CATALOGUE.len()));
    assert_ne!(json["kinds"][0], json["kinds"][1], "attributes are left out of one of them");
    let attributes = |plan: &Value| {
        let items = plan["plan"]["items"].as_array().unwrap();
        items.iter().find(|item| item["omission"] == "attributes").unwrap()["saved"]["host_bytes"].clone()
    };
    assert_eq!((attributes(&plans[0]), attributes(&plans[1])), (0.into(), 20.into()));
    let text = plan(&["few.obj", "lit.obj"]).ok().stdout;
    for part in ["lit", "lower words of the Morton codes", "2 different plans for 2 scenes"] {
        assert!(text.contains(part), "{part} is missing in {text}");
    }
    // The same scene twice has one plan.
    assert!(plan(&["few.obj", "few.obj"]).ok().stdout.contains("1 different plan for 2 scenes"));
}

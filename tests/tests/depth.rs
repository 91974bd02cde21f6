//! The bound on the depth of trees, and trees as deep as they have triangles.

use prbvh::build::DEFAULT_RADIUS;
use prbvh::bvh::{
    Bvh, BvhNode, Content, MaxDepth, NO_NODE, SAH_BUDGET, SahModel, bound_depth, file, quality, tree_hash, validate,
};
use prbvh::collapse::CollapseSettings;
use prbvh::optimize::{PrbvhSettings, RbvhSettings};
use prbvh::pipeline::{Initial, Optimized, Optimizer, Settings, optimize};
use prbvh::scene::{Scene, built_in};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use prbvh_lab::stability::CATALOGUE;
use prbvh_tests::command::{Ended, run};
use prbvh_tests::devices::{with_devices, without_vulkan};
use prbvh_tests::fixtures::soup;
use std::ops::ControlFlow;
use std::path::Path;

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

/// Teeth of a comb, each half as large as the one before: its best tree is a chain.
fn comb() -> Vec<Triangle> {
    CATALOGUE.iter().find(|case| case.name == "comb").unwrap().triangles(false)
}

/// A valid tree in which triangle `k` is the left child at depth `k + 1`.
fn chain(triangles: &[Triangle]) -> Bvh {
    let n = triangles.len() as u32;
    let node = |parent, content| BvhNode { aabb: Aabb::EMPTY, parent, content };
    let right = |p: u32| if p + 2 < n { p + 1 } else { 2 * n - 2 };
    let mut nodes: Vec<BvhNode> = (0..n - 1)
        .map(|p| node(p.checked_sub(1).unwrap_or(NO_NODE), Content::Internal { left: n - 1 + p, right: right(p) }))
        .collect();
    nodes.extend((0..n).map(|k| node(k.min(n - 2), Content::Leaf { first: k, count: 1 })));
    Bvh { nodes, triangle_order: (0..n).collect() }.with_boxes_of(triangles)
}

/// Runs on every device; all make the same tree.
fn everywhere(scene: &Scene, settings: &Settings) -> Optimized {
    with_devices(|devices| {
        let mut first: Option<Optimized> = None;
        for (on, device) in devices {
            let result = optimize(scene, &mut **device, settings, &mut |_| ControlFlow::Continue(()))
                .unwrap_or_else(|error| panic!("{on}: {error}"));
            validate(&result.tree, Some(&scene.triangles)).unwrap_or_else(|faults| panic!("{on}: {faults:?}"));
            assert_eq!(device.memory().bytes, 0, "{on}: buffers are left");
            if let Some(first) = &first {
                assert_eq!(tree_hash(&first.tree), tree_hash(&result.tree), "{on}");
                assert_eq!(first.bound, result.bound, "{on}");
            }
            first.get_or_insert(result);
        }
        first.expect("there is always the CPU")
    })
}

#[test]
fn every_way_to_a_tree_keeps_to_the_bound_on_every_device() {
    let comb = comb();
    let scene = Scene::from_triangles("comb", comb.clone()).unwrap();
    let twice = Scene::from_triangles("twice", comb.repeat(2)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("chain.bvh");
    file::write(&file, &chain(&scene.triangles), &scene.hash).unwrap();
    // LBVH is shallow, and where there is nothing to gain it stays so.
    let ploc = Settings::default().with(|s| s.initial = Initial::Ploc { radius: DEFAULT_RADIUS });
    let chain = Settings::default().with(|s| s.initial = Initial::File { path: file });
    let published = ploc.clone().with(|s| s.prbvh = PrbvhSettings::published());
    let adaptive = ploc.clone().with(|s| s.adaptive = Some(CollapseSettings::default()));
    let folded = adaptive.clone().with(|s| s.fold_duplicates = true);
    let rbvh = chain.clone().with(|s| s.optimizer = Optimizer::Rbvh(RbvhSettings::default()));
    let unoptimised = chain.with(|s| s.optimizer = Optimizer::None);
    let runs = [
        ("worst first", &scene, ploc),
        ("published", &scene, published),
        ("rbvh", &scene, rbvh),
        ("no optimiser", &scene, unoptimised),
        ("adaptive", &scene, adaptive),
        ("folded", &twice, folded),
    ];
    for (name, scene, settings) in runs {
        let result = everywhere(scene, &settings);
        let bound = result.bound.unwrap_or_else(|| panic!("{name}: {:?}", result.quality));
        println!("{name}: {bound}");
        assert!(bound.depth_before > 63 && bound.depth_after <= 63, "{name}: {bound:?}");
        // From level 40 on, boxes are below 2^-80 of the root's.
        assert!(bound.rise().abs() < 1e-9, "{name}: {bound:?}");
        assert_eq!((bound.cost_before, bound.cost_after), (result.optimized_cost(), result.quality.sah_cost), "{name}");
        let handed_out = quality(&result.tree, &SahModel::default());
        assert!(handed_out.max_depth <= 63 && handed_out.stack == handed_out.max_depth, "{name}: {handed_out:?}");
        assert_eq!(handed_out.triangles as usize, scene.triangles.len(), "{name}");
        assert_eq!(MaxDepth::default().fault(&result.tree), None, "{name}");

        let free = everywhere(scene, &settings.clone().with(|s| s.max_depth = MaxDepth::OFF));
        assert_eq!((free.bound, free.quality.max_depth), (None, bound.depth_before), "{name}");
        assert_eq!(free.quality.sah_cost, bound.cost_before, "{name}");
        assert!(settings.adaptive.is_some() || MaxDepth::default().fault(&free.tree).is_some(), "{name}");
        // A bound that the tree is within changes no bit of it.
        let wide = settings.with(|s| s.max_depth = MaxDepth::new(bound.depth_before));
        let wide = everywhere(scene, &wide);
        assert!(wide.bound.is_none() && wide.tree == free.tree, "{name}");
    }
}

#[test]
fn the_tightest_bound_is_met_and_a_tighter_one_refused() {
    let scene = Scene::from_triangles("soup", soup(700, 0.2, 3)).unwrap();
    let with = |links| Settings::default().with(|s| s.max_depth = MaxDepth::new(links));
    let mut rise = f64::INFINITY;
    for links in [10, 11] {
        let bound = everywhere(&scene, &with(links)).bound.unwrap();
        println!("{links}: {bound}");
        assert!(bound.depth_after <= links, "{bound:?}");
        // More levels cost less.
        assert!(bound.rise() < rise, "{bound:?}");
        rise = bound.rise();
    }
    with_devices(|devices| {
        for (_, device) in devices {
            let mut rows = 0;
            let error = optimize(&scene, &mut **device, &with(9), &mut |_| {
                rows += 1;
                ControlFlow::Continue(())
            });
            let error = error.unwrap_err().to_string();
            assert!(error.contains("max_depth") && error.contains("700") && error.contains("least is 10"), "{error}");
            assert_eq!(rows, 0, "something was done before");
        }
    });
}

fn command(folder: &Path, arguments: &str) -> Ended {
    run(PRBVH, folder, &arguments.split_whitespace().collect::<Vec<_>>())
}

#[test]
fn the_command_bounds_the_depth_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let optimize = |arguments: &str| {
        let common = "optimize built-in --triangles 3000 --device cpu --json";
        command(folder.path(), &format!("{common} {arguments}"))
    };
    let free = optimize("--max-depth off").ok().json();
    assert!(free["settings"]["max_depth"].is_null() && free["bound"].is_null(), "{free}");
    let usual = optimize("").ok();
    assert!(!usual.stderr.contains("--max-depth"), "{}", usual.stderr);
    let usual = usual.json();
    assert_eq!((&usual["settings"]["max_depth"], &usual["bound"]), (&63.into(), &serde_json::Value::Null));
    assert_eq!(usual["tree_hash"], free["tree_hash"]);

    let tight = optimize("--max-depth 16 --out out").ok();
    let report = tight.json();
    let bound = &report["bound"];
    assert_eq!((&bound["max_depth"], &bound["depth_before"]), (&16.into(), &free["depth"]));
    assert_eq!((&bound["cost_before"], &bound["cost_after"]), (&free["final_cost"], &report["final_cost"]));
    assert!(bound["subtrees"].as_u64() > Some(0) && bound["nodes"].as_u64() > Some(0), "{bound}");
    assert!(tight.stderr.contains("INFO --max-depth 16: depth "), "{}", tight.stderr);
    let stats = command(folder.path(), "stats out/tree.bvh --json").ok().json();
    assert!(stats["max_depth"].as_u64().unwrap() <= 16, "{stats}");
    assert_eq!((&stats["stack"], &stats["tree_hash"]), (&stats["max_depth"], &report["tree_hash"]));
    let text = command(folder.path(), "stats out/tree.bvh").ok().stdout;
    assert!(text.contains(&format!("stack        {} entries", stats["stack"])), "{text}");
    let table = command(folder.path(), "optimize --triangles 3000 --device cpu --max-depth 16").ok().stdout;
    assert!(table.contains("bounded to"), "{table}");

    // As tight as can be: if that is dear, the log says so with both costs.
    let tightest = optimize("--max-depth 12").ok();
    let bound = tightest.json()["bound"].clone();
    let [before, after] = ["cost_before", "cost_after"].map(|key| bound[key].as_f64().unwrap());
    assert!(after / before - 1.0 > SAH_BUDGET, "{bound}");
    for part in ["WARN", "--max-depth 12", "10 %", &format!("{before:.3} to {after:.3}")] {
        assert!(tightest.stderr.contains(part), "{part} is not in {}", tightest.stderr);
    }
}

#[test]
fn a_bound_that_cannot_be_met_is_refused_by_name_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    for what in ["optimize", "plan", "compare --methods lbvh --rays off"] {
        let refused =
            |bound: &str| command(folder.path(), &format!("{what} --triangles 3000 --device cpu --max-depth {bound}"));
        refused("11").refused(&["--max-depth 11", "3000", "12"]);
        assert!(!refused("11").stderr.contains("iteration"));
        for text in ["-1", "deep", "1.5", "99999999999"] {
            refused(text).refused(&["--max-depth", text, "off"]);
        }
    }
    command(folder.path(), "optimize --triangles 3000 --device cpu --max-depth 11 --out out")
        .refused(&["--max-depth 11"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "a refused run leaves nothing");
}

#[test]
fn compare_bounds_our_trees_and_shows_their_stacks() {
    let folder = tempfile::tempdir().unwrap();
    let compare = |arguments: &str| {
        let common = "compare --triangles 600 --device cpu --rays off --json --methods lbvh,worst-first,rbvh,sah-sweep";
        command(folder.path(), &format!("{common} {arguments}")).ok().json()
    };
    for row in compare("--max-depth 11")["rows"].as_array().unwrap() {
        let (depth, stack) = (row["depth"].as_u64().unwrap(), row["stack"].as_u64().unwrap());
        assert!(depth <= 11 && stack <= depth, "{row}");
        assert_eq!(row["bound"]["max_depth"], 11, "{row}");
        assert_eq!(row["bound"]["cost_after"], row["cost"], "{row}");
    }
    for row in compare("--out out")["rows"].as_array().unwrap() {
        assert!(row["bound"].is_null() && row["stack"].as_u64() <= row["depth"].as_u64(), "{row}");
    }
    let csv = std::fs::read_to_string(folder.path().join("out/compare.csv")).unwrap();
    assert!(csv.lines().next().unwrap().contains(",depth,stack,"), "{csv}");
}

/// Walks on the call stack would end with an overflow of it.
#[test]
fn a_chain_of_two_hundred_thousand_levels_goes_through_everything() {
    const N: usize = 200_000;
    let triangles = soup(N, 0.01, 11);
    let tree = chain(&triangles);
    assert_eq!(validate(&tree, Some(&triangles)).unwrap().max_depth as usize, N - 1);
    let measured = quality(&tree, &SahModel::default());
    assert_eq!((measured.max_depth as usize, measured.stack as usize), (N - 1, N - 1));
    let hash = tree_hash(&tree);
    let nodes = tree.to_device().unwrap();
    assert_eq!(tree_hash(&Bvh::from_device(&nodes).unwrap()), hash);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chain.bvh");
    file::write(&path, &tree, &"0".repeat(32)).unwrap();
    assert_eq!(tree_hash(&file::read(&path).unwrap().tree), hash);
    let stats = command(folder.path(), "stats chain.bvh --json").ok().json();
    assert_eq!((&stats["max_depth"], &stats["tree_hash"]), (&(N - 1).into(), &hash.into()));

    let mut bounded = tree;
    let bound = bound_depth(&mut bounded, MaxDepth::new(18), &SahModel::default()).unwrap().unwrap();
    assert!(validate(&bounded, Some(&triangles)).is_ok() && bound.depth_after == 18, "{bound:?}");
}

#[test]
fn a_chain_as_the_initial_tree_goes_through_the_pipeline() {
    const N: usize = 20_000;
    let folder = tempfile::tempdir().unwrap();
    let scene = built_in(N);
    file::write(&folder.path().join("chain.bvh"), &chain(&scene.triangles), &scene.hash).unwrap();
    let devices: &[&str] = if without_vulkan() { &["cpu"] } else { &["cpu", "vulkan"] };
    for device in devices {
        let optimize = |arguments: &str| {
            let common =
                format!("optimize --triangles {N} --initial chain.bvh --optimizer none --device {device} --json");
            command(folder.path(), &format!("{common} {arguments}")).ok().json()
        };
        assert_eq!(optimize("--max-depth off --out out")["depth"], N - 1, "{device}");
        let stats = command(folder.path(), "stats out/tree.bvh --json").ok().json();
        assert_eq!(stats["stack"], N - 1, "{device}");
        assert!(optimize("--max-depth off --leaves adaptive")["depth"].as_u64().unwrap() < N as u64, "{device}");
        let bounded = optimize("--max-depth 15");
        assert_eq!((&bounded["depth"], &bounded["bound"]["depth_before"]), (&15.into(), &(N - 1).into()), "{device}");
        assert!(bounded["final_cost"].as_f64() < bounded["initial_cost"].as_f64(), "{device}");
    }
}

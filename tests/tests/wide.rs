//! Rays through wide trees hit what they hit without a tree, on every device; obvhs reads our compressed nodes; the pipeline makes what it is asked for.

use glam::Vec3A;
use obvhs::ray::RayHit;
use prbvh::bvh::{Bvh, SahModel, quality};
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::interop::obvhs::{from_cwbvh, to_cwbvh};
use prbvh::pipeline::{self, Initial, Optimizer, Settings};
use prbvh::scene::{Scene, Triangle, built_in};
use prbvh::trace::{Hit, NO_TRIANGLE, Query, Ray, SOME_TRIANGLE, TraceError, TraceScene, trace};
use prbvh::wide::{
    self, CollapseMethod, Layout, PackedNodes, PackedTree, WideBvh, WideChild, WideContent, WideNode, WideSettings,
    Width,
};
use prbvh_tests::command::{self, Ended};
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{Random, soup};
use prbvh_tests::oracle::random_tree;
use prbvh_tests::rays::{STARTS, answers, brute_force, ray, rays};
use std::ops::ControlFlow;
use std::path::Path;

const FORMS: [(Width, Layout); 3] =
    [(Width::Four, Layout::Soa), (Width::Eight, Layout::Soa), (Width::Eight, Layout::Cwbvh)];

fn settings((width, layout): (Width, Layout)) -> WideSettings {
    WideSettings::default().with(|s| {
        s.width = width;
        s.layout = layout;
    })
}

fn packed(tree: &Bvh, settings: &WideSettings) -> PackedTree {
    PackedTree::new(&wide::collapse(tree, settings).unwrap(), settings.layout).unwrap()
}

fn run(settings: &Settings, scene: &Scene) -> pipeline::Optimized {
    let mut device = CpuDevice::new(2).unwrap();
    pipeline::optimize(scene, &mut device, settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn swept(triangles: &[Triangle]) -> Bvh {
    let scene = Scene::from_triangles("soup", triangles.to_vec()).unwrap();
    let settings = Settings::default().with(|s| {
        s.initial = Initial::SahSweep;
        s.optimizer = Optimizer::None;
    });
    run(&settings, &scene).tree
}

fn cast(device: &mut dyn Device, tree: &PackedTree, triangles: &[Triangle], rays: &[Ray], query: Query) -> Vec<Hit> {
    let mut scene = TraceScene::of_wide(device, tree, triangles, &STARTS).unwrap();
    let (hits, _) = trace(device, &mut scene, rays, query).unwrap();
    scene.free(device);
    hits
}

/// Hits of every layout on every device against all triangles one by one.
fn check(triangles: &[Triangle], tree: &Bvh, rays: &[Ray], what: &str) {
    let expected = brute_force(triangles, rays);
    for form in FORMS {
        let tree = packed(tree, &settings(form));
        let mut first: Option<Vec<Hit>> = None;
        with_devices(|devices| {
            for (name, device) in devices {
                let before = device.memory().bytes;
                let hits = cast(&mut **device, &tree, triangles, rays, Query::Closest);
                for (k, (hit, expected)) in answers(&hits).iter().zip(&expected).enumerate() {
                    assert_eq!(hit, expected, "{what}, {form:?}, {name}, ray {k}: {:?}", rays[k]);
                }
                let any = cast(&mut **device, &tree, triangles, rays, Query::Any);
                for (k, (any, &(_, triangle))) in any.iter().zip(&expected).enumerate() {
                    let some = if triangle == NO_TRIANGLE { NO_TRIANGLE } else { SOME_TRIANGLE };
                    assert_eq!((any.t, any.triangle), (0.0, some), "{what}, {form:?}, {name}, ray {k}");
                }
                let both = [hits, any].concat();
                // The costs too are the same everywhere.
                assert!(*first.get_or_insert_with(|| both.clone()) == both, "{what}, {form:?}, {name}");
                assert_eq!(device.memory().bytes, before);
            }
        });
    }
}

#[test]
fn random_soups() {
    for (count, size, seed) in [(1, 0.5, 1), (2, 0.5, 2), (9, 0.8, 3), (1200, 0.1, 4)] {
        let triangles = soup(count, size, seed);
        check(&triangles, &swept(&triangles), &rays(&triangles, 700, seed), &format!("soup of {count}"));
    }
}

#[test]
fn a_bad_tree_flat_and_coincident_triangles() {
    let mut triangles = soup(60, 0.5, 8);
    for k in 0..20 {
        let t = triangles[k];
        triangles.push(Triangle { a: t.a, b: t.a, c: t.a });
        triangles.push(Triangle { a: t.a, b: t.b, c: t.b });
        // The same surface again, in another order of corners: the lower number wins.
        triangles.push(t);
        triangles.push(Triangle { a: t.b, b: t.c, c: t.a });
    }
    // A wall in the plane x = 0.5: boxes without extent.
    for j in 0..8 {
        let [low, high] = [j as f32 / 8.0, (j + 1) as f32 / 8.0];
        triangles.push(Triangle { a: [0.5, low, 0.0], b: [0.5, high, 0.0], c: [0.5, high, 1.0] });
        triangles.push(Triangle { a: [0.5, low, 0.0], b: [0.5, high, 1.0], c: [0.5, low, 1.0] });
    }
    let boxes: Vec<_> = triangles.iter().map(Triangle::aabb).collect();
    let tree = Bvh::from_device(&random_tree(&boxes, 1).encode()).unwrap();
    let mut cast = rays(&triangles, 700, 9);
    let mut random = Random(3);
    cast.extend((0..100).map(|k| {
        let target = [0.5, (1 + k % 7) as f32 / 8.0, random.unit()];
        ray([-1.0, target[1], target[2]], target)
    }));
    check(&triangles, &tree, &cast, "degenerate");
    let twins = brute_force(&triangles, &cast).into_iter().filter(|hit| hit.1 < 20).count();
    assert!(twins > 20, "only {twins} rays hit a triangle with a twin");
}

/// A tree in which each node has one triangle and the rest below it.
fn chain(levels: usize, width: Width) -> WideBvh {
    let child = |content| Some(WideChild { aabb: prbvh_kernel::aabb::Aabb::EMPTY, content });
    let nodes = (0..levels as u32).map(|v| {
        let mut node = WideNode::default();
        node.slots[0] = child(WideContent::Leaf { first: v, count: 1 });
        if (v as usize) < levels - 1 {
            node.slots[2] = child(WideContent::Node(v + 1));
        }
        node
    });
    WideBvh { width, nodes: nodes.collect(), triangle_order: (0..levels as u32).collect() }
}

#[test]
fn stacks_hold_trees_of_every_depth() {
    for levels in [1usize, 2, 31, 32, 33, 2_000] {
        let triangles = soup(levels, 0.4, levels as u64);
        let cast = rays(&triangles, if levels > 1000 { 20 } else { 150 }, 18);
        let expected = brute_force(&triangles, &cast);
        for (width, layout) in FORMS {
            let tree = PackedTree::new(&chain(levels, width).with_boxes_of(&triangles), layout).unwrap();
            with_devices(|devices| {
                for (name, device) in devices {
                    let mut scene = TraceScene::of_wide(&mut **device, &tree, &triangles, &STARTS).unwrap();
                    assert_eq!((scene.depth() as usize, scene.is_deep()), (levels, levels > 32));
                    let (hits, _) = trace(&mut **device, &mut scene, &cast, Query::Closest).unwrap();
                    assert_eq!(answers(&hits), expected, "{levels} levels, {layout} of {width}, {name}");
                    scene.free(&mut **device);
                }
            });
        }
    }
}

#[test]
fn a_walk_goes_on_where_a_dispatch_ended() {
    // More triangles in a leaf than a dispatch has steps, and siblings that wait meanwhile.
    let triangles: Vec<Triangle> = soup(8, 0.3, 19).into_iter().cycle().take(40_000).collect();
    let cast = rays(&triangles, 12, 20);
    let expected = brute_force(&triangles, &cast);
    let mut tree = chain(3, Width::Eight);
    let leaf =
        |first, count| Some(WideChild { aabb: triangles[0].aabb(), content: WideContent::Leaf { first, count } });
    tree.nodes[0].slots[0] = leaf(0, 1000);
    tree.nodes[1].slots[0] = leaf(1000, 38_000);
    tree.nodes[2].slots[0] = leaf(39_000, 1000);
    tree.triangle_order = (0..40_000).rev().collect();
    let tree = PackedTree::new(&tree.with_boxes_of(&triangles), Layout::Soa).unwrap();
    with_devices(|devices| {
        for (name, device) in devices {
            let mut scene = TraceScene::of_wide(&mut **device, &tree, &triangles, &STARTS).unwrap();
            let (hits, _) = trace(&mut **device, &mut scene, &cast, Query::Closest).unwrap();
            assert!(scene.is_deep(), "{name}");
            assert_eq!(answers(&hits), expected, "{name}");
            scene.free(&mut **device);
        }
    });
}

#[test]
fn a_box_that_is_too_small_is_noticed() {
    let triangles = soup(300, 0.2, 5);
    let cast = rays(&triangles, 400, 6);
    let expected = brute_force(&triangles, &cast);
    let mut device = CpuDevice::new(1).unwrap();
    let tree = packed(&swept(&triangles), &settings((Width::Eight, Layout::Cwbvh)));
    let mut scene = TraceScene::of_wide(&mut device, &tree, &triangles, &STARTS).unwrap();
    let nodes = scene.buffers()[0].clone();
    let mut bytes = vec![0; nodes.length * 80];
    device.download(&nodes, &mut bytes).unwrap();
    // The upper faces along y of the root's children, a fifth of the node inwards.
    for byte in &mut bytes[56..64] {
        *byte = byte.saturating_sub(50);
    }
    device.upload(&nodes, &bytes).unwrap();
    let (hits, _) = trace(&mut device, &mut scene, &cast, Query::Closest).unwrap();
    assert_ne!(answers(&hits), expected);
    scene.free(&mut device);
}

#[test]
fn broken_trees_are_refused() {
    let triangles = soup(30, 0.3, 1);
    let mut device = CpuDevice::new(1).unwrap();
    let good = packed(&swept(&triangles), &settings((Width::Four, Layout::Soa)));
    let mut refused = |tree: &PackedTree, triangles: &[Triangle]| {
        let error = TraceScene::of_wide(&mut device, tree, triangles, &STARTS).unwrap_err();
        assert!(matches!(error, TraceError::InvalidWideTree(_)), "{error}");
        assert_eq!(device.memory().bytes, 0);
    };
    refused(&good, &triangles[..29]);
    let mut other = good.clone();
    other.order[3] = other.order[4];
    refused(&other, &triangles);
    let mut other = good.clone();
    let PackedNodes::Bvh4(nodes) = &mut other.nodes else { unreachable!() };
    nodes[0].child[0] = 0;
    refused(&other, &triangles);
}

fn hit(ray: &obvhs::ray::Ray, t: &Triangle) -> f32 {
    let [a, b, c] = [t.a, t.b, t.c].map(|p| p.map(f64::from));
    let [origin, direction] = [ray.origin, ray.direction].map(|v| v.to_array().map(f64::from));
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let (to_b, to_c, from_a) = (minus(b, a), minus(c, a), minus(origin, a));
    let normal = cross(direction, to_c);
    let scale = 1.0 / dot(to_b, normal);
    let u = dot(from_a, normal) * scale;
    let across = cross(from_a, to_b);
    let v = dot(direction, across) * scale;
    let along = dot(to_c, across) * scale;
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && along >= 0.0 { along as f32 } else { f32::INFINITY }
}

#[test]
fn obvhs_traces_our_compressed_nodes() {
    const RAYS: usize = 10_000;
    let triangles = soup(1500, 0.1, 11);
    let mut random = Random(13);
    let cast: Vec<obvhs::ray::Ray> = (0..RAYS)
        .map(|_| ray(random.point(3.0).map(|x| x - 1.0), random.point(1.0)))
        .map(|ray| obvhs::ray::Ray::new_inf(Vec3A::from_array(ray.origin), Vec3A::from_array(ray.direction)))
        .collect();
    let expected = cast.iter().map(|ray| {
        let hits = (0..).zip(&triangles).map(|(k, t)| (hit(ray, t), k));
        hits.min_by(|a, b| a.partial_cmp(b).unwrap()).filter(|hit| hit.0.is_finite()).map_or(NO_TRIANGLE, |hit| hit.1)
    });
    let expected: Vec<u32> = expected.collect();
    let wide = wide::collapse(&swept(&triangles), &settings((Width::Eight, Layout::Cwbvh))).unwrap();
    let theirs = to_cwbvh(&wide).unwrap();
    let found = cast.iter().map(|&ray| {
        let mut found = RayHit::none();
        let triangle = |position: usize| theirs.primitive_indices[position];
        theirs.ray_traverse(ray, &mut found, |ray, position| hit(ray, &triangles[triangle(position) as usize]));
        if found.t.is_finite() { triangle(found.primitive_id as usize) } else { NO_TRIANGLE }
    });
    assert!(found.eq(expected.iter().copied()));
    assert!(expected.iter().filter(|&&triangle| triangle != NO_TRIANGLE).count() > RAYS / 2);
    // Its validator goes through nodes and boxes, and back it is the same tree.
    let boxes: Vec<obvhs::triangle::Triangle> = triangles
        .iter()
        .map(|t| obvhs::triangle::Triangle { v0: t.a.into(), v1: t.b.into(), v2: t.c.into() })
        .collect();
    theirs.validate(&boxes, false);
    let back = from_cwbvh(&theirs).unwrap();
    let exact = back.with_boxes_of(&triangles);
    assert_eq!(PackedTree::new(&exact, Layout::Cwbvh), PackedTree::new(&wide, Layout::Cwbvh));
    let mut broken = theirs;
    broken.nodes[0].e[1] = 0;
    assert!(from_cwbvh(&broken).is_err());
}

#[test]
fn the_pipeline_makes_what_is_asked_for() {
    let scene = built_in(1500);
    let plain = run(&Settings::default(), &scene);
    assert_eq!(plain.wide, None);
    for form in FORMS {
        let wide = settings(form);
        let done = run(&Settings::default().with(|s| s.wide = Some(wide)), &scene);
        // The binary tree is the same.
        assert_eq!(quality(&done.tree, &SahModel::default()), plain.quality);
        let made = done.wide.unwrap();
        assert_eq!((made.tree.nodes.width(), made.tree.nodes.layout()), form);
        assert_eq!(made.tree, packed(&plain.tree, &wide));
        let greedy = WideSettings::default().with(|s| {
            (s.width, s.layout) = form;
            s.method = CollapseMethod::Greedy;
        });
        let greedy = wide::quality(&wide::collapse(&plain.tree, &greedy).unwrap(), &wide.costs());
        assert!(made.quality.sah_cost < greedy.sah_cost, "{form:?}: {} {}", made.quality.sah_cost, greedy.sah_cost);
        wide::validate(&made.tree.unpack().unwrap(), Some(&scene.triangles)).unwrap();
    }
    let binary = 68.0 - 32.0 / 1500.0;
    let compressed = packed(&plain.tree, &settings((Width::Eight, Layout::Cwbvh)));
    assert!(compressed.bytes_per_triangle() < 0.5 * binary, "{}", compressed.bytes_per_triangle());
}

fn prbvh(folder: &Path, arguments: &str) -> Ended {
    let arguments: Vec<&str> = arguments.split(' ').collect();
    command::run(env!("CARGO_BIN_EXE_prbvh-under-test"), folder, &arguments)
}

#[test]
fn the_command_writes_reads_and_renders_wide_trees() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &str| prbvh(folder.path(), arguments);
    const SMALL: &str = "--triangles 800 --device cpu";
    let report = run(&format!("optimize built-in {SMALL} --layout cwbvh --out out --json")).ok().json();
    let (wide, settings) = (&report["wide"], &report["settings"]["wide"]);
    assert_eq!(
        (&settings["width"], &settings["layout"], &settings["method"]),
        (&8.into(), &"cwbvh".into(), &"optimal".into())
    );
    let bytes = wide["bytes_per_triangle"].as_f64().unwrap();
    let stats = run("stats out/wide.bvh --scene built-in --triangles 800 --json").ok().json();
    assert_eq!((&stats["valid"], &stats["width"], &stats["layout"]), (&true.into(), &8.into(), &"cwbvh".into()));
    assert_eq!((&stats["tree_hash"], stats["bytes_per_triangle"].as_f64()), (&wide["tree_hash"], Some(bytes)));
    assert!(stats["packed_sah_cost"].as_f64() > stats["sah_cost"].as_f64(), "{stats}");
    let binary = run("stats out/tree.bvh --json").ok().json();
    assert!(bytes < 0.5 * binary["bytes_per_triangle"].as_f64().unwrap(), "{bytes} {binary}");
    let text = run("stats out/wide.bvh").ok().stdout;
    assert!(text.contains("layout cwbvh") && text.contains("B per triangle"), "{text}");

    // One picture, whatever the tree.
    let picture = |tree: &str| {
        let view = "--size 24x16 --samples 1 --bounces 1 --light-samples 1 --json --out picture.png";
        let rays = run(&format!("render built-in {SMALL} {view} --tree {tree}")).ok().json();
        (std::fs::read(folder.path().join("picture.png")).unwrap(), rays["overall"]["hits"].clone())
    };
    let expected = picture("out/tree.bvh");
    for tree in ["out/wide.bvh", "out/tree.bvh --width 4", "out/tree.bvh --width 8", "out/tree.bvh --layout cwbvh"] {
        assert_eq!(picture(tree), expected, "{tree}");
    }
    run(&format!("render built-in {SMALL} --tree out/wide.bvh --width 4")).refused(&["out/wide.bvh", "wide already"]);
    run(&format!("optimize built-in {SMALL} --width 4 --layout cwbvh")).refused(&["8 where the layout is cwbvh"]);
    run(&format!("optimize built-in {SMALL} --initial out/wide.bvh")).refused(&["wide.bvh", "the version is 2"]);

    let rays = "--size 16x12 --samples 1 --bounces 1 --views 1";
    let json = run(&format!(
        "compare built-in --triangles 800 --device cpu --methods worst-first,wide {rays} --repeat 1 --json"
    ));
    let json = json.ok().json();
    let rows = json["rows"].as_array().unwrap();
    let methods: Vec<&str> = rows.iter().map(|row| row["method"].as_str().unwrap()).collect();
    let names = ["prbvh worst first", "prbvh worst first, bvh4", "prbvh worst first, bvh8", "prbvh worst first, cwbvh"];
    assert_eq!(methods, names);
    for row in rows {
        assert_eq!((&row["status"], &row["tree_hash"]), (&"ok".into(), &rows[0]["tree_hash"]), "{row}");
        assert!(["primary", "shadow", "secondary"].iter().all(|kind| row["mrays"][kind].as_f64() > Some(0.0)), "{row}");
    }
}

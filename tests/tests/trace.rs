//! Rays: hits against all triangles one by one, the same for every tree, on every device, in every order.

use prbvh::build::{DeviceTree, MortonBits, lbvh};
use prbvh::bvh::Bvh;
use prbvh::collapse::{CollapseSettings, collapse};
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{Limits, PrbvhSettings, prbvh};
use prbvh::scene::{SafeRange, built_in};
use prbvh::trace::{Hit, NO_TRIANGLE, Query, Ray, SOME_TRIANGLE, TraceError, TraceScene, trace};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::trace::TraceNode;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{Random, soup};
use prbvh_tests::oracle::random_tree;
use prbvh_tests::rays::{STARTS, answers, brute_force, ray, rays};
use std::ops::ControlFlow;

/// Trees of one scene by name, from bad to good.
fn trees(triangles: &[Triangle]) -> Vec<(&'static str, Bvh)> {
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    let random = Bvh::from_device(&random_tree(&boxes, 1).encode()).unwrap();
    let mut device = CpuDevice::new(2).unwrap();
    let working = SafeRange::of(triangles).apply(triangles);
    let (tree, _) = lbvh(&mut device, &working, MortonBits::Sixty).unwrap();
    let hand_out =
        |tree: &DeviceTree, device: &mut CpuDevice| Bvh::from_device(&tree.download(device).unwrap()).unwrap();
    let first = hand_out(&tree, &mut device);
    let settings = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(10));
    prbvh(&mut device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap();
    let better = hand_out(&tree, &mut device);
    let adaptive = collapse(&mut device, &tree, &CollapseSettings::default()).unwrap().free(&mut device);
    vec![("random", random), ("LBVH", first), ("PRBVH", better), ("adaptive", adaptive)]
}

fn run(device: &mut dyn Device, tree: &Bvh, triangles: &[Triangle], rays: &[Ray], query: Query) -> Vec<Hit> {
    let mut scene = TraceScene::new(device, tree, triangles, &STARTS).unwrap();
    let (hits, _) = trace(device, &mut scene, rays, query).unwrap();
    scene.free(device);
    hits
}

/// Hits of every tree on every device against all triangles one by one.
fn check(triangles: &[Triangle], rays: &[Ray], what: &str) {
    let expected = brute_force(triangles, rays);
    for (name, tree) in trees(triangles) {
        let mut first: Option<Vec<Hit>> = None;
        with_devices(|devices| {
            for (device_name, device) in devices {
                let before = device.memory().bytes;
                let hits = run(&mut **device, &tree, triangles, rays, Query::Closest);
                for (k, (hit, expected)) in answers(&hits).iter().zip(&expected).enumerate() {
                    assert_eq!(hit, expected, "{what}, {name}, {device_name}, ray {k}: {:?}", rays[k]);
                }
                let any = run(&mut **device, &tree, triangles, rays, Query::Any);
                for (k, (any, &(_, triangle))) in any.iter().zip(&expected).enumerate() {
                    let some = if triangle == NO_TRIANGLE { NO_TRIANGLE } else { SOME_TRIANGLE };
                    assert_eq!((any.t, any.triangle), (0.0, some), "{what}, {name}, {device_name}, ray {k}");
                    assert!(any.triangle_tests <= hits[k].triangle_tests.max(1) || some == SOME_TRIANGLE);
                }
                let both = [hits, any].concat();
                // The costs too are the same everywhere.
                assert!(*first.get_or_insert_with(|| both.clone()) == both, "{what}, {name}, {device_name}");
                assert_eq!(device.memory().bytes, before);
            }
        });
    }
}

#[test]
fn random_soups() {
    for (count, size, seed) in [(1, 0.5, 1), (2, 0.5, 2), (7, 0.8, 3), (400, 0.3, 4), (2000, 0.05, 5)] {
        let triangles = soup(count, size, seed);
        check(&triangles, &rays(&triangles, 1500, seed), &format!("soup of {count}"));
    }
}

#[test]
fn the_built_in_scene() {
    let scene = built_in(3000);
    let scaled = |p: [f32; 3]| p.map(|x| x / 32.0);
    let triangles: Vec<Triangle> =
        scene.triangles.iter().map(|t| Triangle { a: scaled(t.a), b: scaled(t.b), c: scaled(t.c) }).collect();
    check(&triangles, &rays(&triangles, 2000, 6), "built-in");
}

/// Two triangles for each square of a wall at x = 0.5, on a grid whose numbers have few digits.
fn wall(squares: usize) -> Vec<Triangle> {
    let at = |j: usize, k: usize| [0.5, j as f32 / squares as f32, k as f32 / squares as f32];
    let square = |(j, k): (usize, usize)| {
        let lower = Triangle { a: at(j, k), b: at(j + 1, k), c: at(j + 1, k + 1) };
        [lower, Triangle { a: at(j, k), b: at(j + 1, k + 1), c: at(j, k + 1) }]
    };
    (0..squares).flat_map(|j| (0..squares).map(move |k| (j, k))).flat_map(square).collect()
}

#[test]
fn a_wall_has_no_holes_at_edges_and_corners() {
    let triangles = wall(8);
    let mut random = Random(3);
    let mut rays = Vec::new();
    for _ in 0..500 {
        let [j, k] = [1 + random.bits() % 7, 1 + random.bits() % 7].map(|x| x as f32 / 8.0);
        let free = random.unit() * 0.9 + 0.05;
        let origin = [-random.unit() - 0.1, random.unit(), random.unit()];
        for target in [[0.5, j, k], [0.5, j, free], [0.5, free, k], [0.5, free, free]] {
            rays.push(ray(origin, target));
            let straight = [origin[0], target[1], target[2]];
            rays.push(ray(straight, target));
        }
    }
    check(&triangles, &rays, "wall");
    assert!(brute_force(&triangles, &rays).iter().all(|hit| hit.1 != NO_TRIANGLE), "a ray went through the wall");
}

#[test]
fn rays_in_the_plane_of_a_wall_and_along_its_edges() {
    let triangles = wall(4);
    let mut rays = Vec::new();
    for k in 0..=8 {
        let at = k as f32 / 8.0;
        rays.push(ray([0.5, at, -1.0], [0.5, at, 2.0]));
        rays.push(ray([0.5, -1.0, at], [0.5, 2.0, at]));
        rays.push(ray([0.5, -1.0, at - 1.0], [0.5, 1.0, at + 1.0]));
        rays.push(ray([0.5, at, at], [1.5, at, at]));
    }
    check(&triangles, &rays, "in the plane");
}

#[test]
fn degenerate_and_coincident_triangles() {
    let mut triangles = soup(60, 0.5, 8);
    for k in 0..20 {
        let t = triangles[k];
        triangles.push(Triangle { a: t.a, b: t.a, c: t.a });
        triangles.push(Triangle { a: t.a, b: t.b, c: t.b });
        triangles.push(Triangle { a: t.a, b: t.b, c: [0, 1, 2].map(|k| 0.5 * (t.a[k] + t.b[k])) });
        // The same surface again, in another order of corners: the lower number wins.
        triangles.push(t);
        triangles.push(Triangle { a: t.b, b: t.c, c: t.a });
    }
    let rays = rays(&triangles, 2000, 9);
    check(&triangles, &rays, "degenerate");
    let twins = brute_force(&triangles, &rays).into_iter().filter(|hit| hit.1 < 20).count();
    assert!(twins > 50, "only {twins} rays hit a triangle with a twin");
}

#[test]
fn scenes_at_the_ends_of_f32() {
    for scale in [1e30f32, 1e-30, 1e-40] {
        let scaled = |p: [f32; 3]| p.map(|x| x * scale);
        let unscaled = soup(200, 0.3, 11);
        let triangles: Vec<Triangle> =
            unscaled.iter().map(|t| Triangle { a: scaled(t.a), b: scaled(t.b), c: scaled(t.c) }).collect();
        let rays: Vec<Ray> = rays(&unscaled, 500, 12)
            .into_iter()
            .map(|ray| Ray { origin: scaled(ray.origin), t_max: f32::INFINITY, t_min: 0.0, ..ray })
            .collect();
        let mut device = CpuDevice::new(2).unwrap();
        let tree = trees(&triangles).pop().unwrap().1;
        let mut scene = TraceScene::new(&mut device, &tree, &triangles, &STARTS.map(scaled)).unwrap();
        let (hits, _) = trace(&mut device, &mut scene, &rays, Query::Closest).unwrap();
        scene.free(&mut device);
        let hit = hits.iter().filter(|hit| hit.triangle != NO_TRIANGLE).count();
        assert!(hit > 250, "{hit} of 500 rays hit something at {scale:e}");
    }
}

/// A tree in which node `k` has triangle `k` and the rest below it, links only.
fn chain(triangles: &[Triangle]) -> Bvh {
    let n = triangles.len() as u32;
    let mut tree = prbvh_tests::oracle::NaiveTree {
        children: vec![Vec::new(); 2 * n as usize - 1],
        boxes: vec![triangles[0].aabb(); 2 * n as usize - 1],
        references: vec![0; n as usize - 1],
    };
    tree.references.extend(0..n);
    for p in 0..n - 1 {
        // The rest on the left and on the right in turn.
        let rest = if p + 2 < n { p + 1 } else { 2 * n - 2 };
        let leaf = n - 1 + p;
        tree.children[p as usize] = if p % 2 == 0 { vec![leaf, rest] } else { vec![rest, leaf] };
    }
    Bvh::from_device(&tree.encode()).unwrap()
}

#[test]
fn stacks_hold_trees_of_every_depth() {
    for depth in [1usize, 2, 31, 32, 33, 63, 64, 65, 127, 128, 129, 10_000, 60_000] {
        let triangles = soup(depth + 1, 0.4, depth as u64);
        let rays = rays(&triangles, if depth > 1000 { 40 } else { 200 }, 18);
        let expected = brute_force(&triangles, &rays);
        let tree = chain(&triangles);
        with_devices(|devices| {
            for (name, device) in devices {
                let mut scene = TraceScene::new(&mut **device, &tree, &triangles, &STARTS).unwrap();
                assert_eq!(scene.depth() as usize, depth);
                let (hits, _) = trace(&mut **device, &mut scene, &rays, Query::Closest).unwrap();
                assert_eq!(answers(&hits), expected, "depth {depth}, {name}");
                scene.free(&mut **device);
            }
        });
    }
}

#[test]
fn a_leaf_of_more_triangles_than_a_dispatch_has_steps() {
    let triangles: Vec<Triangle> = soup(8, 0.3, 19).into_iter().cycle().take(70_000).collect();
    let rays = rays(&triangles, 30, 20);
    let expected = brute_force(&triangles, &rays);
    let root = prbvh::bvh::BvhNode {
        aabb: triangles[0].aabb(),
        parent: prbvh::bvh::NO_NODE,
        content: prbvh::bvh::Content::Leaf { first: 0, count: 70_000 },
    };
    let tree = Bvh { nodes: vec![root], triangle_order: (0..70_000).rev().collect() };
    with_devices(|devices| {
        for (name, device) in devices {
            let mut scene = TraceScene::new(&mut **device, &tree, &triangles, &STARTS).unwrap();
            let (hits, _) = trace(&mut **device, &mut scene, &rays, Query::Closest).unwrap();
            assert!(scene.is_deep());
            assert_eq!(answers(&hits), expected, "{name}");
            assert!(hits.iter().all(|hit| hit.triangle_tests == 70_000));
            scene.free(&mut **device);
        }
    });
}

#[test]
fn a_box_that_is_too_small_is_noticed() {
    let triangles = wall(8);
    let rays: Vec<Ray> = (0..64)
        .map(|k| [0.5, (k / 8) as f32 / 8.0 + 0.001, (k % 8) as f32 / 8.0 + 0.001])
        .map(|target| ray([-1.0, target[1], target[2]], target))
        .collect();
    let expected = brute_force(&triangles, &rays);
    let tree = trees(&triangles).swap_remove(2).1;
    let mut device = CpuDevice::new(1).unwrap();
    let mut scene = TraceScene::new(&mut device, &tree, &triangles, &STARTS).unwrap();
    let nodes = scene.buffers()[0].clone();
    let mut whole: Vec<TraceNode> = vec![bytemuck::Zeroable::zeroed(); nodes.length];
    device.download(&nodes, bytemuck::cast_slice_mut(&mut whole)).unwrap();
    let mut noticed = 0;
    for v in 0..whole.len() {
        // One box of one node, its lower face moved inwards by two thousandths of the wall.
        let mut broken = whole.clone();
        broken[v].left_min[1] += scene.range().length(0.002);
        device.upload(&nodes, bytemuck::cast_slice(&broken)).unwrap();
        let (hits, _) = trace(&mut device, &mut scene, &rays, Query::Closest).unwrap();
        noticed += usize::from(answers(&hits) != expected);
    }
    assert!(noticed * 3 > whole.len(), "{noticed} of {} faults were noticed", whole.len());
    device.upload(&nodes, bytemuck::cast_slice(&whole)).unwrap();
    let (hits, _) = trace(&mut device, &mut scene, &rays, Query::Closest).unwrap();
    assert_eq!(answers(&hits), expected);
}

#[test]
fn bad_rays_and_trees_are_refused() {
    let triangles = soup(10, 0.3, 1);
    let mut device = CpuDevice::new(1).unwrap();
    let mut tree = trees(&triangles).swap_remove(1).1;
    let mut scene = TraceScene::new(&mut device, &tree, &triangles, &STARTS).unwrap();
    let good = ray([0.0; 3], [1.0; 3]);
    let bad = [
        Ray { origin: [f32::NAN, 0.0, 0.0], ..good },
        Ray { origin: [0.0, 5.0, 0.0], ..good },
        Ray { direction: [0.0; 3], ..good },
        Ray { direction: [f32::INFINITY, 0.0, 0.0], ..good },
        Ray { direction: [0.0, f32::NAN, 1.0], ..good },
        Ray { t_min: -1.0, ..good },
        Ray { t_max: f32::NAN, ..good },
    ];
    for ray in bad {
        let error = trace(&mut device, &mut scene, &[good, ray], Query::Closest).unwrap_err();
        assert!(matches!(error, TraceError::Ray { ray: 1, .. }), "{error}");
    }
    assert!(trace(&mut device, &mut scene, &[], Query::Any).unwrap().0.is_empty());
    // No part of a ray: no hit and no test.
    let (hits, _) = trace(&mut device, &mut scene, &[Ray { t_min: 2.0, t_max: 1.0, ..good }], Query::Closest).unwrap();
    assert_eq!(hits, [Hit { t: 0.0, triangle: NO_TRIANGLE, box_tests: 0, triangle_tests: 0 }]);
    scene.free(&mut device);
    // A tree of another scene.
    let error = TraceScene::new(&mut device, &tree, &triangles[..9], &STARTS).unwrap_err();
    assert!(matches!(error, TraceError::InvalidTree(_)), "{error}");
    tree.triangle_order[3] = tree.triangle_order[4];
    let error = TraceScene::new(&mut device, &tree, &triangles, &STARTS).unwrap_err();
    assert!(matches!(error, TraceError::InvalidTree(_)), "{error}");
    assert_eq!(device.memory().bytes, 0);
}

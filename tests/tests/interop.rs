//! Trees of other libraries, in and out: their validators accept them, and their traversals hit what ours hits.

use bvh::aabb::{Aabb as PeerAabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::Bvh as BvhCrate;
use glam::Vec3A;
use nalgebra::{Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::RayHit;
use prbvh::bvh::{Bvh, Content, TreeFault, tree_hash, validate};
use prbvh::device::cpu::CpuDevice;
use prbvh::interop::bvh::{ToBvhError, from_bvh, to_bvh};
use prbvh::interop::embree::{NodeRef, to_bvh4};
use prbvh::interop::obvhs::{from_bvh2, to_bvh2};
use prbvh::pipeline::{self, Leaves, Settings, optimize_tree};
use prbvh::scene::{Scene, Triangle};
use prbvh::trace::{NO_TRIANGLE, Query, Ray, TraceScene, trace};
use prbvh_kernel::ray::Prepared;
use prbvh_tests::bench::obvhs::triangles;
use prbvh_tests::fixtures::{Random, soup};
use prbvh_tests::rays::{STARTS, ray};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

const RAYS: usize = 10_000;

/// A soup with long slivers along the diagonal, which spatial splits cut.
fn scene() -> Scene {
    let mut triangles = soup(2_000, 0.08, 11);
    let mut random = Random(12);
    triangles.extend((0..40).map(|_| {
        let [a, to_b, to_c] = [random.point(0.3), random.point(0.1), random.point(0.1)];
        let from_a = |offset: [f32; 3]| [0, 1, 2].map(|k| a[k] + 0.6 + offset[k]);
        Triangle { a, b: from_a(to_b), c: from_a(to_c) }
    }));
    Scene::from_triangles("soup", triangles).unwrap()
}

/// From around the unit cube into it: most of them hit.
fn rays() -> Vec<Ray> {
    let mut random = Random(13);
    (0..RAYS).map(|_| ray(random.point(3.0).map(|x| x - 1.0), random.point(1.0))).collect()
}

/// Parameter of the hit, from either side; infinite if there is none. In f64: no ray of these comes so near to an edge that f32 decides
/// otherwise.
fn hit(ray: &Ray, t: &Triangle) -> f32 {
    let wide = |p: [f32; 3]| Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
    let (origin, direction) = (wide(ray.origin), wide(ray.direction));
    let (to_b, to_c, from_a) = (wide(t.b) - wide(t.a), wide(t.c) - wide(t.a), origin - wide(t.a));
    let normal = direction.cross(&to_c);
    let scale = 1.0 / to_b.dot(&normal);
    let u = from_a.dot(&normal) * scale;
    let across = from_a.cross(&to_b);
    let v = direction.dot(&across) * scale;
    let along = to_c.dot(&across) * scale;
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && along >= 0.0 { along as f32 } else { f32::INFINITY }
}

/// The nearest of some triangles.
fn nearest(ray: &Ray, scene: &Scene, candidates: impl Iterator<Item = u32>) -> u32 {
    let hits = candidates.map(|k| (hit(ray, &scene.triangles[k as usize]), k));
    let best = hits.min_by(|a, b| a.partial_cmp(b).unwrap());
    best.filter(|(t, _)| t.is_finite()).map_or(NO_TRIANGLE, |(_, k)| k)
}

fn hits_without_a_tree(scene: &Scene, rays: &[Ray]) -> Vec<u32> {
    rays.iter().map(|ray| nearest(ray, scene, 0..scene.triangles.len() as u32)).collect()
}

fn hits_of_ours(tree: &Bvh, scene: &Scene, rays: &[Ray]) -> Vec<u32> {
    let mut device = CpuDevice::new(0).unwrap();
    let mut traced = TraceScene::new(&mut device, tree, &scene.triangles, &STARTS).unwrap();
    let (hits, _) = trace(&mut device, &mut traced, rays, Query::Closest).unwrap();
    hits.iter().map(|hit| hit.triangle).collect()
}

fn hits_of_obvhs(tree: &Bvh2, scene: &Scene, rays: &[Ray]) -> Vec<u32> {
    let one = |ray: &Ray| {
        let peer = obvhs::ray::Ray::new_inf(Vec3A::from_array(ray.origin), Vec3A::from_array(ray.direction));
        let mut found = RayHit::none();
        let triangle = |position: usize| tree.primitive_indices[position];
        tree.ray_traverse(peer, &mut found, |_, position| hit(ray, &scene.triangles[triangle(position) as usize]));
        if found.t.is_finite() { triangle(found.primitive_id as usize) } else { NO_TRIANGLE }
    };
    rays.iter().map(one).collect()
}

#[derive(Clone, Copy)]
struct Shape {
    triangle: Triangle,
    id: u32,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> PeerAabb<f32, 3> {
        let aabb = self.triangle.aabb();
        PeerAabb::with_bounds(aabb.min.into(), aabb.max.into())
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

fn shapes(scene: &Scene) -> Vec<Shape> {
    (0..).zip(&scene.triangles).map(|(id, &triangle)| Shape { triangle, id, node: usize::MAX }).collect()
}

fn hits_of_bvh_crate(tree: &BvhCrate<f32, 3>, shapes: &[Shape], scene: &Scene, rays: &[Ray]) -> Vec<u32> {
    let one = |ray: &Ray| {
        let peer = bvh::ray::Ray::new(Point3::from(ray.origin), Vector3::from(ray.direction));
        nearest(ray, scene, tree.traverse(&peer, shapes).into_iter().map(|shape| shape.id))
    };
    rays.iter().map(one).collect()
}

fn most_hit(hits: &[u32]) {
    let count = hits.iter().filter(|&&triangle| triangle != NO_TRIANGLE).count();
    assert!(hits.len() == RAYS && count > RAYS / 2, "{count} of {} rays hit", hits.len());
}

fn optimized(scene: &Scene) -> Bvh {
    let mut device = CpuDevice::new(0).unwrap();
    let done = pipeline::optimize(scene, &mut device, &Settings::default(), &mut |_| ControlFlow::Continue(()));
    done.unwrap().tree
}

#[test]
fn a_tree_of_ours_is_a_tree_of_obvhs() {
    let (scene, rays) = (scene(), rays());
    let tree = optimized(&scene);
    let theirs = to_bvh2(&tree);
    let counted = theirs.validate(&triangles(&scene), false, true);
    assert_eq!((counted.node_count, counted.prim_count), (tree.nodes.len(), scene.triangles.len()));
    assert!(!theirs.uses_spatial_splits);
    assert_eq!(tree_hash(&from_bvh2(&theirs).unwrap()), tree_hash(&tree));
    let hits = hits_of_ours(&tree, &scene, &rays);
    most_hit(&hits);
    assert_eq!(hits_without_a_tree(&scene, &rays), hits);
    assert_eq!(hits_of_obvhs(&theirs, &scene, &rays), hits);
}

#[test]
fn default_leaves_of_obvhs_come_in_and_go_out() {
    let (scene, rays) = (scene(), rays());
    let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
    let theirs = build_bvh2_from_tris(&triangles(&scene), params, &mut Duration::default());
    let tree = from_bvh2(&theirs).unwrap();
    let leaves = tree.nodes.iter().filter(|node| matches!(node.content, Content::Leaf { count: 2.., .. })).count();
    assert!(leaves > 0, "no leaf of several triangles");
    validate(&tree, Some(&scene.triangles)).unwrap();
    let hits = hits_of_ours(&tree, &scene, &rays);
    most_hit(&hits);
    assert_eq!(hits_of_obvhs(&theirs, &scene, &rays), hits);
    let back = to_bvh2(&tree);
    back.validate(&triangles(&scene), false, true);
    assert_eq!(hits_of_obvhs(&back, &scene, &rays), hits);
}

#[test]
fn spatial_splits_of_obvhs_come_in_and_go_out() {
    let (scene, rays) = (scene(), rays());
    let params = BvhBuildParams { pre_split: true, ..BvhBuildParams::medium_build() };
    let theirs = build_bvh2_from_tris(&triangles(&scene), params, &mut Duration::default());
    assert!(theirs.uses_spatial_splits);
    let tree = from_bvh2(&theirs).unwrap();
    // One triangle in several leaves is the only thing that is wrong with it.
    let faults = prbvh::bvh::links_and_leaves(&tree, scene.triangles.len());
    let others: Vec<_> = faults.iter().filter(|fault| !matches!(fault, TreeFault::TriangleTwice { .. })).collect();
    assert!(others.is_empty() && !faults.is_empty(), "{} faults, others than that: {others:?}", faults.len());
    let back = to_bvh2(&tree);
    assert!(back.uses_spatial_splits && back.nodes.len() == theirs.nodes.len());
    back.validate(&triangles(&scene), false, true);
    let hits = hits_of_obvhs(&back, &scene, &rays);
    assert_eq!(hits, hits_without_a_tree(&scene, &rays));
    assert_eq!(hits, hits_of_obvhs(&theirs, &scene, &rays));
    let twice = to_bvh(&tree, &mut shapes(&scene)).unwrap_err();
    assert!(matches!(twice, ToBvhError::Twice { .. }), "{twice}");
}

#[test]
fn primitives_that_obvhs_removed_are_not_in_the_tree() {
    let scene = scene();
    let mut theirs = build_bvh2_from_tris(&triangles(&scene), BvhBuildParams::fast_build(), &mut Duration::default());
    for triangle in [7, 100, 1_000] {
        theirs.remove_primitive(triangle);
    }
    let tree = from_bvh2(&theirs).unwrap();
    assert_eq!(tree.triangle_order.len(), scene.triangles.len() - 3);
    assert!(!tree.triangle_order.contains(&100));
}

#[test]
fn trees_of_the_crate_bvh_come_in_and_go_out() {
    let (scene, rays) = (scene(), rays());
    let mut shapes = shapes(&scene);
    let theirs = BvhCrate::build_par(&mut shapes);
    let tree = from_bvh(&theirs).unwrap();
    validate(&tree, Some(&scene.triangles)).unwrap();
    let hits = hits_of_ours(&tree, &scene, &rays);
    most_hit(&hits);
    assert_eq!(hits_of_bvh_crate(&theirs, &shapes, &scene, &rays), hits);

    // Back, and a tree of ours, and one whose leaves hold several.
    let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
    let with_leaves = from_bvh2(&build_bvh2_from_tris(&triangles(&scene), params, &mut Duration::default())).unwrap();
    for ours in [tree, optimized(&scene), with_leaves] {
        shapes.iter_mut().for_each(|shape| shape.node = usize::MAX);
        let out = to_bvh(&ours, &mut shapes).unwrap();
        assert_eq!(out.nodes.len(), 2 * scene.triangles.len() - 1);
        out.assert_consistent(&shapes);
        out.assert_tight();
        for shape in &shapes {
            assert_eq!(out.nodes[shape.node].shape_index(), Some(shape.id as usize));
        }
        assert_eq!(hits_of_bvh_crate(&out, &shapes, &scene, &rays), hits);
    }
}

/// In, optimised with leaves whole or made anew, and out: their validators accept it, and rays hit what they hit without a tree.
#[test]
fn trees_of_others_are_optimised_in_between() {
    let (scene, rays) = (scene(), rays());
    let hits = hits_without_a_tree(&scene, &rays);
    most_hit(&hits);
    let boxes = scene.boxes();
    let mut device = CpuDevice::new(0).unwrap();
    let mut better = |tree: &Bvh, leaves: Leaves<'_>| {
        let mut tree = tree.clone();
        let go_on = &mut |_: &_| ControlFlow::Continue(());
        let done = optimize_tree(&mut tree, leaves, &mut device, &Settings::default(), go_on).unwrap();
        assert!(done.quality.sah_cost < done.initial.sah_cost, "{leaves:?}");
        tree
    };
    for pre_split in [false, true] {
        let params = BvhBuildParams { pre_split, ..BvhBuildParams::medium_build() };
        let theirs = build_bvh2_from_tris(&triangles(&scene), params, &mut Duration::default());
        let tree = from_bvh2(&theirs).unwrap();
        for leaves in [Leaves::Whole, Leaves::Split(&boxes)] {
            let back = to_bvh2(&better(&tree, leaves));
            assert_eq!(back.uses_spatial_splits, pre_split);
            back.validate(&triangles(&scene), false, true);
            assert_eq!(hits_of_obvhs(&back, &scene, &rays), hits, "{pre_split} {leaves:?}");
        }
    }
    let mut shapes = shapes(&scene);
    let tree = from_bvh(&BvhCrate::build_par(&mut shapes)).unwrap();
    let back = to_bvh(&better(&tree, Leaves::Split(&boxes)), &mut shapes).unwrap();
    back.assert_consistent(&shapes);
    back.assert_tight();
    assert_eq!(hits_of_bvh_crate(&back, &shapes, &scene, &rays), hits);
}

#[test]
fn the_smallest_trees_come_in_and_go_out() {
    for n in [1, 2] {
        let scene = Scene::from_triangles("few", soup(n, 0.5, 3)).unwrap();
        let tree = optimized(&scene);
        assert_eq!(tree_hash(&from_bvh2(&to_bvh2(&tree)).unwrap()), tree_hash(&tree));
        let mut shapes = shapes(&scene);
        let out = to_bvh(&tree, &mut shapes).unwrap();
        out.assert_consistent(&shapes);
        let back = from_bvh(&out).unwrap().with_boxes_of(&scene.triangles);
        assert_eq!(tree_hash(&back), tree_hash(&tree));
        let error = to_bvh(&tree, &mut shapes[..n - 1]).unwrap_err();
        assert!(matches!(error, ToBvhError::NoShape { .. }), "{error}");
    }
    assert_eq!(from_bvh2(&Bvh2::default()).unwrap_err(), [TreeFault::NodeCount { nodes: 0 }]);
    assert_eq!(from_bvh(&BvhCrate { nodes: Vec::new() }).unwrap_err(), [TreeFault::NodeCount { nodes: 0 }]);
}

#[test]
fn nodes_of_embree_lead_to_the_same_hits() {
    let (scene, rays) = (scene(), rays());
    let tree = optimized(&scene);
    // A block of 16 bytes for each position of the triangle order, the nodes behind them.
    let nodes_at = 16 * tree.triangle_order.len() as u64;
    let leaf = |first: u32, count: u32| NodeRef::leaf(16 * u64::from(first), count);
    let (root, nodes) = to_bvh4(&tree, nodes_at, leaf).unwrap();
    let one = |ray: &Ray| {
        let prepared = Prepared::new(ray);
        let (mut candidates, mut stack) = (Vec::new(), vec![root]);
        while let Some(at) = stack.pop() {
            if let Some((address, blocks)) = at.as_leaf() {
                candidates.extend_from_slice(&tree.triangle_order[address as usize / 16..][..blocks as usize]);
                continue;
            }
            let node = nodes[(at.0 - nodes_at) as usize / 128];
            stack.extend(
                (0..4).filter(|&k| prepared.enters(&node.aabb(k), f32::MAX).is_finite()).map(|k| node.children[k]),
            );
        }
        nearest(ray, &scene, candidates.into_iter())
    };
    let hits: Vec<u32> = rays.iter().map(one).collect();
    most_hit(&hits);
    assert_eq!(hits, hits_of_ours(&tree, &scene, &rays));
}

#[test]
fn planted_faults_do_not_get_through() {
    let (scene, rays) = (scene(), rays());
    let tree = optimized(&scene);
    let hits = hits_of_ours(&tree, &scene, &rays);

    // Two triangles change places: their boxes do not hold them.
    let mut swapped = tree.clone();
    swapped.triangle_order.swap(0, scene.triangles.len() / 2);
    let theirs = to_bvh2(&swapped);
    let validated = || catch_unwind(AssertUnwindSafe(|| theirs.validate(&triangles(&scene), false, true)));
    assert!(validated().is_err());
    assert_ne!(hits_of_obvhs(&theirs, &scene, &rays), hits);
    let mut shapes = shapes(&scene);
    let out = to_bvh(&swapped, &mut shapes).unwrap();
    assert!(!out.is_consistent(&shapes));
    assert_ne!(hits_of_bvh_crate(&out, &shapes, &scene, &rays), hits);

    // A link to the wrong node.
    let mut broken = to_bvh2(&tree);
    let internal = (1..broken.nodes.len()).rfind(|&v| broken.nodes[v].prim_count == 0).unwrap();
    broken.nodes[internal].first_index = 1;
    assert!(from_bvh2(&broken).unwrap_err().iter().any(|fault| matches!(fault, TreeFault::Shared { .. })));
    let mut broken = out;
    *broken.nodes[0].child_l_mut() = usize::MAX;
    assert!(from_bvh(&broken).unwrap_err().iter().any(|fault| matches!(fault, TreeFault::LinkOutOfRange { .. })));
}

//! End-point overlap by hand, against brute force, at the ends of f32, and from a sample.

use super::super::clip::clipped_area;
use super::super::testing::{Rng, device_tree, renumbered, tree};
use super::super::{BvhNode, Content, NO_NODE, ROOT};
use super::sample::{LEAST_STRATA, Sample, estimate};
use super::*;
use prbvh_kernel::aabb::Aabb;
use proptest::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The overlap where it is exact.
fn value(tree: &Bvh, triangles: &[Triangle], model: &SahModel) -> f64 {
    let epo = epo(tree, triangles, model);
    assert!(epo.is_exact() && epo.error == 0.0, "{epo:?}");
    epo.value
}

/// A root with a leaf per list of triangles; a tree of two leaves only.
fn two_leaves(triangles: &[Triangle], left: &[u32], right: &[u32]) -> Bvh {
    let aabb = |ids: &[u32]| ids.iter().map(|&t| triangles[t as usize].aabb()).fold(Aabb::EMPTY, Aabb::union);
    let leaf = |ids: &[u32], first: usize| BvhNode {
        aabb: aabb(ids),
        parent: ROOT,
        content: Content::Leaf { first: first as u32, count: ids.len() as u32 },
    };
    let (a, b) = (leaf(left, 0), leaf(right, left.len()));
    let root =
        BvhNode { aabb: a.aabb.union(b.aabb), parent: NO_NODE, content: Content::Internal { left: 1, right: 2 } };
    Bvh { nodes: vec![root, a, b], triangle_order: [left, right].concat() }
}

/// A right triangle in the plane z, with legs of `size` from (x, y).
fn flat(x: f32, y: f32, z: f32, size: f32) -> Triangle {
    Triangle { a: [x, y, z], b: [x + size, y, z], c: [x, y + size, z] }
}

const MODEL: SahModel = SahModel { c_traversal: 3.0, c_intersect: 2.0 };

#[test]
fn leaves_apart_overlap_nothing() {
    let triangles = [flat(0.0, 0.0, 0.0, 1.0), flat(5.0, 0.0, 0.0, 1.0)];
    assert_eq!(value(&two_leaves(&triangles, &[0], &[1]), &triangles, &MODEL), 0.0);
}

#[test]
fn overlap_by_hand() {
    // The box of the small one, [1, 2]², cuts a triangle of legs 1 out of the large one's [0, 4]² (x + y <= 3 in [1, 2]²), area 1/2;
    // the small one, area 1/2, lies inside the large one's box. Areas: 9/2 and 1/2.
    let triangles = [flat(0.0, 0.0, 0.0, 3.0), flat(1.0, 1.0, 0.0, 1.0)];
    let both = 2.0 * (0.5 + 0.5) / 5.0;
    assert!((value(&two_leaves(&triangles, &[0], &[1]), &triangles, &MODEL) - both).abs() < 1e-15);
    // Three triangles: the leaf of two costs twice as much.
    let triangles = [triangles[0], triangles[1], flat(1.0, 1.0, 0.0, 1.0)];
    let expected = (2.0 * (0.5 + 0.5) + 4.0 * 0.5) / 5.5;
    assert!((value(&two_leaves(&triangles, &[0], &[1, 2]), &triangles, &MODEL) - expected).abs() < 1e-15);
    let other = SahModel { c_traversal: 100.0, c_intersect: 1.0 };
    assert!((value(&two_leaves(&triangles, &[0], &[1, 2]), &triangles, &other) - expected / 2.0).abs() < 1e-15);
}

#[test]
fn a_node_holds_the_pieces_in_it_and_no_others() {
    // The large one, area 8, in two at x = 2: 6 in [0, 2] × [0, 4] and 2 in [2, 4] × [0, 2]. Beside the first hangs the small one, whose box is [2, 3] × [0, 1].
    let triangles = [flat(0.0, 0.0, 0.0, 4.0), flat(2.0, 0.0, 0.0, 1.0)];
    let slab = |from: [f32; 2], to: [f32; 2]| Aabb { min: [from[0], from[1], 0.0], max: [to[0], to[1], 0.0] };
    let leaf = |aabb, parent, first| BvhNode { aabb, parent, content: Content::Leaf { first, count: 1 } };
    let internal = |aabb, parent, left| BvhNode { aabb, parent, content: Content::Internal { left, right: left + 1 } };
    let nodes = vec![
        internal(slab([0.0, 0.0], [4.0, 4.0]), NO_NODE, 1),
        internal(slab([0.0, 0.0], [3.0, 4.0]), ROOT, 3),
        leaf(slab([2.0, 0.0], [4.0, 2.0]), ROOT, 2),
        leaf(slab([0.0, 0.0], [2.0, 4.0]), 1, 0),
        leaf(slab([2.0, 0.0], [3.0, 1.0]), 1, 1),
    ];
    let tree = Bvh { nodes, triangle_order: vec![0, 1, 0] };
    // 3/2 of the second piece lies in the node above the first two leaves, 1 in the small one's leaf, and the small one in the second piece's.
    let expected = (3.0 * 1.5 + 2.0 * 1.0 + 2.0 * 0.5) / 8.5;
    assert!((value(&tree, &triangles, &MODEL) - expected).abs() < 1e-12);
}

#[test]
fn a_slanted_triangle_by_hand() {
    // x + y + z = 1 in the unit cube has area √3/2; the box [0, 1/2]³ cuts its three tips off, each a quarter of the length: 1/4 is left.
    let slanted = Triangle { a: [1.0, 0.0, 0.0], b: [0.0, 1.0, 0.0], c: [0.0, 0.0, 1.0] };
    let area = 3f64.sqrt() / 2.0;
    assert!((clipped_area(&corners(&slanted), &[0.0; 3], &[0.5; 3]) - area / 4.0).abs() < 1e-15);
    // A cube around the middle cuts a hexagon: side √2/6, area 3√3/2 side².
    let (min, max) = ([1.0 / 3.0 - 1.0 / 6.0; 3], [1.0 / 3.0 + 1.0 / 6.0; 3]);
    let hexagon = 1.5 * 3f64.sqrt() * (2f64.sqrt() / 6.0).powi(2);
    assert!((clipped_area(&corners(&slanted), &min, &max) - hexagon).abs() < 1e-15);
    assert!((clipped_area(&corners(&slanted), &[-1.0; 3], &[2.0; 3]) - area).abs() < 1e-15);
    assert_eq!(clipped_area(&corners(&slanted), &[0.6; 3], &[2.0; 3]), 0.0);
}

#[test]
fn a_triangle_in_a_face_is_inside() {
    // The box of the second, z from 0 to 1, has the first one in its lower face.
    let triangles = [flat(0.0, 0.0, 0.0, 1.0), Triangle { a: [0.0, 0.0, 0.0], b: [1.0, 0.0, 1.0], c: [1.0, 1.0, 1.0] }];
    let areas = triangles.map(|t| polygon_area(&corners(&t)));
    let expected = 2.0 * areas[0] / (areas[0] + areas[1]);
    assert!((value(&two_leaves(&triangles, &[0], &[1]), &triangles, &MODEL) - expected).abs() < 1e-15);
}

#[test]
fn threads_do_not_change_a_bit() {
    let (triangles, tree) = tree(3 * CHUNK + 7, 11);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| value(&tree, &triangles, &MODEL))
    });
    assert_eq!(one, three);
}

/// `n` long thin triangles from one face of the unit cube to the opposite one.
fn diagonals(n: usize, seed: u64) -> (Vec<Triangle>, Bvh) {
    let mut rng = Rng::new(seed);
    let mut unit = || rng.below(1 << 20) as f32 / (1 << 20) as f32;
    let mut diagonal = |_| {
        let (a, b) = ([unit(), unit(), 0.0], [unit(), unit(), 1.0]);
        Triangle { a, b, c: [b[0] + 1e-3, b[1], b[2]] }
    };
    let triangles: Vec<Triangle> = (0..n).map(&mut diagonal).collect();
    let tree = Bvh::from_device(&crate::build::sah_binned(&triangles)).unwrap();
    (triangles, tree)
}

fn within(tree: &Bvh, triangles: &[Triangle], budget: u64) -> Epo {
    epo_watched(tree, triangles, &MODEL, budget, &|_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn it_is_exact_up_to_the_budget_and_estimated_beyond() {
    let (triangles, tree) = diagonals(1000, 1);
    let exact = epo(&tree, &triangles, &MODEL);
    assert!(exact.is_exact() && exact.tests > 500 * 1000, "{exact:?}");
    assert_eq!(within(&tree, &triangles, exact.tests), exact);
    let first = within(&tree, &triangles, exact.tests - 1);
    assert!(first.drawn >= 2 * LEAST_STRATA as u32 && first.error > 0.0, "{first:?}");
    assert!((first.value - exact.value).abs() <= first.error, "{first:?}, {exact:?}");
    // The same on any number of threads and however the nodes are numbered.
    let renumbered = renumbered(&tree, &mut Rng::new(2));
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let other = pool.install(|| within(&renumbered, &triangles, exact.tests - 1));
        assert_eq!(other, first, "{threads} threads");
    }
}

#[test]
fn intervals_cover_the_exact_value_and_no_other() {
    let (triangles, tree) = diagonals(400, 3);
    // Among triangles of all kinds, and with copies.
    let mut mixed: Vec<Triangle> = triangles.iter().copied().chain(Rng::new(4).triangles(600)).collect();
    mixed.extend_from_within(..50);
    let mixed_tree = Bvh::from_device(&crate::build::sah_binned(&mixed)).unwrap();
    for (triangles, tree) in [(&triangles, &tree), (&mixed, &mixed_tree)] {
        let exact = value(tree, triangles, &MODEL);
        let walk = Walk::new(tree, triangles.len(), &MODEL);
        let mut groups = groups(triangles, &walk);
        groups.sort_unstable_by_key(|group| group.held.ranks[0]);
        let sample = Sample::new(&walk, &groups);
        let watch = Watch::new(u64::MAX, &|_| ControlFlow::Continue(()));
        let estimates: Vec<[f64; 2]> =
            (0..100).map(|seed| estimate(&sample.draw(LEAST_STRATA, seed, &watch).unwrap())).collect();
        let covering = |value: f64| estimates.iter().filter(|[mean, error]| (mean - value).abs() <= *error).count();
        assert!((88..=100).contains(&covering(exact)), "{} of 100 cover {exact}", covering(exact));
        // An estimate that is off by a fifth would be noticed.
        assert!(covering(1.2 * exact) < 20 && covering(0.8 * exact) < 20, "{estimates:?}");
        let mean = estimates.iter().map(|[mean, _]| mean).sum::<f64>() / 100.0;
        assert!((mean / exact - 1.0).abs() < 0.02, "{mean} on average, {exact} is right");
    }
}

#[test]
fn twenty_thousand_diagonals_end_in_bounded_work() {
    let n = 20_000;
    let (triangles, tree) = diagonals(n, 5);
    let most = AtomicU64::new(0);
    let budget = epo_budget(n);
    assert!(budget < 70 * 15 * n as u64);
    let calls = AtomicU64::new(0);
    let observe = |progress: EpoProgress| {
        calls.fetch_add(1, Relaxed);
        assert!(progress.done <= progress.of);
        if !progress.is_sampled {
            most.fetch_max(progress.done, Relaxed);
        }
        ControlFlow::Continue(())
    };
    let epo = epo_watched(&tree, &triangles, &MODEL, budget, &observe).unwrap();
    // All pairs would be 800 million. A walk is 40,000 tests at most, so the sample takes so many more.
    assert!(!epo.is_exact() && epo.tests < 2 * budget, "{epo:?}");
    assert!(calls.load(Relaxed) > 100 && most.load(Relaxed) < n as u64 / 10, "{calls:?} calls, {most:?} triangles");
    assert!(epo.error < 0.1 * epo.value, "{epo:?}");
}

#[test]
fn it_can_be_cancelled_at_any_time() {
    let (triangles, tree) = diagonals(2000, 6);
    for (is_sampled, budget) in [(false, u64::MAX), (true, 1)] {
        let observe = |progress: EpoProgress| {
            if progress.is_sampled == is_sampled { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        assert_eq!(epo_watched(&tree, &triangles, &MODEL, budget, &observe), None, "{is_sampled}");
    }
}

#[test]
fn nothing_of_no_area_counts() {
    let point = Triangle { a: [1.0; 3], b: [1.0; 3], c: [1.0; 3] };
    assert_eq!(value(&two_leaves(&[point; 2], &[0], &[1]), &[point; 2], &MODEL), 0.0);
    let (triangles, tree) = tree(1, 3);
    assert_eq!(value(&tree, &triangles, &MODEL), 0.0);
}

#[test]
fn scale_does_not_matter() {
    let (triangles, nodes) = device_tree(60, &mut Rng::new(5));
    let at = |scale: f32| {
        let work = |p: [f32; 3]| p.map(|x| x * scale);
        let triangles: Vec<_> =
            triangles.iter().map(|t| Triangle { a: work(t.a), b: work(t.b), c: work(t.c) }).collect();
        let tree = Bvh::from_device(&nodes).unwrap().with_boxes_of(&triangles);
        value(&tree, &triangles, &MODEL)
    };
    let expected = at(1.0);
    assert!(expected > 1.0);
    for exponent in [-100, -20, 20, 100, 126] {
        assert_eq!(at(2f32.powi(exponent)), expected, "2^{exponent}");
    }
    // Coordinates of 2^-149 units: not the same triangles any more, but a number.
    let tiny = at(2f32.powi(-146));
    assert!(tiny.is_finite() && tiny > 0.0, "{tiny}");
    let huge = at(f32::MAX);
    assert!((huge / expected - 1.0).abs() < 1e-6, "{huge} instead of {expected}");
}

/// Every triangle against every node; which nodes hold it is found by climbing from its leaf.
fn naive(tree: &Bvh, triangles: &[Triangle], model: &SahModel) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (id, triangle) in triangles.iter().enumerate() {
        let corners = corners(triangle);
        total += polygon_area(&corners);
        let mut holders = vec![false; tree.nodes.len()];
        for (v, node) in tree.nodes.iter().enumerate() {
            if let Content::Leaf { first, count } = node.content
                && tree.triangles_of(first, count).contains(&(id as u32))
            {
                let mut v = v as u32;
                while v != NO_NODE {
                    holders[v as usize] = true;
                    v = tree.nodes[v as usize].parent;
                }
            }
        }
        for (node, holds) in tree.nodes.iter().zip(holders) {
            let cost = match node.content {
                Content::Internal { .. } => model.c_traversal,
                Content::Leaf { count, .. } => model.c_intersect * f64::from(count),
            };
            if !holds {
                sum += cost * naive_area(&corners, &node.aabb);
            }
        }
    }
    if total > 0.0 { sum / total } else { 0.0 }
}

/// Area inside a box by cutting triangles into triangles, plane by plane.
fn naive_area(corners: &[[f64; 3]; 3], aabb: &Aabb) -> f64 {
    let mut parts = vec![*corners];
    for axis in 0..3 {
        for (plane, sign) in [(f64::from(aabb.min[axis]), 1.0), (f64::from(aabb.max[axis]), -1.0)] {
            let inside = |p: &[f64; 3]| (p[axis] - plane) * sign >= 0.0;
            let cut = |p: [f64; 3], q: [f64; 3]| {
                let t = (plane - p[axis]) / (q[axis] - p[axis]);
                // Exact where both are the same: a triangle in a face must not leave it.
                let mut at = [0, 1, 2].map(|k| p[k] + t * (q[k] - p[k]));
                at[axis] = plane;
                at
            };
            let mut kept = Vec::new();
            for mut part in parts {
                match part.iter().filter(|p| inside(p)).count() {
                    3 => kept.push(part),
                    0 => {}
                    1 => {
                        let k = part.iter().position(&inside).unwrap();
                        part.rotate_left(k);
                        let [p, q, r] = part;
                        kept.push([p, cut(p, q), cut(p, r)]);
                    }
                    _ => {
                        let k = part.iter().position(|p| !inside(p)).unwrap();
                        part.rotate_left(k);
                        let [out, q, r] = part;
                        kept.push([q, r, cut(q, out)]);
                        kept.push([r, cut(r, out), cut(q, out)]);
                    }
                }
            }
            parts = kept;
        }
    }
    parts.iter().map(|part| polygon_area(part)).sum()
}

/// Small integer coordinates: flat, shared, coincident and degenerate in every way.
fn on_a_grid(n: usize, rng: &mut Rng) -> (Vec<Triangle>, Bvh) {
    let (_, nodes) = device_tree(n, rng);
    let mut point = || [(); 3].map(|()| rng.below(4) as f32);
    let triangles: Vec<_> = (0..n).map(|_| Triangle { a: point(), b: point(), c: point() }).collect();
    let tree = Bvh::from_device(&nodes).unwrap().with_boxes_of(&triangles);
    (triangles, tree)
}

proptest! {
    #[test]
    fn it_is_what_brute_force_finds(n in 1usize..40, seed: u64, grid: bool) {
        let (triangles, tree) = if grid { on_a_grid(n, &mut Rng::new(seed)) } else { tree(n, seed) };
        let (have, need) = (value(&tree, &triangles, &MODEL), naive(&tree, &triangles, &MODEL));
        prop_assert!((have - need).abs() <= 1e-12 * need.max(1.0), "{have} instead of {need}");
    }

    #[test]
    fn copies_share_a_walk_and_count_each(n in 2usize..40, distinct in 1usize..4, seed: u64) {
        let mut rng = Rng::new(seed);
        let (mut triangles, _) = on_a_grid(n, &mut rng);
        (distinct.min(n)..n).for_each(|k| triangles[k] = triangles[k % distinct.min(n)]);
        let (_, nodes) = device_tree(n, &mut rng);
        let tree = Bvh::from_device(&nodes).unwrap().with_boxes_of(&triangles);
        let (have, need) = (value(&tree, &triangles, &MODEL), naive(&tree, &triangles, &MODEL));
        prop_assert!((have - need).abs() <= 1e-12 * need.max(1.0), "{have} instead of {need}");
    }

    #[test]
    fn numbering_and_threads_do_not_change_a_bit(n in 1usize..60, seed: u64) {
        let (triangles, tree) = tree(n, seed);
        let before = value(&tree, &triangles, &MODEL);
        prop_assert_eq!(before, value(&renumbered(&tree, &mut Rng::new(seed)), &triangles, &MODEL));
    }

    #[test]
    fn a_planted_swap_of_two_triangles_is_seen(n in 3usize..40, seed: u64) {
        // The boxes stay, two triangles change places: neither lies where its leaf is.
        let (triangles, mut tree) = tree(n, seed);
        let before = value(&tree, &triangles, &MODEL);
        tree.triangle_order.swap(0, 1);
        let area = |t: u32| polygon_area(&corners(&triangles[t as usize]));
        prop_assume!(tree.triangle_order[..2].iter().all(|&t| area(t) > 1e-3));
        prop_assert_ne!(before, value(&tree, &triangles, &MODEL));
    }
}

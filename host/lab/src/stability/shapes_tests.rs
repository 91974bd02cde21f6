//! Each generator makes what it is named for.

use super::*;
use prbvh::build::{self, MortonBits, lbvh};
use prbvh::bvh::{Bvh, BvhNode, Content, NO_NODE, SahModel, quality};
use prbvh::device::cpu::CpuDevice;
use prbvh::scene::{Census, SafeRange, Scene};
use prbvh_kernel::aabb::Aabb;

fn coordinates(triangles: &[Triangle]) -> &[f32] {
    bytemuck::cast_slice(triangles)
}

/// Edge lengths in ascending order, and twice the area.
fn edges_and_area(t: &Triangle) -> ([f64; 3], f64) {
    let minus = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|k| f64::from(a[k]) - f64::from(b[k]));
    let length = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let (u, v) = (minus(t.b, t.a), minus(t.c, t.a));
    let mut edges = [length(u), length(v), length(minus(t.c, t.b))];
    edges.sort_by(f64::total_cmp);
    let cross = [0, 1, 2].map(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]);
    (edges, length(cross))
}

#[test]
fn slender_triangles_have_the_aspect() {
    for (triangles, is_needle) in [(needles(200, 1e8), true), (slivers(200, 1e8), false)] {
        let mut axes = [0; 3];
        for t in &triangles {
            let (edges, area) = edges_and_area(t);
            assert!(area > 0.0 && edges[2] * edges[2] / area >= 1e8, "{t:?}");
            assert_eq!(edges[0] < 1e-3 * edges[2], is_needle, "{t:?}");
            let aabb = t.aabb();
            axes[[0, 1, 2].into_iter().find(|&k| aabb.max[k] - aabb.min[k] > 1.0).unwrap()] += 1;
        }
        assert!(axes.iter().all(|&count| count > 60), "{axes:?}");
    }
}

#[test]
fn scales_reach_into_and_beyond_what_areas_can_be() {
    let area = |scale: f64| {
        let census = Census::of(&uniform(300, scale));
        let extent = census.max[0] - census.min[0];
        extent * extent
    };
    assert_eq!(area(1e-30), 0.0);
    assert!(area(1e-20) > 0.0 && !area(1e-20).is_normal());
    assert!([1e-10, 1.0, 1e10].map(area).iter().all(|area| area.is_normal()));
    assert!([1e20, 1e30].map(area).iter().all(|area| area.is_infinite()));
    let denormal = uniform(300, 1e-40);
    assert!(coordinates(&denormal).iter().all(|x| !x.is_normal()));
    assert!(coordinates(&denormal).iter().any(|x| *x != 0.0));
}

#[test]
fn offsets_leave_few_steps() {
    let steps = |offset: f64| {
        let census = Census::of(&offset_of(offset));
        (census.max[0] - census.min[0]) / (offset as f32 * f32::EPSILON)
    };
    fn offset_of(offset: f64) -> Vec<Triangle> {
        super::offset(300, offset)
    }
    assert!((4.0..40.0).contains(&steps(1e6)), "{}", steps(1e6));
    assert!(steps(1e8) <= 1.0);
}

#[test]
fn one_is_huge_and_the_others_are_tiny() {
    for ratio in [1e8, 1e16] {
        let triangles = huge_and_tiny(300, ratio);
        let lengths: Vec<f64> = triangles.iter().map(|t| edges_and_area(t).0[2]).collect();
        assert!(lengths[0] > 1.0 && lengths[1..].iter().all(|&x| x > 0.0 && x < 2.0 / ratio));
        assert!(triangles[1..].iter().all(|t| edges_and_area(t).1 > 0.0));
    }
}

#[test]
fn a_chain_doubles() {
    let sizes: Vec<f64> = chain(180, -90.0).iter().map(|t| edges_and_area(t).0[2]).collect();
    assert!(sizes.windows(2).all(|pair| pair[1] == 2.0 * pair[0] && pair[1].is_finite()));
    assert!(sizes[0] < 1e-26 && sizes[179] > 1e26);
}

#[test]
fn what_is_degenerate_is_so_exactly() {
    let plane = coplanar(300, 1000.0);
    assert!(plane.iter().all(|t| [t.a, t.b, t.c].iter().all(|p| p[2] == p[0] + p[1])));
    assert!(Census::of(&plane).zero_area < 30);
    let line = Census::of(&collinear(300, 1000.0));
    assert_eq!((line.zero_area, line.flat_axes), (300, [false; 3]));
    let point = Census::of(&coincident(300, 0.7));
    assert_eq!((point.zero_area, point.duplicates, point.flat_axes), (300, 299, [true; 3]));
    let same = Census::of(&duplicates(300, 1.0));
    assert_eq!((same.zero_area, same.duplicates, same.flat_axes), (0, 299, [false; 3]));
    assert_eq!(Census::of(&flat(300, 1.0)).flat_axes, [false, false, true]);
    assert_eq!(Census::of(&flat(300, 2.0)).flat_axes, [false, true, true]);
}

#[test]
fn jitter_is_of_a_few_units_in_the_last_place() {
    let plain = duplicates(300, 1.0);
    let jittered = ulp_jitter(300, 4.0);
    let differences: Vec<u32> =
        coordinates(&jittered).iter().zip(coordinates(&plain)).map(|(a, b)| a.to_bits() - b.to_bits()).collect();
    assert!((0..4).all(|ulps| differences.contains(&ulps)) && differences.iter().all(|&ulps| ulps < 4));
}

#[test]
fn half_is_below_the_resolution_of_the_other() {
    let triangles = two_scales(300, 1e40);
    assert!(triangles.iter().skip(1).step_by(2).all(|t| coordinates(&[*t]).iter().all(|x| !x.is_normal())));
    assert!(triangles.iter().step_by(2).all(|t| edges_and_area(t).0[2] > 1e-3));
}

#[test]
fn the_detail_is_in_one_spot() {
    let triangles = teapot_in_stadium(1000, 1e4);
    let extent = |t: &Triangle| edges_and_area(t).0[2];
    let detail = triangles.iter().filter(|t| extent(t) < 1.0).count();
    let seats = triangles.iter().filter(|t| extent(t) > 100.0).count();
    assert!(detail > 500 && seats > 100 && detail + seats == triangles.len(), "{detail} {seats}");
    let cells: std::collections::HashSet<[i64; 3]> = triangles
        .iter()
        .filter(|t| extent(t) < 1.0)
        .map(|t| t.a.map(|x| (f64::from(x) / 20.0).floor() as i64))
        .collect();
    assert!(cells.len() <= 8, "{cells:?}");
}

#[test]
fn whole_numbers_have_exact_areas() {
    for triangles in [whole(300, 64.0), grid(300, 2.0)] {
        let root = triangles.iter().map(Triangle::aabb).reduce(Aabb::union).unwrap();
        assert!(coordinates(&triangles).iter().all(|x| x.fract() == 0.0 && *x >= 0.0));
        // Sums of a chunk of areas, and of more than a path of them, are whole numbers below 2^24.
        assert!(root.half_area() * 256.0 < (1 << 24) as f32, "{}", root.half_area());
    }
}

#[test]
fn the_grid_has_equal_triangles() {
    let triangles = grid(300, 2.0);
    assert_eq!(triangles.len(), 216);
    let first = edges_and_area(&triangles[0]);
    assert!(triangles.iter().all(|t| edges_and_area(t) == first));
    assert_eq!(Census::of(&triangles).duplicates, 0);
}

#[test]
fn the_soup_overlaps() {
    let boxes: Vec<Aabb> = soup(300, 0.5).iter().map(Triangle::aabb).collect();
    let meets = |a: &Aabb, b: &Aabb| (0..3).all(|k| a.min[k] <= b.max[k] && b.min[k] <= a.max[k]);
    let pairs: usize = boxes.iter().map(|a| boxes.iter().filter(|b| meets(a, b)).count()).sum();
    assert!(pairs / boxes.len() > 5, "{pairs}");
}

#[test]
fn every_kind_of_bad_number_is_there() {
    let triangles = not_finite(300, 7.0);
    let bad: Vec<f32> = coordinates(&triangles).iter().copied().filter(|x| !x.is_finite()).collect();
    assert_eq!(bad.len(), 43);
    assert!(bad.iter().any(|x| x.is_nan()) && bad.contains(&f32::INFINITY) && bad.contains(&f32::NEG_INFINITY));
    let refused = Scene::from_triangles("bad", triangles).unwrap_err().to_string();
    assert!(refused.contains("triangle 2:") && refused.contains("NaN"), "{refused}");
}

#[test]
fn rooms_are_closed_and_where_they_are_said_to_be() {
    for (triangles, count) in [(room(204, 524_288.0), 204), (room_and_far(205, 1e6), 204)] {
        assert_eq!(triangles.iter().filter(|t| t.a[0].abs() < 1e6 - 1.0).count(), count);
        // Each edge of a closed surface is passed once in each direction.
        let mut edges = std::collections::HashMap::new();
        for t in &triangles[..count] {
            for (p, q) in [(t.a, t.b), (t.b, t.c), (t.c, t.a)] {
                *edges.entry([p, q].map(|p| p.map(f32::to_bits))).or_insert(0) += 1;
            }
        }
        assert!(edges.iter().all(|([p, q], &times)| times == 1 && edges.contains_key(&[*q, *p])));
        assert!(coordinates(&triangles).iter().all(|x| x.fract() == 0.0));
    }
    let far = room(204, 524_288.0);
    assert!(coordinates(&far).iter().all(|x| (x - 524_288.0).abs() <= 4.0));
    assert_eq!(room(204, 0.0).len(), 204);
}

fn depth(tree: &Bvh) -> u32 {
    quality(tree, &SahModel::default()).max_depth
}

/// Leaf `p` hangs on the left of internal node `p`; boxes are to come.
fn chain_tree(leaves: u32) -> Bvh {
    let internal = leaves - 1;
    let node = |v: u32| {
        let content = match v.checked_sub(internal) {
            Some(first) => Content::Leaf { first, count: 1 },
            None => {
                Content::Internal { left: internal + v, right: if v + 1 < internal { v + 1 } else { internal + v + 1 } }
            }
        };
        let parent = match v.checked_sub(internal) {
            Some(first) => first.min(internal - 1),
            None => v.checked_sub(1).unwrap_or(NO_NODE),
        };
        BvhNode { aabb: Aabb::EMPTY, parent, content }
    };
    Bvh { nodes: (0..internal + leaves).map(node).collect(), triangle_order: (0..leaves).collect() }
}

#[test]
fn combs_are_deeper_than_64() {
    let teeth = morton_comb(300, 63.0);
    let working = SafeRange::of(&teeth).apply(&teeth);
    let mut device = CpuDevice::new(1).unwrap();
    let (tree, _) = lbvh(&mut device, &working, MortonBits::Sixty).unwrap();
    let tree = Bvh::from_device(&tree.download(&mut device).unwrap()).unwrap();
    assert!(depth(&tree) > 64, "{}", depth(&tree));
    // A comb's best tree takes off a tooth at a time: cheaper than the balanced one over the same order.
    let working = SafeRange::of(&comb(110, 2.0)).apply(&comb(110, 2.0));
    let chain = chain_tree(110).with_boxes_of(&working);
    let binned = Bvh::from_device(&build::sah_binned(&working)).unwrap();
    let cost = |tree: &Bvh| quality(tree, &SahModel::default()).sah_cost;
    assert!(depth(&chain) > 100 && cost(&chain) <= cost(&binned), "{} {}", cost(&chain), cost(&binned));
}

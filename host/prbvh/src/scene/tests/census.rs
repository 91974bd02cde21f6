//! The census against hand counts and a slow count.

use super::*;
use proptest::prelude::*;

#[test]
fn a_small_scene_is_counted() {
    let good = triangle([0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 0.5, 1.0]);
    let point = triangle([-8.0, 0.0, 1.0], [-8.0, 0.0, 1.0], [-8.0, 0.0, 1.0]);
    let line = triangle([0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [3.0, 3.0, 1.0]);
    let turned = triangle(good.b, good.c, good.a);
    let census = Census::of(&[good, point, good, line, turned, good]);
    let want = Census {
        triangles: 6,
        zero_area: 2,
        duplicates: 2,
        min: [-8.0, 0.0, 1.0],
        max: [4.0, 3.0, 1.0],
        flat_axes: [false, false, true],
        largest_coordinate: 8.0,
        largest_extent: 4.0,
        smallest_extent: 0.5,
        extent: [12.0, 3.0, 0.0],
        extent_ratio: 4.0,
        largest_area: 1.0,
        smallest_area: 1.0,
    };
    assert_eq!(census, want);
    assert_eq!((census.area_decades(), census.extent_decades()), (0.0, 8.0f64.log10()));
    // The turned one has the box of the others.
    assert_eq!(duplicate_boxes(&[good, point, good, line, turned, good]), 3);
}

#[test]
fn many_copies_are_counted() {
    let census = Census::of(&vec![triangle([0.0; 3], [1.5, 0.0, 0.0], [1.5, 2.25, 0.0]); 100_000]);
    assert_eq!((census.triangles, census.duplicates, census.zero_area), (100_000, 99_999, 0));
}

#[test]
fn points_have_no_smallest_extent() {
    let census = Census::of(&[triangle([1.0; 3], [1.0; 3], [1.0; 3])]);
    assert_eq!((census.smallest_extent, census.largest_extent, census.zero_area), (0.0, 0.0, 1));
    assert_eq!(census.flat_axes, [true; 3]);
}

#[test]
fn area_is_seen_in_the_smallest_and_the_largest_triangles() {
    let tiny = f32::from_bits(1);
    let small = triangle([0.0; 3], [tiny, 0.0, 0.0], [0.0, tiny, 0.0]);
    let large = triangle([-f32::MAX; 3], [f32::MAX, -f32::MAX, 0.0], [0.0, f32::MAX, 0.0]);
    let census = Census::of(&[small, large]);
    assert_eq!(census.zero_area, 0);
    assert_eq!(census.smallest_extent, f64::from(tiny));
    assert_eq!(census.largest_extent, 2.0 * f64::from(f32::MAX));
}

proptest! {
    #[test]
    fn duplicates_are_those_of_a_set(picks in prop::collection::vec(0..6_u8, 0..300)) {
        let triangles: Vec<Triangle> = picks.iter().map(|p| triangle([f32::from(*p); 3], [1.0; 3], [0.0; 3])).collect();
        let distinct: std::collections::BTreeSet<u8> = picks.iter().copied().collect();
        prop_assert_eq!(Census::of(&triangles).duplicates, picks.len() - distinct.len());
    }
}

//! The built-in scene is what its documentation says.

use super::*;

#[test]
fn the_number_of_triangles_is_exact() {
    for count in [1, 2, 3, 100, 999, 1000, 1001, 4096, 16_384, 65_537, DEFAULT_TRIANGLES] {
        assert_eq!(built_in(count).triangles.len(), count);
    }
    assert_eq!(built_in(0).triangles.len(), 1);
}

#[test]
fn the_bits_are_the_same_everywhere() {
    // From a machine of x86-64; a change of the scene changes them.
    assert_eq!(built_in(1000).hash, "64f1b866d27a5d5c8e43a48c67d7b5bb");
    assert_eq!(built_in(DEFAULT_TRIANGLES).hash, "38cd8cf87f8e078fa297b64e7a7a11a5");
}

#[test]
fn it_is_a_valid_scene_of_an_interior() {
    for count in [1000, 20_000, DEFAULT_TRIANGLES] {
        let scene = built_in(count);
        assert!(Scene::from_triangles("hall", scene.triangles.clone()).is_ok());
        let census = &scene.census;
        assert_eq!((census.min, census.max), ([0.0; 3], [30.0, 9.0, 12.0]));
        assert_eq!(census.duplicates, 0, "{count}");
        assert_eq!(census.zero_area, 0, "{count}");
        let tiny = scene.triangles.iter().filter(|t| extent(t) < 0.1).count();
        let huge = scene.triangles.iter().filter(|t| extent(t) > 8.0).count();
        assert!(huge >= 12 && huge * 7 < count, "{huge} of {count} are huge");
        assert!(tiny * 20 > count, "{tiny} of {count} are tiny");
    }
}

#[test]
fn every_part_is_there_from_a_thousand_triangles_on() {
    let blades = |count: usize| {
        let hall = built_in(count);
        let on_carpet = |t: &&Triangle| t.a[1] == 0.01 && t.b[1] == 0.01 && t.c[1] > 0.01 && extent(t) < 0.1;
        hall.triangles.iter().filter(on_carpet).count()
    };
    // The blades come last, so that some of them means all of the other parts.
    for count in [1000, 2000, 5000, 20_000, 100_000, DEFAULT_TRIANGLES] {
        assert!(blades(count) * 100 > count, "{} blades of {count}", blades(count));
        assert!(blades(count) * 3 < count, "{} blades of {count}", blades(count));
    }
}

fn extent(triangle: &Triangle) -> f32 {
    let aabb = triangle.aabb();
    (0..3).map(|k| aabb.max[k] - aabb.min[k]).fold(0.0, f32::max)
}

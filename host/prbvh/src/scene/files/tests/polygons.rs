//! Polygons of all shapes: their triangles have the area of the polygon, and face as it does.

use super::polygon::Polygons;
use super::*;
use proptest::prelude::*;

fn triangles(corners: &[[f32; 3]]) -> (Vec<Triangle>, bool) {
    let mut triangles = Vec::new();
    let is_simple = Polygons::default().push(corners, &mut triangles);
    (triangles, is_simple)
}

fn total(triangles: &[Triangle]) -> f64 {
    triangles.iter().map(Area::area).sum()
}

/// Twice the signed area of a polygon in the plane of x and y.
fn signed(corners: &[[f32; 3]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| f64::from(a[0]) * f64::from(b[1]) - f64::from(b[0]) * f64::from(a[1])).sum()
}

fn flat(points: &[[f32; 2]]) -> Vec<[f32; 3]> {
    points.iter().map(|[x, y]| [*x, *y, 0.0]).collect()
}

#[test]
fn convex_polygons_are_fans() {
    let corners = flat(&[[0.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 3.0], [1.0, 3.0]]);
    let fan: Vec<_> = corners.windows(2).skip(1).map(|edge| triangle(corners[0], edge[0], edge[1])).collect();
    assert_eq!(triangles(&corners), (fan, true));
    // On a line there is no area to get wrong.
    assert!(triangles(&flat(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [3.0, 0.0]])).1);
}

#[test]
fn a_quad_that_is_bent_a_little_stays_a_fan() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.2], [1.0, 1.0, 0.0], [0.0, 1.0, -0.1]];
    assert_eq!(triangles(&corners).0[0], triangle(corners[0], corners[1], corners[2]));
}

#[test]
fn concave_polygons_keep_area_and_winding() {
    let arrow = [[0.0, 4.0], [0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0]];
    let comb = [
        [0.0, 0.0],
        [7.0, 0.0],
        [7.0, 3.0],
        [6.0, 3.0],
        [6.0, 1.0],
        [4.0, 1.0],
        [4.0, 3.0],
        [3.0, 3.0],
        [3.0, 1.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [0.0, 3.0],
    ];
    for shape in [&arrow[..], &comb] {
        for start in 0..shape.len() {
            for backwards in [false, true] {
                let mut points = shape.to_vec();
                points.rotate_left(start);
                if backwards {
                    points.reverse();
                }
                let corners = flat(&points);
                let area = signed(&corners) / 2.0;
                for axis in 0..3 {
                    // In each plane.
                    let turned: Vec<_> = corners.iter().map(|c| [0, 1, 2].map(|k| c[(k + axis) % 3])).collect();
                    let (made, is_simple) = triangles(&turned);
                    assert!(is_simple);
                    assert_eq!(total(&made), area.abs(), "{points:?}");
                    let back = |t: &Triangle| [t.a, t.b, t.c].map(|c| [0, 1, 2].map(|k| c[(k + 3 - axis) % 3]));
                    assert!(made.iter().all(|t| signed(&back(t)) * area >= 0.0), "{points:?}");
                }
            }
        }
    }
}

#[test]
fn a_polygon_that_crosses_itself_is_said() {
    for points in [
        &[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]][..],
        // A star of five points covers its middle twice.
        &[[0.0, 3.0], [2.0, -3.0], [-3.0, 1.0], [3.0, 1.0], [-2.0, -3.0]],
    ] {
        assert!(!triangles(&flat(points)).1, "{points:?}");
    }
    let text = "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\nf 1 2 3 4\n";
    let scene = load_bytes("a.obj", text).unwrap();
    let note = "a polygon that crosses itself is read as a fan around its first corner (2 times, first at line 5)";
    assert_eq!((said(&scene), scene.triangles.len()), (vec![note.to_owned()], 4));
}

proptest! {
    /// Corners at any distances around a point make a polygon that does not cross itself.
    #[test]
    fn stars_keep_their_area(distances in prop::collection::vec(1..100_u8, 3..40), start in any::<prop::sample::Index>()) {
        let turn = std::f64::consts::TAU / distances.len() as f64;
        let mut points: Vec<_> = (0..).zip(&distances).map(|(k, distance)| {
            let angle = turn * f64::from(k);
            [(angle.cos() * f64::from(*distance)) as f32, (angle.sin() * f64::from(*distance)) as f32]
        }).collect();
        let count = points.len();
        points.rotate_left(start.index(count));
        let corners = flat(&points);
        let (made, is_simple) = triangles(&corners);
        let area = signed(&corners) / 2.0;
        prop_assert!(is_simple || distances.len() == 3);
        prop_assert!((total(&made) - area).abs() <= 1e-4 * area, "{} of {}", total(&made), area);
    }

    #[test]
    fn any_polygon_has_triangles_of_its_own_corners(corners in prop::collection::vec(prop::array::uniform3(any::<f32>()), 3..20)) {
        let corners: Vec<_> = corners.into_iter().map(|c| c.map(|x| if x.is_finite() { x } else { 0.0 })).collect();
        let (made, _) = triangles(&corners);
        prop_assert!(made.len() <= corners.len() - 2);
        prop_assert!(made.iter().flat_map(|t| [t.a, t.b, t.c]).all(|corner| corners.contains(&corner)));
    }
}

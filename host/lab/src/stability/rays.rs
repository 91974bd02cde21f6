//! Rays through a tree against rays through all triangles, and rays that must not get out.

use crate::render::{Camera, RenderError, RenderSettings, TracedTree, render};
use prbvh::device::Device;
use prbvh::scene::{Noise, Scene};
use prbvh::trace::{NO_TRIANGLE, Query, Ray, TraceError, TraceRange, trace};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::ray::Prepared;
use prbvh_kernel::setup::Triangle;

/// Rays from in and around the scene to the middle of triangles, large and small.
pub(super) fn rays(triangles: &[Triangle], count: usize) -> Vec<Ray> {
    let [low, high] = starts(triangles).map(|corner| corner.map(f64::from));
    let mut noise = Noise::new(9);
    let ray = |k: usize| {
        let Triangle { a, b, c } = triangles[k * triangles.len() / count];
        let target = [0, 1, 2].map(|axis| a[axis] / 3.0 + b[axis] / 3.0 + c[axis] / 3.0);
        let origin = [0, 1, 2].map(|axis| noise.between(low[axis], high[axis]) as f32);
        let direction = [0, 1, 2].map(|axis| target[axis] - origin[axis]);
        Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    (0..count).map(ray).collect()
}

/// Corners of the box that rays start in: the scene's, and half as much on each side.
fn starts(triangles: &[Triangle]) -> [[f32; 3]; 2] {
    let Aabb { min, max } = triangles.iter().map(Triangle::aabb).fold(Aabb::EMPTY, Aabb::union);
    let part = |k: usize, part: f32| min[k] + part * (max[k] - min[k]);
    [[0, 1, 2].map(|k| part(k, -0.5)), [0, 1, 2].map(|k| part(k, 1.5))]
}

/// How many rays left the surfaces that are seen from `eye`, on three bounces, and how many of them hit something.
///
/// # Errors
/// If the device refuses or fails.
pub(super) fn indoors<'a>(
    tree: impl Into<TracedTree<'a>>,
    scene: &Scene,
    eye: [f32; 3],
    device: &mut dyn Device,
) -> Result<[u64; 2], RenderError> {
    let settings = RenderSettings { width: 32, height: 24, samples: 1, bounces: 3, light_samples: 1 };
    let look_at = [eye[0] + 1.0, eye[1], eye[2] + 0.25];
    let camera = Camera { eye, look_at, up: [0.0, 1.0, 0.0], fov_degrees: 90.0 };
    let rays = render(device, scene, tree, &camera, &settings)?.secondary;
    Ok([rays.rays, rays.hits])
}

/// Parameter and triangle of each ray's closest hit by testing all triangles.
///
/// # Errors
/// If a ray is none.
pub(super) fn without_tree(triangles: &[Triangle], rays: &[Ray]) -> Result<Vec<(f32, u32)>, TraceError> {
    let range = TraceRange::of(triangles, &starts(triangles));
    let working = range.triangles(triangles);
    let closest = |(k, ray): (usize, &Ray)| {
        let ray = range.ray(k, ray)?;
        let prepared = Prepared::new(&ray);
        let mut best = (f32::INFINITY, NO_TRIANGLE);
        for (id, t) in (0..).zip(&working) {
            let hit = prepared.hits([t.a, t.b, t.c], ray.t_max);
            if hit < best.0 {
                best = (hit, id);
            }
        }
        Ok(if best.1 == NO_TRIANGLE { (0.0, NO_TRIANGLE) } else { (range.to_scene(best.0), best.1) })
    };
    rays.iter().enumerate().map(closest).collect()
}

/// The same through a tree.
///
/// # Errors
/// If the device refuses or fails.
pub(super) fn through<'a>(
    tree: impl Into<TracedTree<'a>>,
    triangles: &[Triangle],
    rays: &[Ray],
    device: &mut dyn Device,
) -> Result<Vec<(f32, u32)>, TraceError> {
    let mut scene = tree.into().on(device, triangles, &starts(triangles))?;
    let hits = trace(device, &mut scene, rays, Query::Closest);
    scene.free(device);
    Ok(hits?.0.iter().map(|hit| (hit.t, hit.triangle)).collect())
}

/// The first ray whose hits differ; the number of the shorter list where one ends early.
pub(super) fn first_difference(hits: &[(f32, u32)], expected: &[(f32, u32)]) -> Option<usize> {
    let differs = hits.iter().zip(expected).position(|(a, b)| a != b);
    differs.or((hits.len() != expected.len()).then_some(hits.len().min(expected.len())))
}

#[cfg(test)]
mod tests {
    use super::super::shapes;
    use super::*;
    use prbvh::build;
    use prbvh::bvh::Bvh;
    use prbvh::device::cpu::CpuDevice;

    #[test]
    fn a_tree_with_a_tooth_in_the_wrong_place_is_found() {
        for triangles in [shapes::comb(110, 2.0), shapes::morton_comb(300, 63.0)] {
            let cast = rays(&triangles, 64);
            let expected = without_tree(&triangles, &cast).unwrap();
            let hit = expected.iter().filter(|hit| hit.1 != NO_TRIANGLE).count();
            assert!(hit > 8, "{hit} rays hit something");
            let tree = Bvh::from_device(&build::sah_binned(&triangles)).unwrap();
            let mut device = CpuDevice::new(1).unwrap();
            let hits = through(&tree, &triangles, &cast, &mut device).unwrap();
            assert_eq!(first_difference(&hits, &expected), None);
            let mut other = tree;
            let last = other.triangle_order.len() - 1;
            other.triangle_order.swap(0, last);
            let mut moved = triangles.clone();
            moved.reverse();
            assert!(first_difference(&through(&other, &moved, &cast, &mut device).unwrap(), &expected).is_some());
            assert_eq!(first_difference(&hits[..63], &expected), Some(63));
        }
    }
    #[test]
    fn a_room_without_a_ceiling_is_found() {
        let mut device = CpuDevice::new(1).unwrap();
        for (distance, eye) in [(0.0, [0.5, 0.25, 0.5]), (524_288.0, [524_288.5, 524_288.25, 524_288.5])] {
            let mut triangles = shapes::room(204, distance);
            let mut bounced = |triangles: &[Triangle]| {
                let scene = Scene::from_triangles("room", triangles.to_vec()).unwrap();
                let tree = Bvh::from_device(&build::sah_binned(triangles)).unwrap();
                indoors(&tree, &scene, eye, &mut device).unwrap()
            };
            let [left, hit] = bounced(&triangles);
            assert!(left == 3 * 32 * 24 && hit == left, "{hit} of {left}");
            // Without its ceiling.
            let top = distance as f32 + 2.0;
            triangles.retain(|t| [t.a, t.b, t.c].iter().any(|corner| corner[1] != top));
            let [left, hit] = bounced(&triangles);
            assert!(hit < left && hit > left / 2, "{hit} of {left}");
        }
    }
}

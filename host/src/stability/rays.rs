//! Rays through a tree against rays through all triangles.

use crate::bvh::Bvh;
use crate::device::Device;
use crate::scene::Noise;
use crate::trace::{NO_TRIANGLE, Query, Ray, TraceError, TraceRange, TraceScene, trace};
use prbvh_kernel::ray::Prepared;
use prbvh_kernel::setup::Triangle;
use std::f32;

/// Rays from around the scene to the middle of triangles, large and small.
pub(super) fn rays(triangles: &[Triangle], count: usize) -> Vec<Ray> {
    let reach = reach(triangles);
    let mut noise = Noise::new(9);
    let ray = |k: usize| {
        let Triangle { a, b, c } = triangles[k * triangles.len() / count];
        let target = [0, 1, 2].map(|axis| a[axis] / 3.0 + b[axis] / 3.0 + c[axis] / 3.0);
        let origin = [0; 3].map(|_| noise.between(-1.0, 1.0) as f32 * reach);
        let direction = [0, 1, 2].map(|axis| target[axis] - origin[axis]);
        Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    (0..count).map(ray).collect()
}

/// Largest coordinate that a ray starts at.
fn reach(triangles: &[Triangle]) -> f32 {
    bytemuck::cast_slice::<_, f32>(triangles).iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// Parameter and triangle of each ray's closest hit by testing all triangles.
///
/// # Errors
/// If a ray is none.
pub(super) fn without_tree(triangles: &[Triangle], rays: &[Ray]) -> Result<Vec<(f32, u32)>, TraceError> {
    let range = TraceRange::of(triangles, reach(triangles));
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
pub(super) fn through(
    tree: &Bvh,
    triangles: &[Triangle],
    rays: &[Ray],
    device: &mut dyn Device,
) -> Result<Vec<(f32, u32)>, TraceError> {
    let mut scene = TraceScene::new(device, tree, triangles, reach(triangles))?;
    let hits = trace(device, &mut scene, rays, Query::Closest);
    scene.free(device);
    Ok(hits?.0.iter().map(|hit| (hit.t, hit.triangle)).collect())
}

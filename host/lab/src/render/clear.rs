//! Views of a scene that face no wall.

use super::traced::bounds;
use super::{Camera, RenderError, TracedTree};
use prbvh::device::Device;
use prbvh::scene::Scene;
use prbvh::trace::{NO_TRIANGLE, Query, Ray, trace};

/// Columns and rows of the rays that try a view.
const GRID: [u32; 2] = [9, 7];

/// The view of that number ([`Camera::view`]); if it is one from inside, from the place of several that sees farthest: the one with the
/// largest median distance over a grid of rays, rays that hit nothing counted as 0. The same on every device and with every tree.
///
/// # Errors
/// As [`Camera::view`], or if the rays cannot be traced.
pub fn clear_view<'a>(
    number: u32,
    device: &mut dyn Device,
    scene: &Scene,
    tree: impl Into<TracedTree<'a>>,
    up: usize,
) -> Result<Camera, RenderError> {
    let candidates = Camera::views_from(number, &bounds(scene), up)?;
    let [first, _, ..] = candidates[..] else { return Ok(candidates[0]) };
    let mut rays = Vec::with_capacity(candidates.len() * (GRID[0] * GRID[1]) as usize);
    for camera in &candidates {
        // A scene without extent in the direction of view: no candidate is better than another.
        let Ok(frame) = camera.frame(GRID[0], GRID[1]) else { return Ok(first) };
        rays.extend(grid(camera, frame));
    }
    let eyes: Vec<[f32; 3]> = candidates.iter().map(|camera| camera.eye).collect();
    let mut traced = tree.into().on(device, &scene.triangles, &eyes)?;
    let result = trace(device, &mut traced, &rays, Query::Closest);
    traced.free(device);
    let (hits, _) = result?;
    let mut best = (first, f32::NEG_INFINITY);
    for (camera, hits) in candidates.iter().zip(hits.chunks_exact((GRID[0] * GRID[1]) as usize)) {
        let mut distances: Vec<f32> =
            hits.iter().map(|hit| if hit.triangle == NO_TRIANGLE { 0.0 } else { hit.t }).collect();
        let middle = distances.len() / 2;
        let median = *distances.select_nth_unstable_by(middle, f32::total_cmp).1;
        if median > best.1 {
            best = (*camera, median);
        }
    }
    Ok(best.0)
}

/// Rays through the middles of the cells of the grid.
fn grid(camera: &Camera, [forward, right, up]: [[f32; 3]; 3]) -> impl Iterator<Item = Ray> {
    let eye = camera.eye;
    (0..GRID[0] * GRID[1]).map(move |cell| {
        let part = |at: u32, of: u32| (2 * at + 1) as f32 / of as f32 - 1.0;
        let (x, y) = (part(cell % GRID[0], GRID[0]), part(cell / GRID[0], GRID[1]));
        let direction = [0, 1, 2].map(|k| forward[k] + x * right[k] + y * up[k]);
        Ray { origin: eye, t_min: 0.0, direction, t_max: f32::INFINITY }
    })
}

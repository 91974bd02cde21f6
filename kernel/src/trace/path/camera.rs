//! Primary rays.

use super::Path;
use crate::math::{add_scaled, dot, reciprocal_sqrt};
use crate::mem::Slot;
use crate::ray::Ray;
use crate::trace::random::{key, uniform};
use bytemuck::{Pod, Zeroable};

/// Push constants of [`camera`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CameraParams {
    /// Invocations: one per path, a multiple of 64.
    pub count: u32,
    /// The first path of the picture, a multiple of 64.
    pub first: u32,
    /// Columns of pixels.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
    /// The sample; sample 0 goes through the middle of the pixel.
    pub sample: u32,
    /// The eye, in the trace range.
    pub eye: [f32; 3],
    /// To the middle of the picture, of length 1.
    pub forward: [f32; 3],
    /// From the middle to the right edge.
    pub right: [f32; 3],
    /// From the middle to the upper edge.
    pub up: [f32; 3],
    /// Pixel coordinates times this, minus 1, lie between -1 and 1.
    pub per_pixel: [f32; 2],
    /// Largest parameter of a ray.
    pub t_max: f32,
}

/// The pixel `[x, y]` of path `index`: tiles of 8 × 8 pixels row by row, in Morton order inside.
#[inline(always)]
#[must_use]
pub fn pixel(index: u32, width: u32) -> [u32; 2] {
    let (tile, m) = (index / 64, index % 64);
    let tiles = width.div_ceil(8);
    let x = (m & 1) | ((m >> 1) & 2) | ((m >> 2) & 4);
    let y = ((m >> 1) & 1) | ((m >> 2) & 2) | ((m >> 3) & 4);
    [(tile % tiles) * 8 + x, (tile / tiles) * 8 + y]
}

/// Invocation `i` starts path `first + i`. Writes `rays[count]` and `paths[count]`; outside the picture there is no ray.
#[inline(always)]
pub fn camera(i: u32, params: &CameraParams, rays: &[Slot<Ray>], paths: &[Slot<Path>]) {
    let [x, y] = pixel(params.first + i, params.width);
    let mut ray = Ray::NONE;
    let number = y.wrapping_mul(params.width).wrapping_add(x);
    if x < params.width && y < params.height {
        let mut at = [0.5f32, 0.5];
        if params.sample > 0 {
            let key = key(number, params.sample, u32::MAX);
            at = [uniform(key, 0), uniform(key, 1)];
        }
        let h = (x as f32 + at[0]) * params.per_pixel[0] - 1.0;
        let v = 1.0 - (y as f32 + at[1]) * params.per_pixel[1];
        let d = add_scaled(add_scaled(params.forward, h, params.right), v, params.up);
        let s = reciprocal_sqrt(dot(d, d));
        ray = Ray::snapped(params.eye, [d[0] * s, d[1] * s, d[2] * s], params.t_max);
    }
    rays[i as usize].set(ray);
    paths[i as usize].set(Path { throughput: [1.0; 3], pixel: number, radiance: [0.0; 3], tests: 0 });
}

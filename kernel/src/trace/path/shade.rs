//! What happens where a ray ends.

use super::{Light, Path, Pixel, Surface};
use crate::math::{add_scaled, dot, reciprocal_sqrt};
use crate::mem::Slot;
use crate::ray::{Hit, NO_TRIANGLE, Ray, UNFINISHED};
use crate::trace::random::{cosine_direction, key, uniform};
use bytemuck::{Pod, Zeroable};

/// Part of the light that surfaces scatter: red, green, blue.
const ALBEDO: [f32; 3] = [0.75, 0.73, 0.70];
const INVERSE_PI: f32 = core::f32::consts::FRAC_1_PI;
/// Brings lengths of the trace range near 1, so that their squares neither under- nor overflow.
const TO_UNIT: f32 = 1.0 / (1u32 << 30) as f32;

/// Product colour by colour.
#[inline(always)]
fn product(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

/// Push constants of [`shade`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ShadeParams {
    /// Invocations: one per path.
    pub count: u32,
    /// The sample.
    pub sample: u32,
    /// The bounce; 0 where the primary ray ends.
    pub bounce: u32,
    /// 1: the path ends here; 0: it goes on.
    pub ends: u32,
    /// Shadow rays per hit.
    pub light_samples: u32,
    /// Largest parameter of a ray.
    pub t_max: f32,
    /// Middle of the light, in the trace range.
    pub light: [f32; 3],
    /// From the middle of the light to one edge.
    pub light_u: [f32; 3],
    /// From the middle of the light to the next edge.
    pub light_v: [f32; 3],
    /// Normal of the light, of length 1; it shines to both sides.
    pub light_normal: [f32; 3],
    /// Radiance of the light times its area in units of 2^60, over the number of light samples.
    pub light_power: f32,
    /// Up, of length 1.
    pub up: [f32; 3],
    /// Radiance of the sky.
    pub sky: f32,
}

/// Invocation `i` shades the end of ray `i`: sky, or shadow rays `[i · light_samples ..]` with what light they may bring, and the
/// next ray in `rays[i]`. Reads `hits[count]` and `surfaces[n]` (by triangle); writes `rays`, `paths`, `shadow_rays`, `lights`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "each is a buffer of the kernel")]
pub fn shade(
    i: u32,
    params: &ShadeParams,
    hits: &[Hit],
    surfaces: &[Surface],
    rays: &[Slot<Ray>],
    paths: &[Slot<Path>],
    shadow_rays: &[Slot<Ray>],
    lights: &[Slot<Light>],
) {
    let ray = rays[i as usize].get();
    let hit = hits[i as usize];
    let mut path = paths[i as usize].get();
    let mut next = Ray::NONE;
    // A picture with unfinished rays is made once more.
    let is_hit = ray.is_active() && hit.triangle < UNFINISHED;
    if params.bounce == 0 {
        path.tests = hit.box_tests + hit.triangle_tests;
    }
    if ray.is_active() && !is_hit {
        // Brighter towards the zenith, bluish.
        let height = 0.5 + 0.5 * dot(ray.direction, params.up);
        let sky = [0.55 + 0.25 * height, 0.65 + 0.25 * height, 0.80 + 0.2 * height];
        path.radiance = add_scaled(path.radiance, params.sky, product(path.throughput, sky));
    }
    let mut origin = [0.0f32; 3];
    let mut normal = [0.0f32; 3];
    let key = key(path.pixel, params.sample, params.bounce);
    if is_hit {
        let surface = surfaces[hit.triangle as usize];
        normal = surface.normal;
        if dot(normal, ray.direction) > 0.0 {
            normal = [-normal[0], -normal[1], -normal[2]];
        }
        origin = surface.leave(&ray, normal);
        path.throughput = product(path.throughput, ALBEDO);
        if params.ends == 0 {
            next = Ray::snapped(origin, cosine_direction(normal, key, 1000), params.t_max);
        }
    }
    for sample in 0..params.light_samples {
        let mut shadow = Ray::NONE;
        let mut light = Light { radiance: [0.0; 3], unused: 0 };
        if is_hit {
            let (a, b) = (2.0 * uniform(key, 2 * sample) - 1.0, 2.0 * uniform(key, 2 * sample + 1) - 1.0);
            let point = add_scaled(add_scaled(params.light, a, params.light_u), b, params.light_v);
            let way = add_scaled(point, -1.0, origin);
            let way = [way[0] * TO_UNIT, way[1] * TO_UNIT, way[2] * TO_UNIT];
            let square = dot(way, way);
            if square > 1e-12 {
                let s = reciprocal_sqrt(square);
                let direction = [way[0] * s, way[1] * s, way[2] * s];
                let cosine = dot(normal, direction);
                let light_cosine = dot(params.light_normal, direction);
                let light_cosine = if light_cosine < 0.0 { -light_cosine } else { light_cosine };
                if cosine > 0.0 {
                    let distance = square * s * (1u32 << 30) as f32;
                    shadow = Ray::snapped(origin, direction, distance * 0.9999);
                    let part = cosine * light_cosine * (s * s) * params.light_power * INVERSE_PI;
                    light.radiance = add_scaled(light.radiance, part, path.throughput);
                }
            }
        }
        let at = (i * params.light_samples + sample) as usize;
        shadow_rays[at].set(shadow);
        lights[at].set(light);
    }
    rays[i as usize].set(next);
    paths[i as usize].set(path);
}

/// Push constants of [`gather`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct GatherParams {
    /// Invocations: one per path.
    pub count: u32,
    /// Shadow rays per path.
    pub light_samples: u32,
}

/// Invocation `i` adds the light of the shadow rays of path `i` that hit nothing. Reads `shadow_hits` and `lights`, writes `paths`.
#[inline(always)]
pub fn gather(i: u32, params: &GatherParams, shadow_hits: &[Hit], lights: &[Light], paths: &[Slot<Path>]) {
    let mut path = paths[i as usize].get();
    for sample in 0..params.light_samples {
        let at = (i * params.light_samples + sample) as usize;
        if shadow_hits[at].triangle == NO_TRIANGLE {
            let light = lights[at];
            path.radiance = add_scaled(path.radiance, 1.0, light.radiance);
        }
    }
    paths[i as usize].set(path);
}

/// Push constants of [`film`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct FilmParams {
    /// Invocations: one per path.
    pub count: u32,
}

/// Invocation `i` adds path `i` to its pixel.
#[inline(always)]
pub fn film(i: u32, paths: &[Path], pixels: &[Slot<Pixel>]) {
    let path = paths[i as usize];
    let mut pixel = pixels[i as usize].get();
    pixel.radiance = add_scaled(pixel.radiance, 1.0, path.radiance);
    pixel.tests = pixel.tests.wrapping_add(path.tests);
    pixels[i as usize].set(pixel);
}

//! Rays that find the weak spots of a ray tracer.

use crate::fixtures::Random;
use prbvh::trace::{Hit, NO_TRIANGLE, Ray, TraceRange};
use prbvh_kernel::ray::Prepared;
use prbvh_kernel::setup::Triangle;

/// All origins lie in the box of these.
pub const STARTS: [[f32; 3]; 2] = [[-4.0; 3], [4.0; 3]];

/// A ray from `origin` through `target`, to any distance.
#[must_use]
pub fn ray(origin: [f32; 3], target: [f32; 3]) -> Ray {
    let direction = [0, 1, 2].map(|k| target[k] - origin[k]);
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}

/// Random rays around the unit cube, rays at corners and edges of triangles, rays along axes through corners.
#[must_use]
pub fn rays(triangles: &[Triangle], count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let mut rays = Vec::new();
    while rays.len() < count {
        let origin = random.point(3.0).map(|x| x - 1.0);
        let t = triangles[random.bits() as usize % triangles.len()];
        let mix = |a: [f32; 3], b: [f32; 3], s: f32| [0, 1, 2].map(|k| a[k] + s * (b[k] - a[k]));
        let inside = mix(mix(t.a, t.b, random.unit()), t.c, random.unit());
        rays.push(ray(origin, random.point(1.0)));
        rays.push(ray(origin, inside));
        rays.push(ray(origin, t.b));
        rays.push(ray(origin, mix(t.a, t.c, 0.5)));
        rays.push(ray(inside, origin));
        for k in 0..3 {
            let mut origin = t.a;
            origin[k] = -2.0;
            rays.push(Ray { origin, t_min: 0.0, direction: [0, 1, 2].map(|j| f32::from(j == k)), t_max: 10.0 });
        }
        let short = Ray { t_min: 0.1, t_max: 0.5, ..ray(origin, inside) };
        rays.push(short);
    }
    rays.retain(|ray| ray.direction != [0.0; 3]);
    rays.truncate(count);
    rays
}

/// Parameter and triangle of the closest hit, from all triangles one by one; the rays start between [`STARTS`].
///
/// # Panics
/// If a ray is none.
#[must_use]
pub fn brute_force(triangles: &[Triangle], rays: &[Ray]) -> Vec<(f32, u32)> {
    let range = TraceRange::of(triangles, &STARTS);
    let working = range.triangles(triangles);
    let closest = |(k, ray): (usize, &Ray)| {
        let ray = range.ray(k, ray).unwrap();
        let prepared = Prepared::new(&ray);
        let hit = |(id, t): (u32, &Triangle)| (prepared.hits([t.a, t.b, t.c], ray.t_max), id);
        let best = (0..).zip(&working).map(hit).min_by(|a, b| a.partial_cmp(b).unwrap()).unwrap();
        if best.0 < f32::INFINITY { (range.to_scene(best.0), best.1) } else { (0.0, NO_TRIANGLE) }
    };
    rays.iter().enumerate().map(closest).collect()
}

/// Parameters and triangles of hits.
#[must_use]
pub fn answers(hits: &[Hit]) -> Vec<(f32, u32)> {
    hits.iter().map(|hit| (hit.t, hit.triangle)).collect()
}

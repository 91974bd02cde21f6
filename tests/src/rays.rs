//! Rays that find the weak spots of a ray tracer.

use crate::fixtures::Random;
use prbvh_kernel::ray::Ray;
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

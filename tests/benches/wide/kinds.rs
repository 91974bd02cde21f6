//! The rays of a small path tracer, as lists: from the eye, from surfaces to a light, from surfaces on.

use prbvh::device::cpu::CpuDevice;
use prbvh::scene::Scene;
use prbvh::trace::{NO_TRIANGLE, Query, Ray, TraceScene, trace};
use prbvh_kernel::trace::random::{cosine_direction, key, uniform};
use prbvh_lab::render::{Camera, TracedTree, clear_view};

/// Times that a path goes on.
const BOUNCES: u32 = 3;

/// New rays start this part of the scene's diagonal from a surface.
const OFF: f32 = 1e-5;

/// Rays of one kind, their directions of length 1.
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) query: Query,
    pub(crate) rays: Vec<Ray>,
}

/// Primary, shadow and secondary rays of all views of the scene; of the first kind about `count`, of the others what becomes of these.
pub(crate) fn of_paths(scene: &Scene, tree: TracedTree<'_>, count: usize) -> [Kind; 3] {
    let mut device = CpuDevice::new(0).expect("threads");
    let lights = Light::both(scene);
    let starts: Vec<[f32; 3]> = lights.iter().flat_map(Light::corners).collect();
    let mut kinds = [("primary", Query::Closest), ("shadow", Query::Any), ("secondary", Query::Closest)]
        .map(|(name, query)| Kind { name, query, rays: Vec::new() });
    let up = 1;
    for view in 0..Camera::VIEWS {
        let camera = clear_view(view, &mut device, scene, tree, up).expect("the scene has an extent");
        let mut rays = primary(&camera, up, count / Camera::VIEWS as usize);
        let starts: Vec<[f32; 3]> = starts.iter().copied().chain([camera.eye]).collect();
        let mut traced = tree.on(&mut device, &scene.triangles, &starts).expect("the tree is good");
        kinds[0].rays.extend(&rays);
        for bounce in 0..BOUNCES {
            let next = bounced(&mut device, (scene, &mut traced), &rays, bounce, &lights[usize::from(view > 0)]);
            kinds[1].rays.extend(&next.shadow);
            kinds[2].rays.extend(&next.secondary);
            rays = next.secondary;
        }
        traced.free(&mut device);
    }
    kinds
}

/// A square across the vertical, above the scene or below its ceiling.
struct Light {
    middle: [f32; 3],
    half: f32,
}

impl Light {
    fn both(scene: &Scene) -> [Self; 2] {
        let (low, high) = (scene.census.min, scene.census.max);
        let size = length([0, 1, 2].map(|k| high[k] - low[k]));
        let at = |k: usize, part: f32| low[k] + part * (high[k] - low[k]);
        let above = [at(0, 0.5), high[1] + 0.7 * size, at(2, 0.5)];
        let inside = [at(0, 0.5), at(1, 0.75), at(2, 0.5)];
        [Self { middle: above, half: 0.25 * size }, Self { middle: inside, half: 0.12 * size }]
    }

    fn point(&self, across: f32, along: f32) -> [f32; 3] {
        let [x, y, z] = self.middle;
        [x + self.half * (2.0 * across - 1.0), y, z + self.half * (2.0 * along - 1.0)]
    }

    fn corners(&self) -> [[f32; 3]; 2] {
        [self.point(0.0, 0.0), self.point(1.0, 1.0)]
    }
}

fn primary(camera: &Camera, up: usize, count: usize) -> Vec<Ray> {
    let side = (count as f64).sqrt() as u32;
    let forward = unit([0, 1, 2].map(|k| camera.look_at[k] - camera.eye[k]));
    let mut vertical = [0.0; 3];
    vertical[up] = 1.0;
    let right = unit(cross(forward, vertical));
    let upward = cross(right, forward);
    let half = (camera.fov_degrees.to_radians() / 2.0).tan();
    let ray = |pixel: u32| {
        let part = |at: u32| (half * ((2 * at + 1) as f32 / side as f32 - 1.0), at);
        let ((x, _), (y, _)) = (part(pixel % side), part(pixel / side));
        let direction = unit([0, 1, 2].map(|k| forward[k] + x * right[k] + y * upward[k]));
        Ray { origin: camera.eye, t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    (0..side * side).map(ray).collect()
}

struct Next {
    shadow: Vec<Ray>,
    secondary: Vec<Ray>,
}

fn bounced(
    device: &mut CpuDevice,
    (scene, traced): (&Scene, &mut TraceScene),
    rays: &[Ray],
    bounce: u32,
    light: &Light,
) -> Next {
    let (hits, _) = trace(device, traced, rays, Query::Closest).expect("the rays are good");
    let off = OFF * length([0, 1, 2].map(|k| scene.census.max[k] - scene.census.min[k]));
    let inside = |p: [f32; 3]| (0..3).all(|k| (scene.census.min[k]..=scene.census.max[k]).contains(&p[k]));
    let mut next = Next { shadow: Vec::new(), secondary: Vec::new() };
    for ((ray, hit), number) in rays.iter().zip(&hits).zip(0u32..) {
        if hit.triangle == NO_TRIANGLE {
            continue;
        }
        let t = &scene.triangles[hit.triangle as usize];
        let edge = |to: [f32; 3]| [0, 1, 2].map(|k| to[k] - t.a[k]);
        let mut normal = unit(cross(edge(t.b), edge(t.c)));
        if dot(normal, ray.direction) > 0.0 {
            normal = normal.map(|x| -x);
        }
        let origin = [0, 1, 2].map(|k| ray.origin[k] + hit.t * ray.direction[k] + off * normal[k]);
        if normal.iter().any(|x| !x.is_finite()) || !inside(origin) {
            continue;
        }
        let key = key(number, 0, bounce);
        let to_light = light.point(uniform(key, 0), uniform(key, 1));
        let way = [0, 1, 2].map(|k| to_light[k] - origin[k]);
        if dot(way, normal) > 0.0 {
            next.shadow.push(Ray { origin, t_min: 0.0, direction: unit(way), t_max: 0.9999 * length(way) });
        }
        let direction = unit(cosine_direction(normal, key, 1000));
        next.secondary.push(Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY });
    }
    next
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn length(v: [f32; 3]) -> f32 {
    dot(v, v).sqrt()
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    v.map(|x| x / length(v))
}

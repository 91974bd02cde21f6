//! No ray gets out of a closed surface, at whatever edge or corner it is shot.

use prbvh::build::{MortonBits, lbvh};
use prbvh::bvh::Bvh;
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::scene::SafeRange;
use prbvh::trace::{NO_TRIANGLE, Query, Ray, TraceScene, trace};
use prbvh_kernel::setup::Triangle;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::Random;
use prbvh_tests::rays::ray;

type Point = [f32; 3];

fn add(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|k| a[k] + b[k])
}

/// A closed surface, and points inside of it.
struct Closed {
    name: &'static str,
    triangles: Vec<Triangle>,
    inside: Vec<Point>,
    /// Whether every straight line meets it twice.
    is_convex: bool,
}

/// Two triangles for each cell of a grid whose ends meet.
fn tube(columns: usize, rows: usize, point: impl Fn(f64, f64) -> Point) -> Vec<Triangle> {
    let turn = |k: usize, of: usize| std::f64::consts::TAU * (k % of) as f64 / of as f64;
    let at = |i: usize, j: usize| point(turn(i, columns), turn(j, rows));
    let cell = |k: usize| {
        let (i, j) = (k % columns, k / columns);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [Triangle { a, b, c }, Triangle { a, b: c, c: d }]
    };
    (0..columns * rows).flat_map(cell).collect()
}

fn torus() -> Closed {
    let ring = |u: f64, out: f64, up: f64| [(out * u.cos()) as f32, up as f32, (out * u.sin()) as f32];
    let triangles = tube(24, 9, |u, v| ring(u, 2.0 + 0.7 * v.cos(), 0.7 * v.sin()));
    let inside = (0..4).map(|k| ring(0.3 + f64::from(k), 2.1, 0.15)).collect();
    Closed { name: "torus", triangles, inside, is_convex: false }
}

/// An octahedron, cut `times` in four and blown up.
fn sphere(times: u32) -> Closed {
    let unit = |p: Point| {
        let p = p.map(f64::from);
        let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
        p.map(|x| (x / length) as f32)
    };
    let axis = |k: usize, sign: f32| [0, 1, 2].map(|j| if j == k { sign } else { 0.0 });
    let mut triangles = Vec::new();
    for (x, y, z) in (0..8).map(|k| (k & 1, k & 2, k & 4)) {
        let sign = |bit| if bit == 0 { 1.0 } else { -1.0 };
        triangles.push(Triangle { a: axis(0, sign(x)), b: axis(1, sign(y)), c: axis(2, sign(z)) });
    }
    for _ in 0..times {
        let cut = |t: Triangle| {
            let [ab, bc, ca] = [unit(add(t.a, t.b)), unit(add(t.b, t.c)), unit(add(t.c, t.a))];
            [[t.a, ab, ca], [ab, t.b, bc], [ca, bc, t.c], [ab, bc, ca]].map(|[a, b, c]| Triangle { a, b, c })
        };
        triangles = triangles.into_iter().flat_map(cut).collect();
    }
    let inside = vec![[0.0; 3], [0.1, -0.2, 0.3], [-0.5, 0.25, 0.5], [0.01, 0.7, 0.0]];
    Closed { name: "sphere", triangles, inside, is_convex: true }
}

/// Two tips over a polygon of so many sides: thin triangles, all of them at two corners.
fn spindle(sides: usize) -> Closed {
    let tips = [[0.0, 3.0, 0.0], [0.0, -3.0, 0.0]];
    let rim = |k: usize| {
        let turn = std::f64::consts::TAU * (k % sides) as f64 / sides as f64;
        [turn.cos() as f32, 0.0, turn.sin() as f32]
    };
    let side = |k: usize| tips.map(|tip| Triangle { a: rim(k), b: rim(k + 1), c: tip });
    let inside = vec![[0.0; 3], [0.2, 0.5, -0.3], [-0.1, -1.0, 0.1]];
    Closed { name: "spindle", triangles: (0..sides).flat_map(side).collect(), inside, is_convex: true }
}

impl Closed {
    /// Turned, so that no face lies along an axis, moved, and scaled; every corner is rounded once.
    fn placed(self, scale: f64, at: [f64; 3]) -> Self {
        let work = |p: Point| {
            let [x, y, z] = p.map(f64::from);
            let [x, y] = [0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y];
            let [y, z] = [5.0 / 13.0 * y - 12.0 / 13.0 * z, 12.0 / 13.0 * y + 5.0 / 13.0 * z];
            [x * scale + at[0], y * scale + at[1], z * scale + at[2]].map(|x| x as f32)
        };
        let triangles = self.triangles.iter().map(|t| Triangle { a: work(t.a), b: work(t.b), c: work(t.c) });
        Self { triangles: triangles.collect(), inside: self.inside.into_iter().map(work).collect(), ..self }
    }

    /// Rays that must hit: from inside at every corner, at two points of every edge, and next to both.
    fn rays(&self) -> Vec<Ray> {
        let mut random = Random(21);
        let mut rays = Vec::new();
        for &origin in &self.inside {
            for t in &self.triangles {
                for (p, q) in [(t.a, t.b), (t.b, t.c), (t.c, t.a)] {
                    let part = random.unit();
                    let middle = [0, 1, 2].map(|k| 0.5 * (p[k] + q[k]));
                    let other = [0, 1, 2].map(|k| p[k] + part * (q[k] - p[k]));
                    let beside = p.map(|x| f32::from_bits(x.to_bits() ^ (random.bits() & 1) as u32));
                    rays.extend([p, middle, other, beside].map(|target| ray(origin, target)));
                }
            }
        }
        if self.is_convex {
            // From outside through a corner on this side: straight through the middle, and from the side of that.
            let [middle, aside, ..] = self.inside[..] else { return rays };
            for t in &self.triangles {
                for target in [t.a, t.b, t.c] {
                    let out = |from: Point| [0, 1, 2].map(|k| target[k] + (target[k] - from[k]));
                    rays.extend([middle, aside].map(|from| ray(out(from), target)));
                }
            }
        }
        rays.retain(|ray| ray.direction != [0.0; 3]);
        rays
    }
}

fn tree(triangles: &[Triangle]) -> Bvh {
    let mut device = CpuDevice::new(2).unwrap();
    let working = SafeRange::of(triangles).apply(triangles);
    let (tree, _) = lbvh(&mut device, &working, MortonBits::Sixty).unwrap();
    Bvh::from_device(&tree.download(&mut device).unwrap()).unwrap().with_boxes_of(triangles)
}

/// Rays that hit nothing.
fn leaks(device: &mut dyn Device, tree: &Bvh, triangles: &[Triangle], rays: &[Ray], query: Query) -> Vec<usize> {
    let starts: Vec<Point> = rays.iter().map(|ray| ray.origin).collect();
    let mut scene = TraceScene::new(device, tree, triangles, &starts).unwrap();
    let (hits, _) = trace(device, &mut scene, rays, query).unwrap();
    scene.free(device);
    (0..hits.len()).filter(|&k| hits[k].triangle == NO_TRIANGLE).collect()
}

/// Möller & Trumbore 1997 as it is often written, in f32: not watertight.
fn usual_test(ray: &Ray, t: &Triangle) -> bool {
    let minus = |a: Point, b: Point| [0, 1, 2].map(|k| a[k] - b[k]);
    let cross =
        |a: Point, b: Point| [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]);
    let dot = |a: Point, b: Point| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (e1, e2) = (minus(t.b, t.a), minus(t.c, t.a));
    let p = cross(ray.direction, e2);
    let inverse = 1.0 / dot(e1, p);
    let s = minus(ray.origin, t.a);
    let u = inverse * dot(s, p);
    let q = cross(s, e1);
    let v = inverse * dot(ray.direction, q);
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && inverse * dot(e2, q) > 0.0
}

#[test]
fn no_ray_gets_out() {
    let places = [(1.0, [0.0; 3]), (1.0, [1234.5, -77.7, 3e4]), (1e-3, [0.3, 0.2, 0.1]), (1e9, [1e10, 0.0, -3e9])];
    for (scale, at) in places {
        let mut usual = 0;
        for closed in [sphere(2), torus(), spindle(200)].map(|closed| closed.placed(scale, at)) {
            let what = format!("{} at {at:?}, times {scale:e}", closed.name);
            let rays = closed.rays();
            let tree = tree(&closed.triangles);
            with_devices(|devices| {
                for (name, device) in devices {
                    for query in [Query::Closest, Query::Any] {
                        let out = leaks(&mut **device, &tree, &closed.triangles, &rays, query);
                        let first = out.first().map(|&k| rays[k]);
                        assert!(out.is_empty(), "{what}, {name}: {} of {} rays, {first:?}", out.len(), rays.len());
                    }
                }
            });
            // The rays are hard: the usual test loses some. Every tenth will do.
            let misses = |ray: &&Ray| !closed.triangles.iter().any(|t| usual_test(ray, t));
            usual += rays.iter().step_by(10).filter(misses).count();
        }
        assert!(usual > 5, "only {usual} rays get through the usual test at {at:?}");
    }
}

#[test]
fn a_missing_triangle_is_noticed() {
    let closed = sphere(2).placed(1.0, [10.0, 20.0, 30.0]);
    let mut rays = closed.rays();
    rays.truncate(closed.triangles.len() * 12);
    let mut device = CpuDevice::new(2).unwrap();
    for k in [0, 17, 100] {
        let mut open = closed.triangles.clone();
        open.remove(k);
        let tree = tree(&open);
        assert!(!leaks(&mut device, &tree, &open, &rays, Query::Closest).is_empty(), "triangle {k}");
    }
}

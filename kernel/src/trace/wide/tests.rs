//! What is computed side by side has the bits of what is computed one by one.

use super::native::{Group, NodesAtOnce, walk_on};
use super::{Bvh4Node, Bvh8Node, CwbvhNode, LOCAL_WORDS, NO_CHILD, WideNodes, octant};
use crate::ray::{Hit, Prepared, Ray};
use crate::trace::stack::LocalStack;
use crate::trace::{LEAF, Nodes, TraceParams, TraceTriangle, Walk};
use bytemuck::Zeroable;
use fearless_simd::{Level, Simd, dispatch};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn word(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 32) as u32
    }

    fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.word() as usize % of.len()]
    }

    /// From -1 to 1.
    fn unit(&mut self) -> f32 {
        (self.word() >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    /// A coordinate of the trace range; extreme ones and equal ones are frequent.
    fn coordinate(&mut self) -> f32 {
        const EXTREME: [f32; 8] =
            [0.0, -0.0, 2147483520.0, -2147483520.0, 1.0, -1.0, 1.0 / 33_554_432.0, 1_073_741_824.0];
        match self.word() % 4 {
            0 => self.one_of(&EXTREME),
            1 => self.unit(),
            _ => self.unit() * 1_073_741_824.0,
        }
    }

    fn ray(&mut self) -> Ray {
        const COMPONENTS: [f32; 6] = [0.0, -0.0, 1.0, -1.0, 1.0 / 16_777_216.0, -1.0 / 16_777_216.0];
        let is_extreme = self.word().is_multiple_of(3);
        let mut component = || if is_extreme { self.one_of(&COMPONENTS) } else { self.unit() };
        let direction = [component(), component(), component()];
        let direction = if direction.map(|x| x == 0.0) == [true; 3] { [0.0, 0.0, -1.0] } else { direction };
        let origin = [self.coordinate(), self.coordinate(), self.coordinate()];
        let t_min = self.one_of(&[0.0, 0.0, 1.0, 1e9]);
        let t_max = self.one_of(&[f32::INFINITY, 17_179_869_184.0, 1e9, 0.0]);
        Ray { origin, t_min, direction, t_max }
    }

    /// Both ends of a side of a box, around the origin of a ray more often than not.
    fn side(&mut self, origin: f32) -> [f32; 2] {
        let [a, b] = match self.word() % 4 {
            0 => [self.coordinate(), self.coordinate()],
            1 => [origin, origin],
            2 => [origin, self.coordinate()],
            _ => [origin - 1e9 * (1.0 + self.unit()), origin + 1e9 * (1.0 + self.unit())],
        };
        if a <= b { [a, b] } else { [b, a] }
    }
}

/// Those of this processor: the plain one and the one that is taken.
fn levels() -> [Level; 2] {
    [Level::baseline(), Level::new()]
}

/// Slots that a ray enters in the order in which it visits them.
fn one_by_one<N: WideNodes + ?Sized>(nodes: &N, ray: &Ray) -> Vec<u32> {
    let octant = octant(ray.direction);
    let mut word = nodes.entered(0, &Prepared::new(ray), octant, ray.t_max);
    let mut slots = Vec::new();
    while word != 0 {
        let (slot, rest) = N::first(word, octant);
        slots.push(slot);
        word = rest;
    }
    slots
}

/// The same by vectors.
fn at_once<S: Simd, N: NodesAtOnce + ?Sized>(simd: S, nodes: &N, ray: &Ray) -> Vec<u32> {
    let mut group = nodes.group(simd, 0, &Prepared::new(ray), ray.t_max);
    let mut slots = Vec::new();
    while !group.is_empty() {
        slots.extend(group.take(octant(ray.direction), ray.t_max));
    }
    slots
}

macro_rules! soa {
    ($test:ident, $node:ident, $width:literal) => {
        #[test]
        fn $test() {
            let mut random = Random($width);
            let mut several = 0;
            let rounds = if cfg!(miri) { 50 } else { 100_000 };
            for _ in 0..rounds {
                let ray = random.ray();
                let mut node = $node::zeroed();
                for k in 0..$width {
                    let is_empty = random.word() % 5 == 0;
                    node.child[k] = if is_empty { NO_CHILD } else { random.word() >> 1 };
                    if !is_empty {
                        [node.min_x[k], node.max_x[k]] = random.side(ray.origin[0]);
                        [node.min_y[k], node.max_y[k]] = random.side(ray.origin[1]);
                        [node.min_z[k], node.max_z[k]] = random.side(ray.origin[2]);
                    }
                }
                let nodes = [node];
                let expected = one_by_one(&nodes[..], &ray);
                for level in levels() {
                    let found = dispatch!(level, simd => at_once(simd, &nodes[..], &ray));
                    assert_eq!(found, expected, "{level:?}, {ray:?}, {node:?}");
                }
                several += u32::from(expected.len() > 1);
            }
            assert!(several > rounds / 20, "{several}");
        }
    };
}

soa!(four_boxes_at_once, Bvh4Node, 4);
soa!(eight_boxes_at_once, Bvh8Node, 8);

#[test]
fn eight_compressed_boxes_at_once() {
    let mut random = Random(80);
    let mut words = std::collections::BTreeSet::new();
    for _ in 0..if cfg!(miri) { 50 } else { 100_000 } {
        let ray = random.ray();
        let corner = ray.origin.map(|x| x - 1e9 * (1.0 + random.unit()));
        let mut two = || [random.word(), random.word()];
        let mut node = CwbvhNode {
            origin: corner.map(f32::to_bits),
            meta: two(),
            min_x: two().map(|q| q & 0x3f3f_3f3f),
            max_x: two().map(|q| q | 0x4040_4040),
            min_y: two().map(|q| q & 0x3f3f_3f3f),
            max_y: two().map(|q| q | 0x4040_4040),
            min_z: two().map(|q| q & 0x3f3f_3f3f),
            max_z: two().map(|q| q | 0x4040_4040),
            ..CwbvhNode::default()
        };
        for slot in 0..8 {
            if random.word().is_multiple_of(4) {
                node.meta[slot / 4] &= !(0xff << (8 * (slot % 4)));
            }
        }
        node.scales_and_inner =
            random.one_of(&[0x96_96_96, 0x95_97_96, 0x01_96_96, 0x9d_9d_9d]) | (random.word() << 24);
        let nodes = [node];
        let expected = one_by_one(&nodes[..], &ray);
        for level in levels() {
            let found = dispatch!(level, simd => at_once(simd, &nodes[..], &ray));
            assert_eq!(found, expected, "{level:?}, {ray:?}, {node:?}");
        }
        words.insert(expected);
    }
    assert!(words.len() > if cfg!(miri) { 5 } else { 200 }, "{words:?}");
}

/// Whatever a ray enters by the boxes as they are, it enters by their steps.
#[test]
fn steps_lose_no_box() {
    let mut random = Random(81);
    let mut entered = [0, 0];
    for _ in 0..if cfg!(miri) { 50 } else { 100_000 } {
        let ray = random.ray();
        let prepared = Prepared::new(&ray);
        // Multiples of the step, so that the box has no rounding.
        let exponent = random.one_of(&[140u32, 145, 149]);
        let step = f32::from_bits(exponent << 23);
        let t = 1e9 * (1.0 + random.unit());
        let corner = [0, 1, 2].map(|k| ((ray.origin[k] + t * ray.direction[k]) / step - 128.0).round() * step);
        let q = [0, 1, 2].map(|_| {
            let (a, b) = (random.word() % 160, 96 + random.word() % 160);
            [a.min(b) as f32, a.max(b) as f32]
        });
        let face = |k: usize, side: usize| corner[k] + q[k][side] * step;
        let aabb =
            crate::aabb::Aabb { min: [face(0, 0), face(1, 0), face(2, 0)], max: [face(0, 1), face(1, 1), face(2, 1)] };
        let near = prepared.enters(&aabb, ray.t_max);
        let steps = prepared.steps(corner, [step; 3]);
        let by_steps = prepared.enters_steps(&steps, q.map(|q| q[0]), q.map(|q| q[1]), ray.t_max);
        assert!(by_steps <= near, "{ray:?}, {aabb:?}: {by_steps} is not at most {near}");
        entered[usize::from(near < f32::INFINITY)] += 1;
    }
    assert!(cfg!(miri) || entered.into_iter().all(|count| count > 5_000), "{entered:?}");
}

#[test]
fn edges_at_once() {
    let mut random = Random(3);
    let mut hits = 0;
    for _ in 0..if cfg!(miri) { 50 } else { 200_000 } {
        let ray = random.ray();
        let prepared = Prepared::new(&ray);
        let mut corner = || match random.word() % 3 {
            0 => [random.coordinate(), random.coordinate(), random.coordinate()],
            _ => [0, 1, 2].map(|k| ray.origin[k] + 1e9 * (ray.direction[k] + 0.3 * random.unit())),
        };
        let corners = [corner(), corner(), corner()];
        let corners = if random.word().is_multiple_of(8) { [corners[0], corners[1], corners[1]] } else { corners };
        let expected = prepared.hits(corners, ray.t_max);
        let id = random.one_of(&[0, 1, u32::MAX >> 1]);
        let found = TraceTriangle::new(id, corners).hit(&prepared, ray.t_max);
        assert_eq!(found.to_bits(), expected.to_bits(), "{ray:?}, {corners:?}");
        hits += u32::from(expected < f32::INFINITY);
    }
    assert!(cfg!(miri) || hits > 5_000, "{hits}");
}

#[test]
fn four_triangles_at_once() {
    let mut random = Random(4);
    let mut counts = [0; 2];
    for _ in 0..if cfg!(miri) { 20 } else { 50_000 } {
        let ray = random.ray();
        let prepared = Prepared::new(&ray);
        let mut triangle = || {
            let mut corner = || [0, 1, 2].map(|k| ray.origin[k] + 1e9 * (ray.direction[k] + 0.3 * random.unit()));
            TraceTriangle::new(u32::MAX >> 1, [corner(), corner(), corner()])
        };
        let four = [triangle(), triangle(), triangle(), triangle()];
        for level in levels() {
            let may_hit = dispatch!(level, simd => prepared.may_hit(simd, four.each_ref().map(bytemuck::cast_ref)));
            for (k, triangle) in four.iter().enumerate() {
                let expected = !prepared.misses(bytemuck::cast_ref(triangle));
                assert_eq!(may_hit & (1 << k) != 0, expected, "{level:?}, {ray:?}, {triangle:?}");
                counts[usize::from(expected)] += 1;
            }
        }
    }
    assert!(cfg!(miri) || counts.into_iter().all(|count| count > 5_000), "{counts:?}");
}

/// The walk of a processor has the hits and the counts of that of a GPU.
#[test]
fn walks_agree() {
    let mut random = Random(5);
    let mut triangles = Vec::new();
    let mut nodes = vec![Bvh8Node::zeroed(); 9];
    for k in 0..8 {
        let middle = [0, 1, 2].map(|_| 1e9 * random.unit());
        for slot in 0..8 {
            let (first, count) = (triangles.len() as u32, 1 + random.word() % 9);
            for _ in 0..count {
                let mut corner = || middle.map(|x| x + 3e8 * random.unit());
                triangles.push(TraceTriangle::new(triangles.len() as u32, [corner(), corner(), corner()]));
            }
            triangles.last_mut().expect("one at least").is_last = 1;
            let leaf = &triangles[first as usize..];
            set_slot(&mut nodes[1 + k], slot, (first | LEAF, count), leaf);
        }
        let all = &triangles[(nodes[1 + k].child[0] & !LEAF) as usize..];
        set_slot(&mut nodes[0], k, (1 + k as u32, 0), all);
    }
    let mut hits = 0;
    for _ in 0..if cfg!(miri) { 10 } else { 20_000 } {
        let ray = random.ray();
        let ray = Ray { origin: ray.origin.map(|x| x * 0.5), ..ray };
        for any in [0, 1] {
            let params = TraceParams { count: 1, first: 0, root: 0, any, resumes: 0 };
            let mut stack = LocalStack::<LOCAL_WORDS>::new();
            let start = Walk::start(&params, &ray);
            let expected: Hit = nodes[..].walk(&params, &ray, &triangles, &mut stack, start).result(&params);
            for level in levels() {
                let found = walk_on(level, &params, &ray, &nodes[..], &triangles).result(&params);
                assert_eq!(found, expected, "{level:?}, {any}, {ray:?}");
            }
            hits += u32::from(expected.triangle != crate::ray::NO_TRIANGLE);
        }
    }
    assert!(cfg!(miri) || hits > 2_000, "{hits}");
}

fn set_slot(node: &mut Bvh8Node, slot: usize, (child, count): (u32, u32), triangles: &[TraceTriangle]) {
    let least = |row: fn(&TraceTriangle) -> [f32; 3]| triangles.iter().flat_map(row).fold(f32::INFINITY, f32::min);
    let most = |row: fn(&TraceTriangle) -> [f32; 3]| triangles.iter().flat_map(row).fold(f32::NEG_INFINITY, f32::max);
    [node.min_x[slot], node.max_x[slot]] = [least(|t| t.x), most(|t| t.x)];
    [node.min_y[slot], node.max_y[slot]] = [least(|t| t.y), most(|t| t.y)];
    [node.min_z[slot], node.max_z[slot]] = [least(|t| t.z), most(|t| t.z)];
    (node.child[slot], node.count[slot]) = (child, count);
}

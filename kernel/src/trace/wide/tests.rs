//! What is computed side by side has the bits of what is computed one by one.

use super::{Bvh4Node, Bvh8Node, CwbvhNode, NO_CHILD, WideNodes, octant};
use crate::ray::{Prepared, Ray};
use crate::trace::TraceTriangle;

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

macro_rules! soa {
    ($test:ident, $node:ident, $width:literal) => {
        #[test]
        fn $test() {
            let mut random = Random($width);
            let mut several = 0;
            let rounds = if cfg!(miri) { 50 } else { 100_000 };
            for _ in 0..rounds {
                let ray = random.ray();
                let mut node: $node = bytemuck::Zeroable::zeroed();
                for k in 0..$width {
                    let is_empty = random.word() % 5 == 0;
                    node.child[k] = if is_empty { NO_CHILD } else { random.word() >> 1 };
                    if !is_empty {
                        [node.min_x[k], node.max_x[k]] = random.side(ray.origin[0]);
                        [node.min_y[k], node.max_y[k]] = random.side(ray.origin[1]);
                        [node.min_z[k], node.max_z[k]] = random.side(ray.origin[2]);
                    }
                }
                let prepared = Prepared::new(&ray);
                let expected = node.entered_one_by_one(&prepared, ray.t_max);
                assert_eq!(node.entered_at_once(&prepared, ray.t_max), expected, "{ray:?}, {node:?}");
                several += u32::from(expected > 0xff);
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
        let (prepared, octant) = (Prepared::new(&ray), octant(ray.direction));
        let steps = node.steps(&prepared);
        let expected = (0..8u32)
            .filter(|&slot| node.enters(slot, &prepared, &steps, ray.t_max))
            .fold(0, |word, slot| word | 1 << (slot ^ octant));
        let nodes = [node];
        assert_eq!(nodes[..].entered(0, &prepared, octant, ray.t_max), expected, "{ray:?}, {node:?}");
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

//! Small scenes made from a seed.

use prbvh::scene::{SafeRange, built_in};
use prbvh_kernel::setup::Triangle;
use proptest::prelude::*;

/// Random numbers from a seed (splitmix64).
#[derive(Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A float in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// A point in the cube [0, size)³.
    pub fn point(&mut self, size: f32) -> [f32; 3] {
        [self.unit() * size, self.unit() * size, self.unit() * size]
    }
}

/// `count` triangles of edge about `size` in the unit cube.
#[must_use]
pub fn soup(count: usize, size: f32, seed: u64) -> Vec<Triangle> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let at = random.point(1.0);
            let mut corner = || {
                let offset = random.point(size);
                [at[0] + offset[0], at[1] + offset[1], at[2] + offset[2]]
            };
            Triangle { a: corner(), b: corner(), c: corner() }
        })
        .collect()
}

/// Equal right triangles side by side in a square of `side` rows: exact ties everywhere.
#[must_use]
pub fn grid(side: u16) -> Vec<Triangle> {
    let cell = |k: u16| {
        let [x, y] = [f32::from(k % side), f32::from(k / side)];
        Triangle { a: [x, y, 0.0], b: [x + 1.0, y, 0.0], c: [x, y + 1.0, 0.0] }
    };
    (0..side * side).map(cell).collect()
}

/// The triangles in working coordinates.
#[must_use]
pub fn working(triangles: &[Triangle]) -> Vec<Triangle> {
    SafeRange::of(triangles).apply(triangles)
}

/// Triangles around one centre, each larger than the one before.
#[must_use]
pub fn nested(count: usize) -> Vec<Triangle> {
    let triangle = |k: usize| {
        let s = 1.0 + k as f32 * 1e-3;
        Triangle { a: [-s, -s, -s], b: [s, s, s], c: [s, -s, s] }
    };
    (0..count).map(triangle).collect()
}

/// Triangles in one plane across an axis.
#[must_use]
pub fn flat(count: usize) -> Vec<Triangle> {
    let press = |p: [f32; 3]| [p[0], 0.25, p[2]];
    soup(count, 0.2, 5).iter().map(|t| Triangle { a: press(t.a), b: press(t.b), c: press(t.c) }).collect()
}

/// Inputs with a name each, small and large, kind and unkind.
#[must_use]
pub fn inputs() -> Vec<(&'static str, Vec<Triangle>)> {
    let equal = vec![soup(1, 0.3, 2)[0]; 1000];
    let point = Triangle { a: [0.5; 3], b: [0.5; 3], c: [0.5; 3] };
    let mut decades = soup(300, 0.1, 3);
    for (k, t) in decades.iter_mut().enumerate() {
        let scale = 10f32.powi(-(k as i32 % 8));
        *t = Triangle { a: t.a.map(|x| x * scale), b: t.b.map(|x| x * scale), c: t.c.map(|x| x * scale) };
    }
    let pairs = soup(400, 0.1, 4).into_iter().flat_map(|t| [t, t]).collect();
    vec![
        ("one", soup(1, 0.3, 1)),
        ("two", soup(2, 0.3, 1)),
        ("three", soup(3, 0.3, 1)),
        ("soup", soup(1500, 0.1, 1)),
        ("equal", equal),
        ("points", vec![point; 77]),
        ("flat", flat(700)),
        ("eight decades", decades),
        ("pairs", pairs),
        ("nested", nested(900)),
        ("built-in", built_in(2000).triangles),
    ]
}

/// Fewer than `count` triangles with coordinates from a small grid: duplicates, flat and empty boxes, exact ties.
pub fn on_a_lattice(count: usize) -> impl Strategy<Value = Vec<Triangle>> {
    let triangle = prop::array::uniform9(0u8..4).prop_map(|c| {
        let c = c.map(f32::from);
        Triangle { a: [c[0], c[1], c[2]], b: [c[3], c[4], c[5]], c: [c[6], c[7], c[8]] }
    });
    prop::collection::vec(triangle, 1..count)
}

/// Fewer than `count` triangles, two at least, with sizes over 60 powers of two; and the seed that they are from.
pub fn stiff(count: usize) -> impl Strategy<Value = (Vec<Triangle>, u64)> {
    (any::<u64>(), prop::collection::vec(-30i32..30, 2..count)).prop_map(|(seed, exponents)| {
        let mut triangles = soup(exponents.len(), 0.5, seed);
        for (t, &exponent) in triangles.iter_mut().zip(&exponents) {
            let scale = |p: [f32; 3]| p.map(|x| x * 2f32.powi(exponent));
            *t = Triangle { a: scale(t.a), b: scale(t.b), c: scale(t.c) };
        }
        (triangles, seed)
    })
}

//! Small scenes made from a seed.

use prbvh_kernel::setup::Triangle;

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

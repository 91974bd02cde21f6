//! Reads of 32-byte nodes in random order: what the memory of a machine gives to a walk through a tree.

use crate::fixtures::Random;
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

/// As large as a node, and aligned like one in a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Cell([u32; 8]);

/// Seconds per read and thread, all threads of the current pool reading.
#[derive(Clone, Copy, Debug)]
pub struct ReadTimes {
    /// Each read needs the one before: the latency.
    pub dependent_s: f64,
    /// Reads whose places are known beforehand: what the memory gives at most.
    pub independent_s: f64,
}

/// Cells of which each names the next, in one random cycle through all (Sattolo 1986).
#[must_use]
pub fn cycle(cells: usize) -> Vec<Cell> {
    let mut order: Vec<u32> = (0..cells as u32).collect();
    let mut random = Random(1);
    for k in (1..cells).rev() {
        order.swap(k, (random.bits() % k as u64) as usize);
    }
    order.into_iter().map(|next| Cell([next, 0, 0, 0, 0, 0, 0, next])).collect()
}

/// Reads `reads` cells per thread.
#[must_use]
pub fn read_times(cells: &[Cell], reads: usize) -> ReadTimes {
    let threads = rayon::current_num_threads();
    let timed = |walk: &(dyn Fn(usize) -> u32 + Sync)| {
        let start = Instant::now();
        black_box((0..threads).into_par_iter().with_max_len(1).map(walk).reduce(|| 0, u32::wrapping_add));
        start.elapsed().as_secs_f64() / reads as f64
    };
    let dependent = |thread: usize| {
        let mut at = cells.len() / threads * thread;
        // Both ends of the cell.
        (0..reads).for_each(|_| at = (cells[at].0[0] & cells[at].0[7]) as usize);
        at as u32
    };
    let independent = |thread: usize| {
        let (mut state, mut sum) = (thread as u64 * 0x9e37_79b9 + 1, 0u32);
        for _ in 0..reads {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let cell = &cells[(((state >> 32) * cells.len() as u64) >> 32) as usize];
            sum = sum.wrapping_add(cell.0[0] ^ cell.0[7]);
        }
        sum
    };
    ReadTimes { dependent_s: timed(&dependent), independent_s: timed(&independent) }
}

/// Bytes per second that all threads of the current pool read, each its share from front to back, `passes` times.
#[must_use]
pub fn bandwidth(cells: &[Cell], passes: usize) -> f64 {
    let sum = |share: &[Cell]| {
        (0..passes).fold([0u32; 8], |sum, _| {
            black_box(share).iter().fold(sum, |sum, cell| std::array::from_fn(|k| sum[k] ^ cell.0[k]))
        })
    };
    let start = Instant::now();
    let shares = cells.par_chunks(cells.len().div_ceil(rayon::current_num_threads())).map(sum);
    black_box(shares.reduce(|| [0; 8], |a, b| std::array::from_fn(|k| a[k] ^ b[k])));
    (passes * size_of_val(cells)) as f64 / start.elapsed().as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cycle_goes_through_all_cells() {
        for length in [1, 2, 3, 1000] {
            let cells = cycle(length);
            let mut at = 0;
            let mut seen = vec![false; length];
            for _ in 0..length {
                assert!(!std::mem::replace(&mut seen[at], true), "{length}: {at} again");
                at = cells[at].0[0] as usize;
            }
            assert_eq!(at, 0, "{length}");
        }
    }

    #[test]
    fn reads_take_time() {
        let cells = cycle(1 << 12);
        let times = read_times(&cells, 100_000);
        assert!(times.dependent_s > 0.0 && times.independent_s > 0.0 && times.dependent_s < 1e-5, "{times:?}");
        assert!(bandwidth(&cells, 100) > 1e6);
    }
}

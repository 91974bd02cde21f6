//! The order of the invocations of a dispatch.

use prbvh_kernel::native::Dispatcher;
use rayon::prelude::*;
use std::sync::Arc;

/// In which order a dispatch runs its invocations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// One thread, from 0 upward.
    Ascending,
    /// One thread, from the last downward.
    Descending,
    /// One thread, in a random order made from the seed.
    Shuffled(u64),
    /// Many threads.
    Parallel,
}

#[derive(Debug)]
pub(crate) struct Executor {
    order: Order,
    /// None for that from which work comes.
    pool: Option<Arc<rayon::ThreadPool>>,
}

impl Executor {
    pub(crate) fn new(order: Order, threads: usize) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = match order {
            Order::Parallel => Some(Arc::new(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?)),
            _ => None,
        };
        Ok(Self { order, pool })
    }

    pub(crate) fn in_pool(pool: Arc<rayon::ThreadPool>) -> Self {
        Self { order: Order::Parallel, pool: Some(pool) }
    }

    pub(crate) fn in_this_pool() -> Self {
        Self { order: Order::Parallel, pool: None }
    }

    pub(crate) fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    pub(crate) fn threads(&self) -> usize {
        if self.order == Order::Parallel { self.install(rayon::current_num_threads) } else { 1 }
    }
}

impl Dispatcher for Executor {
    fn for_each(&self, count: u32, grain: u32, invocation: impl Fn(u32) + Sync + Send) {
        match self.order {
            Order::Descending => (0..count).rev().for_each(invocation),
            Order::Shuffled(seed) => shuffled(count, seed).into_iter().for_each(invocation),
            Order::Parallel if count >= 2 * grain => {
                let invocations = (0..count).into_par_iter().with_min_len(grain as usize);
                self.install(|| invocations.for_each(invocation));
            }
            Order::Ascending | Order::Parallel => (0..count).for_each(invocation),
        }
    }

    /// Where speed counts: a thread takes a workgroup at a time.
    fn is_alone(&self) -> bool {
        self.order == Order::Parallel
    }

    fn for_each_lane(&self, count: u32, turn: u64, lane: impl Fn(u32)) {
        match self.order {
            Order::Descending => (0..count).rev().for_each(lane),
            Order::Shuffled(seed) => {
                shuffled(count, seed ^ turn.wrapping_mul(0x2545_f491_4f6c_dd1d)).into_iter().for_each(lane);
            }
            Order::Ascending | Order::Parallel => (0..count).for_each(lane),
        }
    }
}

/// The numbers below `count` in a random order (Fisher–Yates, splitmix64).
fn shuffled(count: u32, seed: u64) -> Vec<u32> {
    let mut numbers: Vec<u32> = (0..count).collect();
    let mut state = seed;
    for last in (1..numbers.len()).rev() {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let random = z ^ (z >> 31);
        let pick = ((u128::from(random) * (last as u128 + 1)) >> 64) as usize;
        numbers.swap(last, pick);
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[test]
    fn every_order_runs_every_invocation_once() {
        for order in [Order::Ascending, Order::Descending, Order::Shuffled(3), Order::Parallel] {
            let executor = Executor::new(order, 3).unwrap();
            for count in [0, 1, 2, 1000] {
                let runs: Vec<AtomicU32> = (0..count).map(|_| AtomicU32::new(0)).collect();
                executor.for_each(count, 1, |i| {
                    runs[i as usize].fetch_add(1, Ordering::Relaxed);
                });
                assert!(runs.iter().all(|runs| runs.load(Ordering::Relaxed) == 1), "{order:?}, {count}");
            }
        }
    }

    #[test]
    fn seeds_shuffle_differently() {
        assert_ne!(shuffled(100, 1), shuffled(100, 2));
        assert_ne!(shuffled(100, 1), (0..100).collect::<Vec<_>>());
    }
}

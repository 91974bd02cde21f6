//! Work that is counted, told, and ended early.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// How far a measurement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EpoProgress {
    /// Whether exact is too long, so that triangles are drawn.
    pub is_sampled: bool,
    /// Triangles measured so far.
    pub done: u64,
    /// Triangles to measure.
    pub of: u64,
}

/// Why there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Cancelled,
    OverBudget,
}

/// Tests between two looks at the observer: a few hundredths of a second.
const TOLD_EVERY: u64 = 1 << 17;

/// Counts tests on all threads.
pub(super) struct Watch<'a> {
    budget: u64,
    observe: &'a (dyn Fn(EpoProgress) -> ControlFlow<()> + Sync),
    is_sampled: AtomicBool,
    of: AtomicU64,
    done: AtomicU64,
    tests: AtomicU64,
    told_at: AtomicU64,
    is_cancelled: AtomicBool,
}

impl<'a> Watch<'a> {
    pub(super) fn new(budget: u64, observe: &'a (dyn Fn(EpoProgress) -> ControlFlow<()> + Sync)) -> Self {
        let zero = || AtomicU64::new(0);
        let [of, done, tests, told_at] = [zero(), zero(), zero(), zero()];
        let no = || AtomicBool::new(false);
        Self { budget, observe, is_sampled: no(), of, done, tests, told_at, is_cancelled: no() }
    }

    /// Starts to count triangles, `of` in all.
    pub(super) fn begins(&self, is_sampled: bool, of: usize) {
        self.is_sampled.store(is_sampled, Relaxed);
        self.of.store(of as u64, Relaxed);
        self.done.store(0, Relaxed);
    }

    pub(super) fn tests(&self) -> u64 {
        self.tests.load(Relaxed)
    }

    /// A triangle took so many tests. Over budget for one triangle at least if, and only if, all together are, in whatever order they come.
    pub(super) fn has_done(&self, tests: u64) -> Result<(), End> {
        let done = self.done.fetch_add(1, Relaxed) + 1;
        let tests = self.tests.fetch_add(tests, Relaxed) + tests;
        let told_at = self.told_at.load(Relaxed);
        if tests - told_at.min(tests) >= TOLD_EVERY
            && self.told_at.compare_exchange(told_at, tests, Relaxed, Relaxed).is_ok()
        {
            let (is_sampled, of) = (self.is_sampled.load(Relaxed), self.of.load(Relaxed));
            if (self.observe)(EpoProgress { is_sampled, done, of }).is_break() {
                self.is_cancelled.store(true, Relaxed);
            }
        }
        if self.is_cancelled.load(Relaxed) {
            Err(End::Cancelled)
        } else if tests > self.budget {
            Err(End::OverBudget)
        } else {
            Ok(())
        }
    }
}

//! What one invocation does between the dispatches of many: lengths of lists, the sum of the areas, whether there is another round.
//!
//! Kind: a single invocation, on one of the [pages](RoundParams::page).

use super::RoundParams;
use super::hurry;
use super::verdict;
use super::words::list_in_turn;
pub use super::words::*;
use crate::mem::AtomicU32;
use crate::node::ROOT;
use crate::status::{self, FAULT_BROKEN_TREE, FAULTS, FRINGE, GREW, MARKED, REFITTED, SHRUNK};
use crate::sum::Sum;

/// Nodes of the pool that one invocation looks at.
pub const CHUNK: u32 = 32;

/// Most stages: below the last one areas are so small a part of the root's that a sum does not see them.
pub const MOST_STAGES: u32 = 24;

/// Page on which a run begins, or begins again: an empty pool, and the root is the fringe.
pub const BEGIN: u32 = 0;
/// Page at the end of a round.
pub const CLOSE: u32 = 1;
/// Page of a new best tree that others have measured.
pub const BEST: u32 = 2;
/// Page on which rounds that have ended go on.
pub const RESUME: u32 = 3;

/// A [flag](RoundParams::flags): nodes are selected.
pub const SELECTS: u32 = 8;
/// Nodes that get their keys are listed.
pub const LISTS: u32 = 16;

/// Writes the page `params.page`.
#[inline(always)]
pub fn books(params: &RoundParams, books: &[AtomicU32], fringe: &[AtomicU32], report: &[AtomicU32]) {
    if params.page == BEGIN {
        begin(params, books, fringe);
    } else if params.page == RESUME {
        resume(params, books);
    } else if params.page == BEST {
        Sum::load(books, LOST).store(books, MOST_LOST);
        books[EPOCH].add(1);
    } else if books[STOPPED].load() == 0 {
        // Nothing follows the end.
        close(params, books, report);
    }
}

/// One in two to this power of the nodes of a pool is counted: of a large pool a part tells enough, and all threads count in the same few words. Which
/// are counted has nothing to do with whose turn it is.
#[inline(always)]
pub(in crate::prbvh) fn thinning(length: u32) -> u32 {
    let mut thinning = 0;
    while thinning < 4 && length >> thinning > 4096 {
        thinning += 1;
    }
    thinning
}

#[inline(always)]
pub(in crate::prbvh) fn begin(params: &RoundParams, books: &[AtomicU32], fringe: &[AtomicU32]) {
    for word in 0..EPOCH as u32 {
        books[word as usize].store(0);
    }
    if books[EPOCH].load() == 0 {
        books[EPOCH].store(1);
    }
    run_over(books, OVER_LIST, 0);
    run_over(books, OVER_ROUND, 1);
    books[HURRIED].store(params.hurried);
    books[IDLE].store(0);
    books[HAS_FOUND].store(0);
    books[STOPPED].store(0);
    Sum::load(books, MOST_LOST).store(books, PROGRESS);
    Sum::load(books, LOST).store(books, LAST_LOST);
    books[ROUND].store(0);
    books[EVERY].store(params.mu);
    list_in_turn(params, books);
    // A tree of one node has no fringe.
    if params.places() > 0 {
        fringe[0].store(ROOT);
        books[FRINGE_LENGTH].store(1);
        books[UNFOLDS].store(1);
        run_over(books, OVER_BOTH, 1);
    }
}

/// Lists are as long again as they are.
#[inline(always)]
fn resume(params: &RoundParams, books: &[AtomicU32]) {
    books[STOPPED].store(0);
    run_over(books, OVER_ROUND, 1);
    list_in_turn(params, books);
    let unfolds = books[UNFOLDS].load() != 0;
    let fringe = books[FRINGE_LENGTH + books[FRINGE_SIDE].load() as usize].load();
    let pool = books[POOL_LENGTH + books[POOL_SIDE].load() as usize].load();
    run_over_pool(books, pool, if unfolds { fringe } else { 0 });
}

/// Has dispatches run over a pool of so many nodes, and a fringe of so many that unfold.
#[inline(always)]
fn run_over_pool(books: &[AtomicU32], pool: u32, fringe: u32) {
    let chunks = pool.div_ceil(CHUNK);
    run_over(books, OVER_POOL, chunks);
    run_over(books, OVER_BOTH, chunks + fringe);
}

#[inline(always)]
pub(in crate::prbvh) fn close(params: &RoundParams, books: &[AtomicU32], report: &[AtomicU32]) {
    let row = params.row as usize;
    let lost = Sum::load(books, LOST).plus(Sum::load(report, row + SHRUNK)).minus(Sum::load(report, row + GREW));
    lost.store(books, LOST);
    if report[row + MARKED].load() != report[row + REFITTED].load() {
        status::raise(report, params.row, FAULT_BROKEN_TREE);
    }
    // What a fault left is no tree to keep.
    if report[row + FAULTS].load() == 0 && lost.exceeds(Sum::load(books, MOST_LOST)) {
        lost.store(books, MOST_LOST);
        books[EPOCH].add(1);
    }
    let mut side = books[FRINGE_SIDE].load();
    if books[UNFOLDS].load() != 0 {
        books[FRINGE_LENGTH + side as usize].store(0);
        side ^= 1;
        books[FRINGE_SIDE].store(side);
    }
    let fringe = books[FRINGE_LENGTH + side as usize].load();
    let pool = books[POOL_LENGTH + books[POOL_SIDE].load() as usize].load();
    let unfolds = fringe > 0 && pool < hurry::pool(params, books);
    books[UNFOLDS].store(unfolds as u32);
    if unfolds && books[STAGE].load() < MOST_STAGES {
        books[STAGE].add(1);
    }
    run_over_pool(books, pool, if unfolds { fringe } else { 0 });
    report[row + FRINGE].store(fringe);
    if params.has(verdict::JUDGES) && verdict::judge(params, lost, books, report) {
        books[STOPPED].store(1);
        run_over(books, OVER_POOL, 0);
        run_over(books, OVER_BOTH, 0);
        run_over(books, OVER_LIST, 0);
        run_over(books, OVER_ROUND, 0);
    }
}

//! The words of the [books](super::books), and what one invocation lists in them for the dispatches of many.

use super::RoundParams;
use crate::grid;
use crate::math::umin;
use crate::mem::AtomicU32;

/// Words of the books.
pub const BOOKS_WORDS: u32 = HISTOGRAM as u32 + BUCKETS;

/// Invocations over the pool, and their workgroups along three axes: what an indirect dispatch takes.
pub const OVER_POOL: usize = 0;
/// The same over the list.
pub const OVER_LIST: usize = 4;
/// The same over the pool and, if it unfolds, the fringe behind it.
pub const OVER_BOTH: usize = 8;
/// Nodes on each side of the pool.
pub const POOL_LENGTH: usize = 12;
/// Nodes on each side of the fringe.
pub const FRINGE_LENGTH: usize = 14;
/// Nodes on the list.
pub const LIST_LENGTH: usize = OVER_LIST;
/// The side of the pool that is filled.
pub const POOL_SIDE: usize = 17;
/// The side of the fringe that unfolds, or waits to.
pub const FRINGE_SIDE: usize = 18;
/// The root's area is divided by four so often.
pub const STAGE: usize = 19;
/// Whether the fringe unfolds in this round.
pub const UNFOLDS: usize = 20;
/// Bucket of the least of the worst keys.
pub const BUCKET: usize = 21;
/// Parts of [`CELLS`] of that bucket that are among them.
pub const PART: usize = 22;
/// Number of the best tree, from 1 on.
pub const EPOCH: usize = 23;
/// Two words: a [`Sum`](crate::sum::Sum) of what the areas have lost since the first tree, less what they gained.
pub const LOST: usize = 24;
/// The same of the best tree.
pub const MOST_LOST: usize = 26;
/// The first of these parts.
pub const TURN: usize = 28;
/// Rounds since the last progress.
pub const IDLE: usize = 29;
/// Whether something was found in the rounds since the last one in which the search may end.
pub const HAS_FOUND: usize = 30;
/// Whether the rounds have ended: no page is written, and lists count as empty, until they begin again or go on.
pub const STOPPED: usize = 31;
/// Two words: [`LOST`] at the last progress.
pub const PROGRESS: usize = 32;
/// Two words: [`LOST`] a round ago.
pub const LAST_LOST: usize = 34;
/// Of the published order: every so many nodes one is searched.
pub const EVERY: usize = 36;
/// The first of them.
pub const FIRST: usize = 37;
/// Rounds since the beginning.
pub const ROUND: usize = 38;
/// How often four times as many nodes were wanted from then on.
pub const HURRIED: usize = 39;
/// What is done once a round, as over the pool: 1, and behind the end 0.
pub const OVER_ROUND: usize = 40;
/// Keys in each bucket.
pub const HISTOGRAM: usize = 44;
/// Buckets.
pub const BUCKETS: u32 = 256;
/// Parts that a bucket can be cut into.
pub const CELLS: u32 = 256;

/// Lists so many more; returns the first of their places, and has the dispatches over the list come by.
#[inline(always)]
pub(super) fn list_more(books: &[AtomicU32], more: u32) -> u32 {
    let place = books[LIST_LENGTH].add(more);
    let [x, y, _] = grid::workgroups(place + more);
    // Both grow with the length.
    raise(&books[OVER_LIST + 1], x);
    raise(&books[OVER_LIST + 2], y);
    place
}

/// Most others have raised it before: a read costs less than to own the word.
#[inline(always)]
fn raise(word: &AtomicU32, value: u32) {
    if value > word.load() {
        word.max(value);
    }
}

/// Has as many invocations as this many run at `at`.
#[inline(always)]
pub(in crate::prbvh) fn run_over(books: &[AtomicU32], at: usize, count: u32) {
    let [x, y, z] = grid::workgroups(count);
    books[at].store(count);
    books[at + 1].store(x);
    books[at + 2].store(y);
    books[at + 3].store(z);
}

/// Of the published order: lists every µ-th node, in each round another set of them (Meister & Bittner 2018, §4.4.2).
#[inline(always)]
pub(super) fn list_in_turn(params: &RoundParams, books: &[AtomicU32]) {
    let mu = books[EVERY].load();
    if mu > 0 {
        let first = books[ROUND].load() % mu;
        books[FIRST].store(first);
        run_over(books, OVER_LIST, (params.nodes - umin(first, params.nodes)).div_ceil(mu));
    }
}

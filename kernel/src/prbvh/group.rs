//! What a single workgroup does of a round: the threshold of every round, and of a small one all but the search.
//!
//! Where few nodes are searched a dispatch takes longer to begin than to do its work. So the stages before the search, and those after it, are phases of one
//! workgroup: the same functions that a dispatch has its invocations run, whose lanes take the items in turn. Both ways leave the same lists, up to their order, and the
//! same tree.
//!
//! Kind: a single workgroup. What one lane hands on to another goes through atomics ([`Workgroup::wide_phase`]); a move stays with its lane.

use super::worst::RoundParams;
use super::worst::books::{
    self, BUCKET, BUCKETS, CELLS, CHUNK, CLOSE, FRINGE_LENGTH, FRINGE_SIDE, HISTOGRAM, LIST_LENGTH, OVER_LIST, PART,
    POOL_LENGTH, POOL_SIDE, SELECTS, STOPPED, TURN, UNFOLDS, run_over, thinning,
};
use super::worst::hurry;
use super::worst::refit;
use super::worst::select::{count_in, select};
use super::worst::unfold::unfold;
use crate::kept::Kept;
use crate::math::{umax, umin};
use crate::mem::{AtomicU32, AtomicU64, SharedU32, Slot};
use crate::node::{AtomicNode, WideNode};
use crate::prbvh::check::check;
use crate::prbvh::lock::lock;
use crate::prbvh::reinsert::reinsert;
use crate::prbvh::{DUAL, LAST, Move, PrbvhParams, ROUNDS};
use crate::status::WAITING;
use crate::workgroup::Workgroup;

/// A [flag](RoundParams::flags): the lists begin anew, and the fringe unfolds in `params.page` stages.
pub const BEGINS: u32 = 32;
/// All that comes before the search of a round.
pub const COMES_FIRST: u32 = 64;

/// Buckets whose keys one lane adds up.
const TOGETHER: u32 = 4;
/// Sums of these.
const SUMS: u32 = BUCKETS / TOGETHER;
/// Words that the workgroup of [`head`] shares: the histogram and sums of it.
pub const HEAD_WORDS: usize = (BUCKETS + SUMS) as usize;

/// What comes before the search: with [`BEGINS`] the first nodes of a search, with [`COMES_FIRST`] all of it, with neither the threshold alone, after
/// [`super::worst::select::count`] and before [`select`]. Reads `nodes[2n-1]`; reads and writes `keys[n-1]`, `fringe[2(n-1)]`, `pool[2(n-1)]`; writes `list[n-1]`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn head<W: Workgroup>(
    w: &W,
    params: &RoundParams,
    nodes: &[WideNode],
    keys: &[AtomicU32],
    fringe: &[AtomicU32],
    pool: &[AtomicU32],
    list: &[Slot<u32>],
    books: &[AtomicU32],
    report: &[AtomicU32],
    shared: &[SharedU32; HEAD_WORDS],
) {
    // Nobody writes this word as long as somebody may read it here.
    let is_over = !params.has(BEGINS) && books[STOPPED].load() != 0;
    if params.has(BEGINS) {
        w.wide_phase(move |lane| {
            if lane == 0 {
                books::begin(params, books, fringe);
            }
        });
        for _ in 0..params.page {
            w.wide_phase(move |lane| unfold_all::<W>(lane, params, nodes, keys, fringe, pool, list, books));
            w.wide_phase(move |lane| {
                if lane == 0 {
                    books::close(&RoundParams { flags: 0, ..*params }, books, report);
                }
            });
        }
    }
    let is_alone = params.has(COMES_FIRST);
    if !is_over && (is_alone || !params.has(BEGINS)) {
        if is_alone {
            w.each(BUCKETS, move |b| shared[b as usize].store(0));
            w.wide_phase(move |lane| {
                let length = books[POOL_LENGTH + books[POOL_SIDE].load() as usize].load();
                let add = |bucket: u32| shared[bucket as usize].add(1);
                let mut i = lane;
                while i < length.div_ceil(CHUNK) {
                    count_in(i, params, |place| pool[place].load(), |v| keys[v].load(), books, add);
                    i += W::LANES;
                }
            });
        } else {
            w.each(BUCKETS, move |b| {
                let keys = &books[HISTOGRAM + b as usize];
                shared[b as usize].store(keys.load());
                keys.store(0);
            });
        }
        w.each(SUMS, move |k| {
            let mut sum = 0;
            for b in k * TOGETHER..(k + 1) * TOGETHER {
                sum += shared[b as usize].load();
            }
            shared[(BUCKETS + k) as usize].store(sum);
        });
        w.wide_phase(move |lane| {
            if lane == 0 {
                threshold(params, books, report, shared);
            }
        });
        if is_alone {
            w.wide_phase(move |lane| {
                let from = books[POOL_LENGTH + (books[POOL_SIDE].load() ^ 1) as usize].load();
                let fringe_length = books[FRINGE_LENGTH + books[FRINGE_SIDE].load() as usize].load();
                let both = from.div_ceil(CHUNK) + books[UNFOLDS].load() * fringe_length;
                let selects = RoundParams { flags: params.flags | SELECTS, ..*params };
                let mut i = lane;
                while i < both {
                    select(i, &selects, nodes, keys, pool, list, fringe, books);
                    i += W::LANES;
                }
            });
        }
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
fn unfold_all<W: Workgroup>(
    lane: u32,
    params: &RoundParams,
    nodes: &[WideNode],
    keys: &[AtomicU32],
    fringe: &[AtomicU32],
    pool: &[AtomicU32],
    list: &[Slot<u32>],
    books: &[AtomicU32],
) {
    let count = books[FRINGE_LENGTH + books[FRINGE_SIDE].load() as usize].load();
    let mut i = lane;
    while i < count {
        unfold(i, params, nodes, keys, fringe, pool, list, books);
        i += W::LANES;
    }
}

/// Finds the bucket down to which keys are among the worst.
#[inline(always)]
fn threshold(params: &RoundParams, books: &[AtomicU32], report: &[AtomicU32], shared: &[SharedU32; HEAD_WORDS]) {
    let wanted = hurry::wanted(params, books);
    let thinning = thinning(books[POOL_LENGTH + books[POOL_SIDE].load() as usize].load());
    let keys_at = move |at: u32| shared[at as usize].load() << thinning;
    let mut above = 0u32;
    let mut bucket = 0u32;
    let mut inside = 0u32;
    let mut is_found = false;
    let mut sum = SUMS;
    while sum > 0 && !is_found {
        let keys = keys_at(BUCKETS + sum - 1);
        is_found = above + keys >= wanted;
        if !is_found {
            above += keys;
            sum -= 1;
        }
    }
    if is_found {
        // It is one of these.
        bucket = sum * TOGETHER - 1;
        inside = keys_at(bucket);
        while above + inside < wanted {
            above += inside;
            bucket -= 1;
            inside = keys_at(bucket);
        }
    }
    let mut part = CELLS;
    if is_found && inside > wanted {
        // A part of a crowd, and not so small a one that there might be nobody in it.
        let mut room = umax(wanted - above, wanted / 2);
        let mut keys = inside;
        // Both without their last digits if the product would not fit.
        while keys >= 1 << 22 {
            room >>= 1;
            keys >>= 1;
        }
        part = umin((room * CELLS).div_ceil(keys), CELLS);
    }
    report[params.row as usize + WAITING].store(above + inside);
    books[BUCKET].store(bucket);
    // The next part of the circle, so that everybody's turn comes.
    books[TURN].store((books[TURN].load() + books[PART].load()) % CELLS);
    books[PART].store(part);
    run_over(books, OVER_LIST, 0);
    let side = books[POOL_SIDE].load() ^ 1;
    books[POOL_SIDE].store(side);
    books[POOL_LENGTH + side as usize].store(0);
}

/// Words that the workgroup of [`tail`] shares: how many moves there are.
pub const TAIL_WORDS: usize = 1;

/// What comes after the search: `params.page` rounds of locks, moves, boxes and keys, the books. As the kernels of the same names.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn tail<W: Workgroup>(
    w: &W,
    params: &RoundParams,
    found: &[Slot<Move>],
    nodes: &[AtomicNode],
    locks: &[AtomicU64],
    kept: &[Slot<Kept>],
    ways: &[AtomicU32],
    keys: &[AtomicU32],
    fringe: &[AtomicU32],
    pool: &[AtomicU32],
    books: &[AtomicU32],
    report: &[AtomicU32],
    shared: &[SharedU32; TAIL_WORDS],
) {
    w.phase(move |lane| {
        if lane == 0 {
            shared[0].store(books[LIST_LENGTH].load());
        }
    });
    let length = shared[0].load();
    let RoundParams { nodes: all, row, scale, .. } = *params;
    let moves = PrbvhParams { count: length, mu: 1, first: 0, nodes: all, flags: DUAL | ROUNDS, row, scale };
    for round in 0..params.page {
        let last = if round + 1 == params.page { LAST } else { 0 };
        let of_round = PrbvhParams { flags: moves.flags | last, ..moves };
        w.wide_each(length, move |i| lock(i, &of_round, nodes, found, locks));
        w.wide_each(length, move |i| check(i, &of_round, nodes, locks, found, report));
    }
    w.wide_each(length, move |i| reinsert(i, &moves, found, nodes, kept, books, report));
    w.wide_each(length, move |i| refit::mark(i, &moves, found, nodes, ways, keys, fringe, books, report));
    w.wide_each(length, move |i| refit::refit(i, &moves, found, nodes, ways, keys, pool, books, report));
    w.phase(move |lane| {
        if lane == 0 {
            books::books(&RoundParams { page: CLOSE, ..*params }, books, fringe, report);
        }
    });
}

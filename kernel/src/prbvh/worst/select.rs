//! The worst nodes of the pool, without a sort: a histogram of the keys, a threshold ([`crate::prbvh::group`]), a selection.
//!
//! Kind: maps over chunks of the pool, and scatters to places that a common counter gives.

use super::RoundParams;
use super::books::{
    BUCKET, BUCKETS, CELLS, CHUNK, HISTOGRAM, PART, POOL_LENGTH, POOL_SIDE, SELECTS, TURN, list_more, thinning,
};
use super::keys::{IN_POOL, measure_of, waits};
use super::unfold::unfold;
use crate::math::umin;
use crate::mem::{AtomicU32, Slot};
use crate::node::WideNode;

/// Steps of a bucket to a factor of two.
const STEPS: u32 = 4;
/// Buckets above the area of the root: a measure may exceed the area.
const ABOVE_ROOT: u32 = 24 * STEPS;

/// The bucket of a measure: larger ones hold larger measures.
#[inline(always)]
fn bucket(measure: u32, root_area: f32) -> u32 {
    let step = |bits: u32| bits >> 21;
    let top = step(root_area.to_bits()) + ABOVE_ROOT;
    let below = top - umin(step(measure), top);
    BUCKETS - 1 - umin(below, BUCKETS - 1)
}

/// Which of the [`CELLS`] a node belongs to: neighbours to different ones (Knuth's multiplicative hashing).
#[inline(always)]
fn cell(v: u32) -> u32 {
    v.wrapping_mul(0x9e37_79b9) >> (32 - CELLS.ilog2())
}

/// Invocation `i` counts the keys of a chunk of the pool, or of some of its nodes. Reads `pool[2(n-1)]` and `keys[n-1]`.
#[inline(always)]
pub fn count(i: u32, params: &RoundParams, pool: &[u32], keys: &[u32], books: &[AtomicU32]) {
    let add = |bucket: u32| {
        books[HISTOGRAM + bucket as usize].add(1);
    };
    count_in(i, params, |place| pool[place], |v| keys[v], books, add);
}

/// Calls `add` with the bucket of each key that is counted; `pool(place)` and `key(v)` read.
#[inline(always)]
pub(in crate::prbvh) fn count_in(
    i: u32,
    params: &RoundParams,
    pool: impl Fn(usize) -> u32,
    key: impl Fn(usize) -> u32,
    books: &[AtomicU32],
    add: impl Fn(u32),
) {
    let side = books[POOL_SIDE].load();
    let length = books[POOL_LENGTH + side as usize].load();
    let end = umin((i + 1) * CHUNK, length);
    let counted = CELLS >> thinning(length);
    for place in i * CHUNK..end {
        let v = pool((side * params.places() + place) as usize);
        if cell(v.wrapping_mul(0x85eb_ca6b)) >= counted {
            continue;
        }
        let key = key(v as usize);
        if waits(key) {
            add(bucket(measure_of(key), params.root_area));
        }
    }
}

/// The first invocations take a chunk of the pool each (`select_chunk`), if [`SELECTS`] is set; those behind them [unfold] a node of the fringe each: what
/// comes into the pool there comes to its other side, and neither looks at keys that the other writes.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn select(
    i: u32,
    params: &RoundParams,
    nodes: &[WideNode],
    keys: &[AtomicU32],
    pool: &[AtomicU32],
    list: &[Slot<u32>],
    fringe: &[AtomicU32],
    books: &[AtomicU32],
) {
    let mut chunks = 0;
    if params.has(SELECTS) {
        chunks = books[POOL_LENGTH + (books[POOL_SIDE].load() ^ 1) as usize].load().div_ceil(CHUNK);
    }
    if i < chunks {
        select_chunk(i, params, keys, pool, list, books);
    } else {
        unfold(i - chunks, params, nodes, keys, fringe, pool, list, books);
    }
}

/// Puts the worst of a chunk of the pool on the list, and all that are not tired on the other side of the pool. Writes `list[n-1]`, the
/// keys of those that leave, and the other side of `pool[2(n-1)]`.
#[inline(always)]
fn select_chunk(
    i: u32,
    params: &RoundParams,
    keys: &[AtomicU32],
    pool: &[AtomicU32],
    list: &[Slot<u32>],
    books: &[AtomicU32],
) {
    let places = params.places();
    let to = books[POOL_SIDE].load();
    let from = to ^ 1;
    let end = umin((i + 1) * CHUNK, books[POOL_LENGTH + from as usize].load());
    let least = books[BUCKET].load();
    let part = books[PART].load();
    let turn = CELLS - books[TURN].load();
    // Two bits for each node: whether it stays in the pool, whether it goes on the list.
    let mut stays = 0u32;
    let mut goes = 0u32;
    let mut stay = 0;
    let mut go = 0;
    for place in i * CHUNK..end {
        let v = pool[(from * places + place) as usize].load();
        let key = keys[v as usize].load();
        let bit = 1 << (place - i * CHUNK);
        if waits(key) {
            stays |= bit;
            stay += 1;
            let bucket = bucket(measure_of(key), params.root_area);
            if bucket > least || (bucket == least && (cell(v) + turn) % CELLS < part) {
                goes |= bit;
                go += 1;
            }
        } else {
            keys[v as usize].store(key & !IN_POOL);
        }
    }
    if stay > 0 {
        let mut stay_place = to * places + books[POOL_LENGTH + to as usize].add(stay);
        let mut go_place = if go > 0 { list_more(books, go) } else { 0 };
        for place in i * CHUNK..end {
            let bit = 1 << (place - i * CHUNK);
            if stays & bit != 0 {
                let v = pool[(from * places + place) as usize].load();
                pool[stay_place as usize].store(v);
                stay_place += 1;
                if goes & bit != 0 {
                    list[go_place as usize].set(v);
                    go_place += 1;
                }
            }
        }
    }
}

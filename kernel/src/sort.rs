//! Stable radix sort of (key, value) pairs of 32-bit words, least significant digit first.
//!
//! Source: counting sort per digit (Knuth, TAOCP 3, §5.2.5), a workgroup per chunk as in Satish, Harris & Garland 2009; the ranks by masks are those of a
//! multisplit (Ashkiani et al. 2016), without subgroup operations. The order of a stable sort is unique, so every chunk size, every number of lanes and every device
//! gives the same one. Each pass is: `sort_count` (a chunk's digits), `sort_rows` (for each digit the sums over the chunks), `sort_scatter`.
//! No race: a workgroup writes its own column of the table, then its own row, and each pair gets a place of its own.

use crate::grid::WORKGROUP_SIZE;
use crate::math::umin;
use crate::mem::{SharedU32, Slot};
use crate::workgroup::{SCAN_WORDS, Workgroup, scan, total};
use bytemuck::{Pod, Zeroable};

/// Bits that one pass sorts by.
pub const DIGIT_BITS: u32 = 8;
/// Values of a digit.
pub const DIGITS: usize = 1 << DIGIT_BITS;

/// Push constants of the kernels of a pass.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SortParams {
    /// Invocations: a workgroup for each chunk, for [`rows`] one for each digit; for [`scatter_alone`] one per chunk.
    pub count: u32,
    /// Pairs to sort.
    pub pairs: u32,
    /// Pairs in a chunk.
    pub chunk: u32,
    /// Chunks.
    pub chunks: u32,
    /// Lowest bit of the digit.
    pub shift: u32,
}

#[inline(always)]
fn digit(key: u32, shift: u32) -> u32 {
    (key >> shift) & (DIGITS as u32 - 1)
}

/// Words that the workgroup of [`count`] shares.
pub const COUNT_WORDS: usize = DIGITS;

/// Workgroup `c` counts the digits of chunk `c`. Reads `keys[pairs]`, writes `table[256 · chunks]`, all chunks of digit 0 first.
#[inline(always)]
pub fn count<W: Workgroup>(
    w: &W,
    params: &SortParams,
    keys: &[u32],
    table: &[Slot<u32>],
    counts: &[SharedU32; COUNT_WORDS],
) {
    let chunk = w.group();
    let first = chunk * params.chunk;
    let length = umin(params.chunk, params.pairs - first);
    let (shift, chunks) = (params.shift, params.chunks);
    w.each(DIGITS as u32, move |d| counts[d as usize].store(0));
    w.each(length, move |k| counts[digit(keys[(first + k) as usize], shift) as usize].add(1));
    w.each(DIGITS as u32, move |d| table[(d * chunks + chunk) as usize].set(counts[d as usize].load()));
}

/// Words that the workgroup of [`rows`] shares.
pub const ROWS_WORDS: usize = SCAN_WORDS as usize;

/// Workgroup `d` turns the counts of digit `d` into their exclusive scan, row `d` of `table[256 · chunks]`, and writes their sum to `totals[256]`.
#[inline(always)]
pub fn rows<W: Workgroup>(
    w: &W,
    params: &SortParams,
    table: &[Slot<u32>],
    totals: &[Slot<u32>],
    sums: &[SharedU32; ROWS_WORDS],
) {
    let d = w.group();
    let first = d * params.chunks;
    scan(
        w,
        sums,
        0,
        params.chunks,
        move |k| table[(first + k) as usize].get(),
        move |k, before| {
            let count = table[(first + k) as usize].get();
            table[(first + k) as usize].set(before);
            count
        },
    );
    w.phase(move |lane| {
        if lane == 0 {
            totals[d as usize].set(total::<W, ROWS_WORDS>(sums, 0));
        }
    });
}

/// Keys that a lane of a group takes before the next barrier.
const KEYS_PER_LANE: u32 = 2;
/// Most keys between two barriers.
const MOST_KEYS: u32 = KEYS_PER_LANE * WORKGROUP_SIZE;
/// Most words of a mask of keys.
const MASK_WORDS: u32 = MOST_KEYS.div_ceil(32);

// What the workgroup of `scatter` shares: masks of the keys that have a digit, the next place of each digit, and the keys themselves.
const PLACES: u32 = MASK_WORDS * DIGITS as u32;
const KEYS: u32 = PLACES + DIGITS as u32;
const SCAN: u32 = KEYS + MOST_KEYS;
/// Words that the workgroup of [`scatter`] shares.
pub const SCATTER_WORDS: usize = (SCAN + SCAN_WORDS) as usize;

/// Workgroup `c` moves the pairs of chunk `c` to their places. Reads `keys`, `values`, the scanned `table` and `totals`, writes
/// `sorted_keys[pairs]` and `sorted_values[pairs]`.
///
/// The chunk is taken a few keys at a time. Each key sets its bit in the mask of its digit; the bits below it are the keys of its digit that come before it.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn scatter<W: Workgroup>(
    w: &W,
    params: &SortParams,
    keys: &[u32],
    values: &[u32],
    table: &[u32],
    totals: &[u32],
    sorted_keys: &[Slot<u32>],
    sorted_values: &[Slot<u32>],
    shared: &[SharedU32; SCATTER_WORDS],
) {
    // A lane that is alone takes a key at a time, which is the first of its digit then.
    let step = if W::LANES == 1 { 1 } else { KEYS_PER_LANE * W::LANES };
    let words = step.div_ceil(32);
    let chunk = w.group();
    let (chunks, shift) = (params.chunks, params.shift);
    scan(
        w,
        shared,
        SCAN,
        DIGITS as u32,
        move |d| totals[d as usize],
        move |d, before| {
            shared[(PLACES + d) as usize].store(before + table[(d * chunks + chunk) as usize]);
            totals[d as usize]
        },
    );
    w.each(DIGITS as u32 * words, move |k| shared[k as usize].store(0));

    let end = umin((chunk + 1) * params.chunk, params.pairs);
    let mut first = chunk * params.chunk;
    while first < end {
        let length = umin(step, end - first);
        w.each(length, move |k| {
            let key = keys[(first + k) as usize];
            shared[(KEYS + k) as usize].store(key);
            shared[(digit(key, shift) * words + k / 32) as usize].or(1 << (k % 32));
        });
        w.each(length, move |k| {
            let key = shared[(KEYS + k) as usize].load();
            let d = digit(key, shift);
            let mut place = shared[(PLACES + d) as usize].load();
            for word in 0..k / 32 {
                place += shared[(d * words + word) as usize].load().count_ones();
            }
            let below = (1 << (k % 32)) - 1;
            place += (shared[(d * words + k / 32) as usize].load() & below).count_ones();
            sorted_keys[place as usize].set(key);
            sorted_values[place as usize].set(values[(first + k) as usize]);
        });
        w.each(length, move |k| {
            let d = digit(shared[(KEYS + k) as usize].load(), shift);
            shared[(PLACES + d) as usize].add(1);
            shared[(d * words + k / 32) as usize].store(0);
        });
        first += step;
    }
}

/// As [`scatter`], but invocation `c` moves the pairs of chunk `c` by itself: for a CPU behind Vulkan, where each load from shared memory takes as long as
/// one from a buffer, and lanes take turns at a barrier.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn scatter_alone(
    c: u32,
    params: &SortParams,
    keys: &[u32],
    values: &[u32],
    table: &[u32],
    totals: &[u32],
    sorted_keys: &[Slot<u32>],
    sorted_values: &[Slot<u32>],
) {
    let mut places = [0u32; DIGITS];
    let mut before = 0u32;
    for d in 0..DIGITS as u32 {
        places[d as usize] = before + table[(d * params.chunks + c) as usize];
        before += totals[d as usize];
    }
    for k in c * params.chunk..umin((c + 1) * params.chunk, params.pairs) {
        let key = keys[k as usize];
        let d = digit(key, params.shift) as usize;
        let place = places[d];
        places[d] = place + 1;
        sorted_keys[place as usize].set(key);
        sorted_values[place as usize].set(values[k as usize]);
    }
}

/// Push constants of [`gather`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct GatherParams {
    /// Invocations: one per word.
    pub count: u32,
}

/// Invocation `i`: `gathered[i] = words[order[i]]`.
#[inline(always)]
pub fn gather(i: u32, order: &[u32], words: &[u32], gathered: &[Slot<u32>]) {
    gathered[i as usize].set(words[order[i as usize] as usize]);
}

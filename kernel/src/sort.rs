//! Stable radix sort of (key, value) pairs of 32-bit words, least significant digit first.
//!
//! Source: counting sort per digit (Knuth, TAOCP 3, §5.2.5); the order of a stable sort is unique, so every chunk size and
//! every device gives the same one. Each pass is: `sort_count` (map over chunks), an exclusive scan of the
//! table of counts (`scan_sums`, `scan_spine`, `scan_apply`), `sort_scatter`. A chunk is read by one invocation, in order.
//! No race: an invocation writes its own column of the table, and the scan gives each pair a place of its own.

use crate::math::umin;
use crate::mem::Slot;
use bytemuck::{Pod, Zeroable};

/// Bits that one pass sorts by.
pub const DIGIT_BITS: u32 = 8;
/// Values of a digit.
pub const DIGITS: usize = 1 << DIGIT_BITS;
/// Words that one invocation of a scan adds up.
pub const SCAN_CHUNK: u32 = 512;

/// Push constants of [`count`] and [`scatter`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SortParams {
    /// Invocations: one per chunk.
    pub count: u32,
    /// Pairs to sort.
    pub pairs: u32,
    /// Pairs in a chunk.
    pub chunk: u32,
    /// Lowest bit of the digit.
    pub shift: u32,
}

#[inline(always)]
fn digit(key: u32, shift: u32) -> usize {
    ((key >> shift) & (DIGITS as u32 - 1)) as usize
}

/// Invocation `i` counts the digits of chunk `i`. Reads `keys[pairs]`, writes `table[256 · chunks]`, all chunks of digit 0 first.
#[inline(always)]
pub fn count(i: u32, params: &SortParams, keys: &[u32], table: &[Slot<u32>]) {
    let mut counts = [0u32; DIGITS];
    let first = i * params.chunk;
    let end = umin(first + params.chunk, params.pairs);
    for k in first..end {
        counts[digit(keys[k as usize], params.shift)] += 1;
    }
    for d in 0..DIGITS as u32 {
        table[(d * params.count + i) as usize].set(counts[d as usize]);
    }
}

/// Invocation `i` moves the pairs of chunk `i` to their places. Reads `keys`, `values` and the scanned `table`, writes
/// `sorted_keys[pairs]` and `sorted_values[pairs]`.
#[inline(always)]
pub fn scatter(
    i: u32,
    params: &SortParams,
    keys: &[u32],
    values: &[u32],
    table: &[u32],
    sorted_keys: &[Slot<u32>],
    sorted_values: &[Slot<u32>],
) {
    let mut places = [0u32; DIGITS];
    for d in 0..DIGITS as u32 {
        places[d as usize] = table[(d * params.count + i) as usize];
    }
    let first = i * params.chunk;
    let end = umin(first + params.chunk, params.pairs);
    for k in first..end {
        let key = keys[k as usize];
        let d = digit(key, params.shift);
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

/// Push constants of the three kernels of a scan.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ScanParams {
    /// Invocations: one per [`SCAN_CHUNK`] words; 1 for [`scan_spine`].
    pub count: u32,
    /// Words to scan.
    pub words: u32,
}

/// Invocation `i` adds up words `[512 i, 512 (i+1))` of `words` into `sums[i]`.
#[inline(always)]
pub fn scan_sums(i: u32, params: &ScanParams, words: &[u32], sums: &[Slot<u32>]) {
    let first = i * SCAN_CHUNK;
    let end = umin(first + SCAN_CHUNK, params.words);
    let mut sum = 0u32;
    for k in first..end {
        sum = sum.wrapping_add(words[k as usize]);
    }
    sums[i as usize].set(sum);
}

/// The only invocation turns `sums[params.words]` into its exclusive scan.
#[inline(always)]
pub fn scan_spine(params: &ScanParams, sums: &[Slot<u32>]) {
    let mut sum = 0u32;
    for k in 0..params.words {
        let word = sums[k as usize].get();
        sums[k as usize].set(sum);
        sum = sum.wrapping_add(word);
    }
}

/// Invocation `i` turns words `[512 i, 512 (i+1))` of `words` into their exclusive scan, starting from the scanned `sums[i]`.
#[inline(always)]
pub fn scan_apply(i: u32, params: &ScanParams, sums: &[u32], words: &[Slot<u32>]) {
    let first = i * SCAN_CHUNK;
    let end = umin(first + SCAN_CHUNK, params.words);
    let mut sum = sums[i as usize];
    for k in first..end {
        let word = words[k as usize].get();
        words[k as usize].set(sum);
        sum = sum.wrapping_add(word);
    }
}

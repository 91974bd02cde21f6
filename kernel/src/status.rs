//! What a kernel reports to the host: counts and faults, in rows of a small buffer.

use crate::mem::AtomicU32;

/// Words of a row.
pub const REPORT_WORDS: u32 = 20;

/// Reinsertions that the search found.
pub const FOUND: usize = 0;
/// Reinsertions that own all their locks.
pub const OWNED: usize = 1;
/// Reinsertions, or treelets, that changed the tree.
pub const APPLIED: usize = 2;
/// Fault bits: [`FAULT_SEARCH_STEPS`], [`FAULT_BROKEN_TREE`], [`FAULT_TREELET`].
pub const FAULTS: usize = 3;
/// Most steps that a single search took.
pub const MOST_STEPS: usize = 4;
/// Nodes whose boxes the searches looked at.
pub const VISITS: usize = 5;
/// Two words: a [`Sum`](crate::sum::Sum) of what the reinsertions made promise.
pub const PREDICTED: usize = 6;
/// Two words: a sum of what areas lost.
pub const SHRUNK: usize = 8;
/// Two words: a sum of what areas gained.
pub const GREW: usize = 10;
/// Nodes on the ways up from what moved.
pub const MARKED: usize = 12;
/// Of these, the ones that got their boxes.
pub const REFITTED: usize = 13;
/// Nodes on the fringe, below which nobody has looked.
pub const FRINGE: usize = 14;
/// Nodes that were searched.
pub const SEARCHED: usize = 15;
/// Nodes in the pool that were counted as waiting for their search.
pub const WAITING: usize = 16;

/// How the rounds go on after this one: [`GOES_ON`], [`SETTLED`], [`NOTHING_FOUND`], [`AT_TARGET`], [`AT_FAULT`].
pub const VERDICT: usize = 17;

/// Of the published order: every so many nodes one was searched.
pub const MU: usize = 18;

/// Whether rounds want four times as many nodes from here on.
pub const HURRY: usize = 19;

/// Another round follows.
pub const GOES_ON: u32 = 0;
/// The cost has settled.
pub const SETTLED: u32 = 1;
/// Nothing was found in the last rounds, but there is more to search: by rounds that are yet to be planned.
pub const NOTHING_FOUND: u32 = 2;
/// The cost is as low as was asked for.
pub const AT_TARGET: u32 = 3;
/// A kernel raised a fault.
pub const AT_FAULT: u32 = 4;

/// A device ended a search before it was done or at its bound.
pub const FAULT_SEARCH_STEPS: u32 = 1;
/// An internal node was not completed by both of its children: the links are no tree.
pub const FAULT_BROKEN_TREE: u32 = 2;
/// A device ended the work on a treelet before it was done.
pub const FAULT_TREELET: u32 = 4;

/// Raises fault bits in the row that begins with word `row`.
#[inline(always)]
pub fn raise(report: &[AtomicU32], row: u32, faults: u32) {
    report[row as usize + FAULTS].or(faults);
}

/// Raises a word of a row to `value`. Most callers have a lower one: a read costs less than to own the word.
#[inline(always)]
pub fn raise_most(report: &[AtomicU32], row: u32, word: usize, value: u32) {
    let word = &report[row as usize + word];
    if value > word.load() {
        word.max(value);
    }
}

/// Adds to a word of a row.
#[inline(always)]
pub fn count(report: &[AtomicU32], row: u32, word: usize, more: u32) {
    report[row as usize + word].add(more);
}

//! What a kernel reports to the host: counts and faults, in one small buffer.

use crate::mem::AtomicU32;

/// Words of the report buffer.
pub const REPORT_WORDS: u32 = 8;

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

/// Nodes on the list of candidates.
pub const CANDIDATES: usize = 5;

/// A device ended a search before it was done or at its bound.
pub const FAULT_SEARCH_STEPS: u32 = 1;
/// An internal node was not completed by both of its children: the links are no tree.
pub const FAULT_BROKEN_TREE: u32 = 2;
/// A device ended the work on a treelet before it was done.
pub const FAULT_TREELET: u32 = 4;

/// Raises fault bits.
#[inline(always)]
pub fn raise(report: &[AtomicU32], faults: u32) {
    report[FAULTS].or(faults);
}

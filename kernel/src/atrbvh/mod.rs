//! Treelets of a tree are built anew, from the leaves up: by agglomerative clustering (ATRBVH), or the best of all (TRBVH).
//!
//! Source: Domingues & Pedrini 2015; Karras & Aila 2013, of whom the treelets are. In a pass with the bound γ every internal node with at
//! least γ references below is the root of a treelet, and is processed after all treelet roots below it.
//!
//! | kernel | kind | in → out |
//! |---|---|---|
//! | [`levels`] | climb | links → level of every treelet root, treelets of each level |
//! | `sort_*`, `scan_*` | | levels → treelet roots level by level |
//! | [`restructure`] | scatter | a level's treelet roots → better treelets, by clustering |
//! | [`restructure_optimally`] | scatter | a level's treelet roots → the best treelets |
//!
//! The published kernel restructures as it climbs. Here each level is a dispatch of its own: an invocation processes one treelet, so that it
//! never comes near the rounds that a device lets its loops run, and neighbours in a dispatch do the same work.
//!
//! # Why the invocations of a level do not meet
//! Nodes of one level are no ancestors of each other: a treelet root's level is higher than any below it. So their subtrees are disjoint when
//! the levels are taken. A treelet keeps its root and the set of nodes below, so they stay disjoint, and a root stays above those of
//! lower levels, whatever happens below. An invocation touches nodes of its own subtree only.

mod clusters;
mod levels;
mod optimal;
mod restructure;
mod treelet;

pub use levels::{LevelsParams, levels};
pub use optimal::{OPTIMAL_TREELET, restructure_optimally};
pub use restructure::restructure;
pub use treelet::{RELATIVE_THRESHOLD, RestructureParams};

/// Most leaves of a treelet.
pub const MAX_TREELET: u32 = 32;

//! Adaptive leaves: subtrees become leaves of several triangles where that lowers the SAH cost. And nodes of several children: see [`mod@widen`].
//!
//! Source: MacDonald & Booth 1990 for the cost; Meister & Bittner 2018, §5 (leaves after the optimisation). A subtree of `s`
//! triangles under a box of area `A` becomes a leaf if and only if that is strictly cheaper:
//!
//! ```text
//! c_I · A · s  <  c_T · A + cost(left) + cost(right)       cost(leaf) = c_I · A
//! ```
//! | kernel | kind | in → out |
//! |---|---|---|
//! | [`sizes`] | climb | boxes → size, decision, cost, height of every subtree |
//! | [`places`] | map | links, sizes → each node's step from its parent |
//! | [`jump`] | map | steps over `2^k` links → steps over `2^(k+1)` links |
//! | [`emit`] | scatter, one writer per element | all of that → [`CompactNode`]s and the order of the triangles |
//! | [`widen`](widen::widen) | climb | boxes → what becomes of every node in a wide tree of least cost |
//!
//! The order of nodes and triangles is the depth-first order of the tree, from sizes of subtrees alone: no counter decides it.

pub mod area;
mod emit;
mod places;
mod sizes;
pub mod widen;

pub use emit::{CompactNode, EmitParams, emit};
pub use places::{Place, PlacesParams, jump, places};
pub use sizes::{CollapseParams, sizes};

/// Words that [`sizes`] leaves per node.
pub const SUBTREE_WORDS: u32 = 4;
/// Word of a subtree: its triangles, with [`LEAF`] where it becomes a leaf.
pub const SIZE: u32 = 0;
/// Word of a subtree: nodes that remain of it.
pub const REMAINING: u32 = 1;
/// Word of a subtree: its cost, bits of an f32, in units of the root's area brought to `[1, 2)` by a power of two.
pub const COST: u32 = 2;
/// Word of a subtree: most links between its root and a leaf before the collapse.
pub const HEIGHT: u32 = 3;

/// Set in the word [`SIZE`] of a subtree that becomes a leaf.
pub const LEAF: u32 = 0x8000_0000;

/// Index of a word of node `v`.
#[inline(always)]
#[must_use]
pub fn word(v: u32, k: u32) -> usize {
    (v * SUBTREE_WORDS + k) as usize
}

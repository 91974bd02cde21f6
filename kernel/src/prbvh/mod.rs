//! Parallel reinsertion: search, lock, check, reinsert. [`dual`] moves both children of a node at once, [`conservative`] locks more, and
//! [`worst`] says which nodes are searched first.
//!
//! Source: Meister & Bittner, *Parallel Reinsertion for Bounding Volume Hierarchy Optimization*, CGF 37(2), 2018.
//!
//! # A reinsertion
//! The subtree of the *input* node leaves its place and becomes the sibling of the *output* node. Its old parent `P` is
//! recycled as the new common parent:
//!
//! ```text
//!            X  pivot                              X
//!          /   \                                 /   \
//!        ..     ..                             ..     ..
//!        /       \                             /       \
//!       PP        Q              =>           PP        Q
//!      /  \      / \                         /  \      / \
//!     P    .    .  output                   S    .    .   P
//!    / \                                                 / \
//! input  S                                          output  input
//! ```
//! With half areas `A`, and every ancestor taken strictly below the pivot `X` (§4.2):
//!
//! ```text
//! area decrease =   A(P) + Σ over v above P  ( A(v) - A(v without input) )
//!                 - A(output ∪ input) - Σ over w above output  ( A(w ∪ input) - A(w) )
//! ```
//! The SAH cost falls by `c_T · area decrease / A(root)`. If `P` is the root there is no `PP`: the root keeps its place, adopts
//! the children of `S`, and `S` is recycled instead; the same sum holds.
//!
//! # Rounds of locks
//! Every move raises its key at all of its [`MoveNodes`], and one that holds them all has won ([`mod@lock`], [`mod@check`]). The published order makes
//! the winners and forgets the rest. But a move that lost at one node may hold others for nothing, and keep a third one from moving. So
//! [`worst`] locks several times over the same tree: losers let go, winners mark their nodes as taken, and a move that meets a taken node is
//! out. What has won in any of the rounds of locks has nodes of its own, whichever round that was.
//!
//! # Why the tree stays a tree
//! Moves with disjoint [`MoveNodes`] change disjoint links, since a node's links to its children change only with the node. What is left is a
//! loop: `a` moves below `b` while `b` moves below `a`.
//!
//! All moves of a round are found in one tree. Let `c` be a subtree that moves: the input of a single move, a child of a dissolved node. The search
//! refuses an output of `c` unless every node `w` on the way down to it from the pivot, the sibling `S` excepted, has a larger area than `c`, compared
//! as computed floats. Now follow the parents upward from `c` after all moves: first come nodes that a move has freed, then old ancestors of the
//! output, until the next subtree that moves, `b`. A freed node is none: input and parent of a dual move, and the parent of a single one, are locked. As
//! the output is locked, `b` is a proper old ancestor of it. Below the pivot its area is larger than that of `c` (`b` is not `S`, which
//! would need the lock of `P` to move). From the pivot on `b` is an old ancestor of `c`, and its area is not smaller: boxes contain
//! each other, and [`Aabb::half_area`](crate::aabb::Aabb::half_area) is monotone. So along a loop no area can fall, hence none can rise, hence each subtree is an
//! old ancestor of the one before it; but no node is its own ancestor.
//!
//! A second subtree that ends beside the first one, or beside the new parent of the first, hangs below old ancestors of the first output and counts as one
//! with that output. Which round of locks a move won in is nowhere in the argument.
//!
//! [`worst`] checks the claim in every round where it could fail: the ways up from all that moved must reach the root. `cost` checks it of
//! the whole tree.

pub mod check;
pub mod conservative;
pub mod dual;
pub mod group;
pub mod lock;
pub mod paths;
pub mod reinsert;
mod rounds;
pub mod search;
pub mod topology;
mod walk;
pub mod worst;

pub use topology::MoveNodes;
use worst::books::{EVERY, FIRST};

use crate::mem::AtomicU32;
use crate::node::NO_NODE;
use bytemuck::{Pod, Zeroable};

/// What the search found for one input node, 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Move {
    /// Decrease of the sum of half areas, scene units²; positive.
    pub area_decrease: f32,
    /// The node that moves, or is dissolved. With [`WON`] once the move owns its nodes.
    pub input: u32,
    /// The new sibling of the input, or of its child that is inserted first; [`NO_NODE`] if nothing was found.
    pub output: u32,
    /// Of a single move: the child of the pivot above the output, which may be the output itself. Of a dual one: the second output, with
    /// [`RIGHT`](crate::node::RIGHT) if the right child is the first.
    pub other: u32,
}

/// Set in [`Move::input`] of a move that owns its nodes: node indices have 31 bits.
pub const WON: u32 = 0x8000_0000;

impl Move {
    /// Nothing to move.
    pub const NONE: Self = Self { area_decrease: 0.0, input: NO_NODE, output: NO_NODE, other: NO_NODE };

    /// Whether something was found and has not won its nodes yet.
    #[inline(always)]
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.output != NO_NODE && self.input & WON == 0
    }

    /// Whether it owns its nodes.
    #[inline(always)]
    #[must_use]
    pub fn has_won(&self) -> bool {
        self.output != NO_NODE && self.input & WON != 0
    }

    /// The input node.
    #[inline(always)]
    #[must_use]
    pub fn input(&self) -> u32 {
        self.input & !WON
    }
}

/// Push constants of the kernels of an iteration.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PrbvhParams {
    /// Invocations: one per input node.
    pub count: u32,
    /// Every `mu`-th node is an input node (§4.4.2); 0: as the books say.
    pub mu: u32,
    /// The first of them: iteration mod `mu`.
    pub first: u32,
    /// Nodes of the tree, `2n-1`.
    pub nodes: u32,
    /// [`DUAL`], [`CONSERVATIVE`] and the like.
    pub flags: u32,
    /// The word of the report with which the row of the iteration begins.
    pub row: u32,
    /// Units of a [`Sum`](crate::sum::Sum) in an area.
    pub scale: f32,
}

/// Moves are those of [`dual`].
pub const DUAL: u32 = 1;
/// Locks are those of [`conservative`].
pub const CONSERVATIVE: u32 = 2;
/// There are several rounds of locks: losers let go, winners take their nodes.
pub const ROUNDS: u32 = 4;
/// The last of several rounds of locks: all nodes are free afterwards.
pub const LAST: u32 = 8;
/// The second of two words of a lock is claimed.
pub const SECOND_WORD: u32 = 16;

impl PrbvhParams {
    /// Every `mu`-th of all nodes from `first` on.
    #[must_use]
    pub const fn every(mu: u32, first: u32, nodes: u32) -> Self {
        Self { count: nodes.saturating_sub(first).div_ceil(mu), mu, first, nodes, flags: 0, row: 0, scale: 0.0 }
    }

    /// Input node of invocation `i`.
    #[inline(always)]
    #[must_use]
    pub fn input(&self, i: u32) -> u32 {
        self.first + i * self.mu
    }

    /// The same, with the input nodes that the books say where it is they that do.
    #[inline(always)]
    #[must_use]
    pub fn by(&self, books: &[AtomicU32]) -> Self {
        if self.mu > 0 { *self } else { Self { mu: books[EVERY].load(), first: books[FIRST].load(), ..*self } }
    }

    /// Whether a flag is set.
    #[inline(always)]
    #[must_use]
    pub fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }
}

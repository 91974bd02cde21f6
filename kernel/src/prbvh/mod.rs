//! Parallel reinsertion: search, lock, check, reinsert. Lock and check are those of the aggressive strategy; [`conservative`] has others, and
//! [`dual`] moves both children of a node at once.
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
//! # Why the tree stays a tree
//! Moves with disjoint [`TopologyNodes`] change disjoint links. What is left is a loop: `a` moves below `b` while `b` moves
//! below `a`. [`search`] refuses an output unless every node `w` on the way down to it, `S` excepted, has a larger area than the
//! input, compared as computed floats. Follow the parents upward after the moves: going from a moved node to the next
//! moved node above it, the area never falls (boxes that contain each other: [`Aabb::half_area`](crate::aabb::Aabb::half_area) is monotone), and it rises
//! where the move led strictly below that node. In a loop it would have to rise at least once and come back to the same value. The
//! excepted `S` shares its parent with the input, so that two such moves share a lock.
//! `cost` checks the claim after every iteration.

pub mod candidates;
pub mod check;
pub mod conservative;
pub mod decrease;
pub mod dual;
pub mod lock;
pub mod paths;
pub mod reinsert;
pub mod search;
pub mod walk;

use crate::node::{Links, NO_NODE, ROOT};
use bytemuck::{Pod, Zeroable};

/// What the search found for one input node, 12 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Reinsertion {
    /// Decrease of the sum of half areas, scene units²; positive.
    pub area_decrease: f32,
    /// The node that moves.
    pub input: u32,
    /// The node to become the sibling of; [`NO_NODE`] if nothing was found or the locks were lost. Once the move is made: the node that its old
    /// parent hung below, where boxes shrink.
    pub output: u32,
}

impl Reinsertion {
    /// Nothing to move.
    pub const NONE: Self = Self { area_decrease: 0.0, input: NO_NODE, output: NO_NODE };
}

/// Push constants of the kernels of an iteration.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PrbvhParams {
    /// Invocations: one per input node.
    pub count: u32,
    /// Every `mu`-th node, or candidate, is an input node (§4.4.2).
    pub mu: u32,
    /// The first of them: iteration mod `mu`.
    pub first: u32,
    /// Nodes of the tree, `2n-1`.
    pub nodes: u32,
    /// Area decrease that a move must exceed, scene units², up to rounding. 0 lets every move pass.
    pub floor: f32,
}

impl PrbvhParams {
    /// Every `mu`-th of all nodes from `first` on, and every move.
    #[must_use]
    pub const fn every(mu: u32, first: u32, nodes: u32) -> Self {
        Self { count: nodes.saturating_sub(first).div_ceil(mu), mu, first, nodes, floor: 0.0 }
    }

    /// Input node of invocation `i`, or its place among the candidates.
    #[inline(always)]
    #[must_use]
    pub fn input(&self, i: u32) -> u32 {
        self.first + i * self.mu
    }
}

/// Bits of the area decrease above the input node: larger decreases win a lock, then larger indices. Only positive decreases
/// order like their bits.
#[inline(always)]
#[must_use]
pub fn lock_key(area_decrease: f32, input: u32) -> u64 {
    ((area_decrease.to_bits() as u64) << 32) | input as u64
}

/// The nodes whose links a reinsertion reads or writes, the one definition for lock, check and reinsert (§4.3.1): input,
/// sibling, parent, grandparent (if the parent is the root: the children of the sibling instead), output, output's parent.
/// Unused places hold [`NO_NODE`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TopologyNodes([u32; 7]);

impl TopologyNodes {
    /// The topology nodes of the move of `input` beside `output`, in a tree with `internal` internal nodes.
    #[inline(always)]
    #[must_use]
    pub fn of<T: Links + ?Sized>(tree: &T, internal: u32, input: u32, output: u32) -> Self {
        let parent = tree.parent(input);
        let sibling = tree.sibling(input);
        let mut above = NO_NODE;
        let mut other = NO_NODE;
        if parent != ROOT {
            above = tree.parent(parent);
        } else if sibling < internal {
            above = tree.down(sibling);
            other = tree.up(above);
        }
        Self([input, sibling, parent, above, other, output, tree.parent(output)])
    }

    /// Whether `holds` is true of every topology node; asks all of them.
    #[inline(always)]
    pub fn all(self, holds: impl Fn(usize) -> bool) -> bool {
        let mut all = true;
        // Not an iterator over the array: rust-gpu cannot compile one.
        for k in 0..7 {
            let v = self.0[k];
            if v != NO_NODE {
                all &= holds(v as usize);
            }
        }
        all
    }

    /// Calls `visit` with every topology node.
    #[inline(always)]
    pub fn for_each(self, visit: impl Fn(usize)) {
        self.all(|v| {
            visit(v);
            true
        });
    }
}

//! Dual reinsertion: an internal node is dissolved, and each of its two children goes where it costs least.
//!
//! Source of the move: Bittner, Hapala & Havran, *Fast Insertion-Based Optimization of Bounding Volume Hierarchies*, CGF 32(1), 2013, who
//! make one after another. Search, lock, check and reinsert follow [`super`]; new here is that many run side by side.
//!
//! # A dual reinsertion
//! The *input* `N` and its parent `P` leave the tree, and the sibling `S` closes the gap. The *first* child becomes the sibling of one output,
//! with `P` as their parent; then the *second* one becomes the sibling of another, with `N` as theirs:
//!
//! ```text
//!            X  pivot of x                         X
//!          /   \                                 /   \
//!        G      ..                             G      ..
//!      /  \       \                          /  \       \
//!     P    y       x         =>             S    N       P
//!    / \                                        / \     / \
//!   N   S                                      y  b    x   a
//!  / \
//! a   b
//! ```
//! Either child may be the first; both orders are tried. The second output may be new: `P`, the parent of `x` and the first child, or the first child
//! itself, which moves the input as a whole. A child that ends beside `S` has only let the other one go. So the move has the single ones
//! of the children and of the input in it, and it leads out of trees in which no single one helps. With half areas `A`:
//!
//! ```text
//! area decrease =   A(P) + A(N) - A(new P) - A(new N) + Σ over all other internal nodes v  ( A(v) - A(new v) )
//! ```
//! Ancestors of the input are no outputs: evaluated, they never won.
//!
//! An input whose parent is the root stays, and so does one whose search would take more than [`MAX_ROUNDS`].
//!
//! # Why the tree stays a tree
//! As in [`super`]: moves with disjoint [`DualNodes`] change disjoint links, and what is left is a loop. Let `c` be a child that moves, and follow
//! the parents upward after the moves: new parents, and old ancestors of its output, until the next child that moves, `b`. As outputs are locked,
//! `b` is an old ancestor of the output. Below the pivot the search refused `c` unless `b` has the larger area (of `S`, which it excepts, the move
//! would need the lock of `P`). From the pivot on `b` is an old ancestor of `c`, and its area is not smaller. In a loop no area can rise; then each
//! child would be an old ancestor of the one before it, which ends at the root. A second child beside the first one, or beside `P`, has the ancestors
//! of `x` above it and counts as one with the output `x`. A new parent never is one that moves: `N` and `P` are locked.

pub mod check;
mod gain;
pub mod lock;
mod place;
pub mod reinsert;
pub mod search;

use super::Reinsertion;
use crate::node::{Links, NO_NODE, RIGHT};

pub use search::MAX_ROUNDS;

/// A dual reinsertion of an input node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualMove {
    /// The node that is dissolved.
    pub input: u32,
    /// Its child that is inserted first.
    pub first: u32,
    /// New sibling of the first child.
    pub first_output: u32,
    /// The other child.
    pub second: u32,
    /// New sibling of the second child: the old parent of the input if it is the new parent of the first child.
    pub second_output: u32,
}

impl DualMove {
    /// Reads what the search found: `second` is the second output, with [`RIGHT`] set if the right child is the first.
    #[inline(always)]
    #[must_use]
    pub fn new<T: Links + ?Sized>(tree: &T, input: u32, found: Reinsertion, second: u32) -> Self {
        let left = tree.down(input);
        let right = tree.up(left);
        let is_right_first = second & RIGHT != 0;
        Self {
            input,
            first: if is_right_first { right } else { left },
            first_output: found.output,
            second: if is_right_first { left } else { right },
            second_output: second & !RIGHT,
        }
    }
}

/// The nodes whose links a dual reinsertion reads or writes, the one definition for lock, check and reinsert: input, its parent, sibling,
/// grandparent and children, both outputs and their parents. Some may be the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualNodes([u32; 10]);

impl DualNodes {
    /// The nodes of a move.
    #[inline(always)]
    #[must_use]
    pub fn of<T: Links + ?Sized>(tree: &T, dual: &DualMove) -> Self {
        let parent = tree.parent(dual.input);
        Self([
            dual.input,
            parent,
            tree.sibling(dual.input),
            tree.parent(parent),
            dual.first,
            dual.second,
            dual.first_output,
            tree.parent(dual.first_output),
            dual.second_output,
            tree.parent(dual.second_output),
        ])
    }

    /// Whether `holds` is true of every node; asks all of them.
    #[inline(always)]
    pub fn all(self, holds: impl Fn(usize) -> bool) -> bool {
        let mut all = true;
        // Not an iterator over the array: rust-gpu cannot compile one.
        for k in 0..10 {
            all &= holds(self.0[k] as usize);
        }
        all
    }

    /// Calls `visit` with every node.
    #[inline(always)]
    pub fn for_each(self, visit: impl Fn(usize)) {
        self.all(|v| {
            visit(v);
            true
        });
    }
}

/// Whether the search found a move.
#[inline(always)]
fn is_move(found: Reinsertion) -> bool {
    found.output != NO_NODE
}

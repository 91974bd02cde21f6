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

mod gain;
mod place;
pub mod search;
mod way;

use super::Move;
use crate::node::{Links, RIGHT};

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
    /// The move that the search found.
    #[inline(always)]
    #[must_use]
    pub fn new<T: Links + ?Sized>(tree: &T, found: &Move) -> Self {
        let input = found.input();
        let left = tree.down(input);
        let right = tree.up(left);
        let is_right_first = found.other & RIGHT != 0;
        Self {
            input,
            first: if is_right_first { right } else { left },
            first_output: found.output,
            second: if is_right_first { left } else { right },
            second_output: found.other & !RIGHT,
        }
    }
}

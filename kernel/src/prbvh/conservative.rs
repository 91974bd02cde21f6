//! The conservative strategy: only reinsertions whose area decreases add up run side by side.
//!
//! Source: Meister & Bittner 2018, §4.3, for the aim. The paper locks whole paths, and its code (`FAST 0`) compares a loser of a lock
//! with the holder alone, so that two losers that spoil each other's boxes may both move. The sets below are smaller, and every pair
//! in conflict is resolved.
//!
//! # Which reinsertions may run side by side
//! A reinsertion climbs from its input to the pivot `X` and goes down to its output; see the figure of [`super`]. Boxes change at the lower
//! ends of the two arms only: once an ancestor keeps its box without the input, so do the ones above it, and once a node has room for
//! the input, so do the ones above it. [`Footprint`] is made of
//!
//! - **written** nodes: the [`MoveNodes`](super::MoveNodes); the nodes below `X` above the input that shrink, and the first that does not; the
//!   nodes below `X` above the output that grow;
//! - **read** nodes: the child of `X` on the output's side (the *top*), and the first node above the output that has room for the input
//!   (the *stop*), which may be `X`.
//!
//! Two reinsertions are compatible if neither writes a node that the other writes or reads.
//!
//! # Why their decreases add up
//! Claim: after a set of pairwise compatible reinsertions every node has the box that the one reinsertion that writes it gives it alone, or its
//! old box if none writes it. A reinsertion writes every node whose box it changes. So each change of an area is part of exactly one
//! decrease, and the sum of the areas falls by the sum of the decreases.
//!
//! If a reinsertion `b` changes the box of a node with the old parent `v` and does not write `v`, then `v` is its stop and the node
//! grows, or `v` is its pivot and the node, which is not its top, shrinks. From this the claim follows by induction from the leaves of
//! the new tree. Let `v` be an internal node.
//!
//! 1. *`a` writes `v`.* Let another `b` change the box of a child `c`. Then `v` was the parent of `c` before, as `a` writes what it hangs elsewhere.
//!    Without a conflict `b` neither writes nor reads `v`. So `v` is its pivot, `c` shrinks, its stop is further down, and its top keeps its
//!    box. Now `a` writes neither `c` nor the top. A node that it writes, but no child of which, is its input, its output or the like: it
//!    leaves box and children of `v` as they are, and so does `b`. Without such a `b` all is as under `a` alone.
//! 2. *Nobody writes `v`.* It has its old children. Let `a` change one of them, `c`, and let `e` be the other.
//!    - `c` shrinks: `v` is the pivot of `a` and `e` its top, which nobody else writes. All is as under `a` alone, and
//!      the leaves below `v` stay the same.
//!    - `c` grows: `v` has room for the input of `a`, so `c` sticks out nowhere. The same holds of `e` if it grows. If `b` shrinks `e`, then `v` is
//!      the pivot of `b` and `c` its top: a conflict, unless `b` is `a`, and then all is as under `a` alone.
//!
//!    Either way `v` keeps its box.
//!
//! That the result is a tree follows from disjoint [`MoveNodes`](super::MoveNodes), as in [`super`].
//!
//! # Locks
//! A node is held by the largest key among all that write or read it; the key says which of the two ([`claim`](super::lock::claim)). A reinsertion stays if it
//! holds every node that it writes, and every node that it reads is held by itself or by another reader. Of two in conflict over a node, one
//! writes it and stays only as the holder; then the other one finds a writer there and goes. The largest key of all stays.
//!
//! Paths need no memory: the search hands on the top, and the arms follow the links. They may have any length up to
//! [`MAX_STEPS`](super::search::MAX_STEPS), which bounds what a search can reach (the published path of 128 bits ends after 127 steps).

use super::Move;
use crate::aabb::Aabb;
use crate::node::WholeNodes;

/// What the nodes of a reinsertion beside its [`MoveNodes`](super::MoveNodes) are found from.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// The node that moves.
    pub input: u32,
    /// Its new sibling.
    pub output: u32,
    /// The child of the pivot above `output`, or `output` itself.
    pub top: u32,
}

impl Footprint {
    /// Of a single move.
    #[inline(always)]
    #[must_use]
    pub fn of(found: &Move) -> Self {
        Self { input: found.input(), output: found.output, top: found.other }
    }

    /// Whether `holds(v, written)` is true of every node `v` on the two arms that the reinsertion writes or reads; asks all of them, some more than
    /// once: a node is written if it is ever said to be.
    #[inline(always)]
    pub fn all<T: WholeNodes + ?Sized>(self, nodes: &T, holds: impl Fn(usize, bool) -> bool) -> bool {
        let Self { input, output, top } = self;
        let pivot = nodes.parent(top);
        let mut all = holds(top as usize, false);

        let mut without = Aabb::EMPTY;
        let mut shrinks = true;
        let mut below = input;
        let mut v = nodes.parent(input);
        while shrinks && v != pivot {
            without = without.union(nodes.box_of(nodes.sibling(below)));
            shrinks = !without.contains(nodes.box_of(v));
            all &= holds(v as usize, true);
            below = v;
            v = nodes.parent(v);
        }

        let input_box = nodes.box_of(input);
        let mut grows = true;
        let mut w = nodes.parent(output);
        while grows {
            grows = w != pivot && !nodes.box_of(w).contains(input_box);
            all &= holds(w as usize, grows);
            w = nodes.parent(w);
        }
        all
    }
}

//! Boxes, and rotations, from the leaves up by whole subtrees: for a processor of few threads.
//!
//! A [climb](mod@crate::climb) counts arrivals at every node, which is a locked addition and a look at the parent each. Where few invocations keep the device
//! busy, each of them takes a subtree instead and passes through it from below, in the order in which the links thread it: no counter, and what was written last
//! is read next. The result is that of a climb, bit for bit.
//!
//! Kind: one invocation per subtree. Those that begin `first` levels below the root are found by the bits of their number, and nothing above them is written in the
//! same dispatch. So three dispatches do a tree: from level 10 down to the leaves, from 5 to 10, from the root to 5.

use crate::aabb::Aabb;
use crate::math::umin;
use crate::mem::{AtomicU32, prefetch};
use crate::node::{AtomicNode, Links, RIGHT, ROOT};
use crate::rotations::{Offer, rotate_best, united};
use crate::status::{self, FAULT_BROKEN_TREE};
use bytemuck::{Pod, Zeroable};

/// [`SubtreesParams::last`] where subtrees end at the leaves, which get their boxes.
pub const TO_LEAVES: u32 = u32::MAX;

/// Leaves that are asked for before their turn comes. They are numbered in the order of the links, or nearly so, but the boxes lie anywhere, and
/// whether a node is rotated is not known before they are there.
const AHEAD: u32 = 16;

/// Push constants of [`refit`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SubtreesParams {
    /// Invocations: `2^first`.
    pub count: u32,
    /// References of the tree.
    pub references: u32,
    /// Levels between the root and the roots of the subtrees.
    pub first: u32,
    /// Levels between the root and the nodes that are done already, or [`TO_LEAVES`].
    pub last: u32,
    /// Whether nodes are rotated.
    pub rotates: u32,
    /// Flags of [`RotateParams`](crate::rotations::RotateParams).
    pub flags: u32,
    /// To whom rotations are offered.
    pub offer: Offer,
}

/// Invocation `i` makes the boxes of a subtree anew, and rotates. Reads `boxes[n]` of the references, reads and writes `nodes[2n-1]`. Raises
/// [`FAULT_BROKEN_TREE`] if it does not come back to where it began.
#[inline(always)]
pub fn refit(i: u32, params: &SubtreesParams, boxes: &[Aabb], nodes: &[AtomicNode], report: &[AtomicU32]) {
    let SubtreesParams { references, first, last, rotates, flags, offer, .. } = *params;
    let internal = references - 1;
    let mut top = ROOT;
    let mut level = 0;
    while level < first && top < internal {
        let left = nodes.down(top);
        level += 1;
        top = if (i >> (first - level)) & 1 != 0 { nodes.up(left) } else { left };
    }
    // Of those who come to the same leaf the first one takes it.
    let is_own = i & ((1 << (first - level)) - 1) == 0;
    let mut v = top;
    let mut is_done = !is_own;
    let mut rises = false;
    let mut steps = 0;
    while !is_done && steps < 3 * references {
        // Down to an internal node and up to it, and to each leaf.
        steps += 1;
        if !rises && v < internal && level < last {
            v = nodes.down(v);
            level += 1;
        } else {
            if v >= internal && last == TO_LEAVES {
                prefetch(boxes, nodes.down(umin(v + AHEAD, internal + internal)));
                let leaf = &nodes[v as usize];
                leaf.set_aabb(boxes[leaf.down() as usize]);
            }
            if v == top {
                is_done = true;
            } else {
                let up = nodes.up(v);
                rises = up & RIGHT != 0;
                let right = v;
                v = up & !RIGHT;
                if rises {
                    level -= 1;
                    let left = nodes.down(v);
                    let aabb = united(left, right, nodes);
                    if rotates != 0 && offer.is_for(v, aabb) {
                        rotate_best(v, left, right, internal, flags, nodes);
                    } else {
                        nodes[v as usize].set_aabb(aabb);
                    }
                }
            }
        }
    }
    if !is_done {
        status::raise(report, 0, FAULT_BROKEN_TREE);
    }
}

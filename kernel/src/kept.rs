//! Keeping the best tree without a copy of it: a node that changes its children for the first time since the best tree notes which it had.
//!
//! Kind: scatter ([`keep`], by the owner of the node), map with one writer per word ([`restore`]).

use crate::mem::{AtomicU32, Slot, atomic_words};
use crate::node::{AtomicNode, Links, RIGHT};
use bytemuck::{Pod, Zeroable};

/// The children that an internal node had in a best tree.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Kept {
    /// Number of that tree, from 1 on; 0 if the node never changed.
    pub epoch: u32,
    /// Its left child.
    pub left: u32,
    /// Its right child.
    pub right: u32,
}

/// A [`Kept`] whose words the invocations of a climb hand on.
#[repr(C)]
pub struct AtomicKept {
    epoch: AtomicU32,
    left: AtomicU32,
    right: AtomicU32,
}

atomic_words!(AtomicKept { epoch, left, right } of Kept);

impl AtomicKept {
    /// Notes the children that the node has now, unless those of the best tree `epoch` are noted already.
    #[inline(always)]
    pub fn keep(&self, left: u32, right: u32, epoch: u32) {
        if self.epoch.load() != epoch {
            self.epoch.store(epoch);
            self.left.store(left);
            self.right.store(right);
        }
    }
}

/// Push constants of [`restore`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct RestoreParams {
    /// Invocations: one per internal node, `n-1`.
    pub count: u32,
    /// The best tree.
    pub epoch: u32,
}

/// Other children of an internal node than it has.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Graft {
    /// The node.
    pub node: u32,
    /// Its left child.
    pub left: u32,
    /// Its right child.
    pub right: u32,
}

/// Push constants of [`graft`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct GraftParams {
    /// Invocations: one per graft.
    pub count: u32,
}

/// Invocation `i` gives a node its other children. Boxes are stale until the next refit.
#[inline(always)]
pub fn graft(i: u32, grafts: &[Graft], nodes: &[AtomicNode]) {
    let Graft { node, left, right } = grafts[i as usize];
    set_children(node, left, right, nodes);
}

#[inline(always)]
fn set_children(v: u32, left: u32, right: u32, nodes: &[AtomicNode]) {
    nodes[v as usize].set_down(left);
    nodes[left as usize].set_up(right);
    nodes[right as usize].set_up(v | RIGHT);
}

/// Notes the children of `v`, which its caller owns, unless those of the best tree `epoch` are noted already.
#[inline(always)]
pub fn keep(v: u32, epoch: u32, nodes: &[AtomicNode], kept: &[Slot<Kept>]) {
    if kept[v as usize].get().epoch != epoch {
        let left = nodes.down(v);
        kept[v as usize].set(Kept { epoch, left, right: nodes.up(left) });
    }
}

/// Invocation `i` gives node `i` the children back that it had in the best tree. Boxes are stale until the next refit.
#[inline(always)]
pub fn restore(i: u32, params: &RestoreParams, kept: &[Kept], nodes: &[AtomicNode]) {
    let Kept { epoch, left, right } = kept[i as usize];
    if epoch == params.epoch {
        set_children(i, left, right, nodes);
    }
}

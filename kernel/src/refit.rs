//! Boxes bottom-up.
//!
//! Source: Karras 2012, §4 (last paragraph); Meister & Bittner 2018, §5 "Recompute bounding boxes". Kind: [`climb`](mod@crate::climb).

use crate::climb::climb;
use crate::mem::AtomicU32;
use crate::node::AtomicNode;
use bytemuck::{Pod, Zeroable};

/// Push constants of [`refit`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct RefitParams {
    /// Invocations: one per leaf, `n`.
    pub count: u32,
}

/// Invocation `i` climbs from leaf `i`. Reads and writes `nodes[2n-1]` and `arrivals[n-1]`, which starts as 0 and ends as 2
/// everywhere if the links are a tree.
#[inline(always)]
pub fn refit(i: u32, params: &RefitParams, nodes: &[AtomicNode], arrivals: &[AtomicU32]) {
    climb(i, params.count, nodes, arrivals, move |p, left, right| {
        nodes[p as usize].set_aabb(nodes[left as usize].aabb().union(nodes[right as usize].aabb()));
    });
}

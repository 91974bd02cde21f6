//! Boxes bottom-up.
//!
//! Source: Karras 2012, §4 (last paragraph); Meister & Bittner 2018, §5 "Recompute bounding boxes". Kind: climb: the second
//! arrival at a node finds both children's boxes and continues, the first one ends. No race: a box is written by the one
//! invocation that arrives second, and read by whoever arrives second above it, after an acquiring arrival.

use crate::mem::AtomicU32;
use crate::node::{AtomicNode, Links, NO_NODE};
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
    let mut v = params.count - 1 + i;
    for _ in 0..params.count {
        let p = nodes.parent(v);
        if p == NO_NODE || arrivals[p as usize].arrive() == 0 {
            break;
        }
        let left = nodes.down(p);
        let right = nodes.up(left);
        nodes[p as usize].set_aabb(nodes[left as usize].aabb().union(nodes[right as usize].aabb()));
        v = p;
    }
}

//! Sums of half surface areas, from which the SAH cost is made.
//!
//! Source: MacDonald & Booth 1990; Meister & Bittner 2018, eq. 1 with c_T = 3, c_I = 2. Kind: map over fixed chunks: the host
//! adds the partial sums in f64, so that a cost has the same bits on every device.

use crate::math::umin;
use crate::mem::{AtomicU32, Slot};
use crate::node::Node;
use crate::status::{self, FAULT_BROKEN_TREE};
use bytemuck::{Pod, Zeroable};

/// Nodes whose areas one invocation adds up.
pub const COST_CHUNK: u32 = 256;

/// Push constants of [`cost`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CostParams {
    /// Invocations: one per [`COST_CHUNK`] nodes.
    pub count: u32,
    /// First node of the sum.
    pub first: u32,
    /// Nodes of the sum.
    pub nodes: u32,
    /// Internal nodes of the tree, `n-1`.
    pub internal: u32,
    /// Where the sums begin in `partial`.
    pub to: u32,
    /// What the refit leaves in every element of `arrivals`: 2 after one of all boxes, 0 after one of the paths that changed; [`NO_REFIT`] without one.
    pub arrived: u32,
}

/// [`CostParams::arrived`] of a tree that was not refitted: nothing is checked.
pub const NO_REFIT: u32 = u32::MAX;

/// Invocation `i` adds up the half areas of 256 nodes into `partial[to + i]`. Reads `nodes[2n-1]` and `arrivals[n-1]` as the
/// refit left it: an internal node that was not completed raises [`FAULT_BROKEN_TREE`] in `report`.
#[inline(always)]
pub fn cost(
    i: u32,
    params: &CostParams,
    nodes: &[Node],
    arrivals: &[u32],
    partial: &[Slot<f32>],
    report: &[AtomicU32],
) {
    let first = i * COST_CHUNK;
    let end = umin(first + COST_CHUNK, params.nodes);
    let mut sum = 0.0f32;
    let mut broken = false;
    for k in first..end {
        let v = params.first + k;
        sum += nodes[v as usize].aabb().half_area();
        if params.arrived != NO_REFIT && v < params.internal && arrivals[v as usize] != params.arrived {
            broken = true;
        }
    }
    partial[(params.to + i) as usize].set(sum);
    if broken {
        status::raise(report, 0, FAULT_BROKEN_TREE);
    }
}

//! Sums of half surface areas, from which the SAH cost is made.
//!
//! Source: MacDonald & Booth 1990; Meister & Bittner 2018, eq. 1 with c_T = 3, c_I = 2. Kind: workgroups over fixed chunks, each a sum
//! of fixed shape; the host adds the partial sums in f64, so that a cost has the same bits on every device.

use crate::math::umin;
use crate::mem::{AtomicU32, SharedU32, Slot};
use crate::node::Node;
use crate::status::{self, FAULT_BROKEN_TREE};
use crate::workgroup::Workgroup;
use bytemuck::{Pod, Zeroable};

/// Nodes whose areas one invocation adds up.
const RUN: u32 = 16;
/// Such runs of a workgroup.
const RUNS: u32 = 64;
/// Nodes whose areas one workgroup adds up.
pub const COST_CHUNK: u32 = RUN * RUNS;
/// Most additions that an area goes through in a chunk.
pub const COST_ADDITIONS: u32 = COST_CHUNK.ilog2();

/// Push constants of [`cost`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CostParams {
    /// Invocations: a workgroup for each [`COST_CHUNK`] nodes.
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

/// Words that the workgroup of [`cost`] shares.
pub const COST_WORDS: usize = RUNS as usize + RUNS as usize / 8;

/// Workgroup `g` adds up the half areas of 1,024 nodes into `partial[to + g]`. Reads `nodes[2n-1]` and `arrivals[n-1]` as the
/// refit left it: an internal node that was not completed raises [`FAULT_BROKEN_TREE`] in `report`.
///
/// The sum is a binary tree over the nodes in their order: 16 nodes, 8 of these, 8 of these again. A node that is not there adds 0.
#[inline(always)]
pub fn cost<W: Workgroup>(
    w: &W,
    params: &CostParams,
    nodes: &[Node],
    arrivals: &[u32],
    partial: &[Slot<f32>],
    report: &[AtomicU32],
    sums: &[SharedU32; COST_WORDS],
) {
    let from = w.group() * COST_CHUNK;
    let (first, count, to) = (params.first, params.nodes, params.to + w.group());
    let (internal, arrived) = (params.internal, params.arrived);
    w.each(RUNS, move |run| {
        let begin = from + run * RUN;
        let area = move |k: u32| if k < count { nodes[(first + k) as usize].aabb().half_area() } else { 0.0 };
        let four = move |k: u32| (area(k) + area(k + 1)) + (area(k + 2) + area(k + 3));
        let sum = (four(begin) + four(begin + 4)) + (four(begin + 8) + four(begin + 12));
        sums[run as usize].store_f32(sum);
        if arrived != NO_REFIT {
            let mut broken = false;
            for k in begin..umin(begin + RUN, count) {
                let v = first + k;
                broken |= v < internal && arrivals[v as usize] != arrived;
            }
            if broken {
                status::raise(report, 0, FAULT_BROKEN_TREE);
            }
        }
    });
    w.each(RUNS / 8, move |eight| sums[(RUNS + eight) as usize].store_f32(sum_of_8(sums, 8 * eight)));
    w.phase(move |lane| {
        if lane == 0 {
            partial[to as usize].set(sum_of_8(sums, RUNS));
        }
    });
}

#[inline(always)]
fn sum_of_8(sums: &[SharedU32; COST_WORDS], at: u32) -> f32 {
    let get = move |k: u32| sums[(at + k) as usize].load_f32();
    ((get(0) + get(1)) + (get(2) + get(3))) + ((get(4) + get(5)) + (get(6) + get(7)))
}

//! PLOC: clusters in Morton order merge with their nearest neighbours, bottom-up, until one is left.
//!
//! Source: Meister & Bittner 2017, §3. Each round is `ploc_nearest` (map), `ploc_mark` (workgroups), which counts the clusters that go,
//! and `ploc_merge` (workgroups), which also closes the gaps and so keeps the order.
//!
//! # Differences from the paper
//! *Ties.* The distance of two clusters is the area of their union; equal distances are told apart by `i ^ j` of their places in the list.
//! Both are the same seen from either side and no two candidates of a cluster share both, so the smallest pair of all is mutual and every
//! round merges. The paper's own rule (lowest index) promises no more than that pair among equal boxes: all choose the same neighbour.
//! Here `i` and `i ^ 1` choose each other, and the list halves.
//!
//! *Chains.* Where each cluster is nearest to one that has a nearer one yet (triangles around one centre, each larger than the last), a
//! round still merges a single pair. After a round that merged less than one cluster in [`SLOW_ROUND`] the next one pairs `i`
//! with `i ^ 1` whatever their distance, so that the rounds grow with the logarithm of the references for every input.
//!
//! *Numbers.* A new node is numbered by the scan, where the paper counts with an atomic: the tree is the same array on every device.
//! The first merges take the highest numbers, hence the last one is the root.

pub mod merge;
pub mod nearest;

use crate::aabb::Aabb;
use crate::mem::Slot;
use bytemuck::{Pod, Zeroable};

/// A round that merges less than one cluster in so many is followed by one that pairs neighbours in the list.
pub const SLOW_ROUND: u32 = 32;

/// A cluster: the root of a finished subtree, 28 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Cluster {
    /// The node's box.
    pub aabb: Aabb,
    /// The node.
    pub node: u32,
}

/// How far the rounds have come; every round reads one and writes the next, so that the host need not ask after each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Progress {
    /// Clusters in the list.
    pub clusters: u32,
    /// Clusters that the last round merged away; before the first round as many as there are.
    pub merged: u32,
    /// Rounds done, as long as there were two clusters.
    pub rounds: u32,
    /// How many of these paired neighbours in the list.
    pub paired_rounds: u32,
}

impl Progress {
    /// Whether the next round pairs neighbours in the list.
    #[inline(always)]
    #[must_use]
    pub fn is_slow(&self) -> bool {
        self.merged < self.clusters / SLOW_ROUND
    }
}

/// Push constants of [`clusters`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ClustersParams {
    /// Invocations: one per cluster.
    pub count: u32,
}

/// Invocation `i` makes leaf `i` the cluster `i`. Kind: map. Reads `order[n]`, `boxes[n]`; writes `clusters[n]` and, the first one,
/// `progress[1]`.
#[inline(always)]
pub fn clusters(
    i: u32,
    params: &ClustersParams,
    order: &[u32],
    boxes: &[Aabb],
    clusters: &[Slot<Cluster>],
    progress: &[Slot<Progress>],
) {
    let aabb = boxes[order[i as usize] as usize];
    clusters[i as usize].set(Cluster { aabb, node: params.count - 1 + i });
    if i == 0 {
        progress[0].set(Progress { clusters: params.count, merged: params.count, rounds: 0, paired_rounds: 0 });
    }
}

//! PLOC merge: pairs of clusters that are nearest to each other become one node each.
//!
//! Source: Meister & Bittner 2017, §3.2 and §3.3. The left cluster of a pair makes the node and keeps its place in the list, the right one
//! goes. One scan gives both numbers that are needed: the clusters that went before `i` tell how far `i` moves up, and those before the
//! right cluster of a pair tell which pair it is.

use super::{Cluster, ClustersParams, Progress};
use crate::mem::Slot;
use crate::node::{AtomicNode, NO_NODE, RIGHT, ROOT};
use bytemuck::{Pod, Zeroable};

/// Push constants of [`mark`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct MarkParams {
    /// Invocations: one more than [`ClustersParams::count`] of the round.
    pub count: u32,
}

/// Whether two different clusters are nearest to each other.
#[inline(always)]
fn is_mutual(i: u32, j: u32, neighbours: &[u32]) -> bool {
    i != j && neighbours[j as usize] == i
}

/// Invocation `i` marks cluster `i` with 1 if it is the right one of a pair, else with 0. Kind: map. Reads `neighbours[c]` and
/// `progress[1]`, writes `marks[count]`, all of it, so that the last word of its exclusive scan is the number of pairs.
#[inline(always)]
pub fn mark(i: u32, neighbours: &[u32], progress: &[Progress], marks: &[Slot<u32>]) {
    let mut goes = 0;
    if i < progress[0].clusters {
        let j = neighbours[i as usize];
        if j < i && is_mutual(i, j, neighbours) {
            goes = 1;
        }
    }
    marks[i as usize].set(goes);
}

/// Invocation `i` moves cluster `i` to its place in the next list, merged with its right neighbour if they are a pair. Kind: scatter: each
/// place of the list and each word of a node is written by one invocation.
///
/// Reads the scanned `marks[count + 1]`, `neighbours[c]`, `clusters[c]` and `progress[1]`; writes `nodes[2n-1]` (the
/// new nodes and `up` of their children), `next_clusters` and, the first invocation, `next_progress[1]`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn merge(
    i: u32,
    params: &ClustersParams,
    neighbours: &[u32],
    marks: &[u32],
    clusters: &[Cluster],
    progress: &[Progress],
    nodes: &[AtomicNode],
    next_clusters: &[Slot<Cluster>],
    next_progress: &[Slot<Progress>],
) {
    let now = progress[0];
    if i == 0 {
        next_progress[0].set(advance(now, marks[params.count as usize]));
    }
    if i >= now.clusters {
        return;
    }
    let j = neighbours[i as usize];
    let pair = is_mutual(i, j, neighbours);
    if pair && j < i {
        return;
    }
    let mut cluster = clusters[i as usize];
    if pair {
        let left = cluster.node;
        let right = clusters[j as usize].node;
        // c clusters are left to be joined by nodes [0, c-1).
        let v = now.clusters - 2 - marks[j as usize];
        let aabb = cluster.aabb.union(clusters[j as usize].aabb);
        let node = &nodes[v as usize];
        node.set_aabb(aabb);
        node.set_down(left);
        nodes[left as usize].set_up(right);
        nodes[right as usize].set_up(v | RIGHT);
        if v == ROOT {
            node.set_up(NO_NODE);
        }
        cluster = Cluster { aabb, node: v };
    }
    next_clusters[(i - marks[i as usize]) as usize].set(cluster);
}

/// The progress after a round that merged `merged` clusters away; a round over one cluster is none.
#[inline(always)]
fn advance(now: Progress, merged: u32) -> Progress {
    if now.clusters < 2 {
        return now;
    }
    Progress {
        clusters: now.clusters - merged,
        merged,
        rounds: now.rounds + 1,
        paired_rounds: now.paired_rounds + if now.is_slow() { 1 } else { 0 },
    }
}

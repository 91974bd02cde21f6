//! PLOC merge: pairs of clusters that are nearest to each other become one node each.
//!
//! Source: Meister & Bittner 2017, §3.2 and §3.3. The left cluster of a pair makes the node and keeps its place in the list, the right one
//! goes. One prefix sum gives both numbers that are needed: the clusters that went before `i` tell how far `i` moves up, and those before the
//! right cluster of a pair tell which pair it is.

use super::{Cluster, Progress};
use crate::math::umin;
use crate::mem::{SharedU32, Slot};
use crate::node::{AtomicNode, NO_NODE, RIGHT, ROOT};
use crate::workgroup::{SCAN_WORDS, Workgroup, scan, total};
use bytemuck::{Pod, Zeroable};

/// Most workgroups of a round: each looks at what all of them have counted.
pub const MOST_GROUPS: u32 = 1024;

/// Push constants of [`mark`] and [`merge`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct MergeParams {
    /// Invocations: a workgroup for each chunk.
    pub count: u32,
    /// Clusters in a chunk.
    pub chunk: u32,
    /// Chunks, [`MOST_GROUPS`] at the most.
    pub chunks: u32,
}

/// Whether two different clusters are nearest to each other.
#[inline(always)]
fn is_mutual(i: u32, j: u32, neighbours: &[u32]) -> bool {
    i != j && neighbours[j as usize] == i
}

/// Words that the workgroup of [`mark`] shares.
pub const MARK_WORDS: usize = SCAN_WORDS as usize;

/// Workgroup `c` counts in chunk `c` the clusters that go, being the right ones of pairs. Kind: workgroups. Reads `neighbours[c]` and
/// `progress[1]`, writes for each cluster how many go before it in its chunk, `marks[c]`, and how many go in all of the chunk, `gone[chunks]`.
#[inline(always)]
pub fn mark<W: Workgroup>(
    w: &W,
    params: &MergeParams,
    neighbours: &[u32],
    progress: &[Progress],
    marks: &[Slot<u32>],
    gone: &[Slot<u32>],
    shared: &[SharedU32; MARK_WORDS],
) {
    let (chunk, clusters) = (w.group(), progress[0].clusters);
    let first = umin(chunk * params.chunk, clusters);
    let length = umin(params.chunk, clusters - first);
    let goes = move |i: u32| {
        let j = neighbours[i as usize];
        if j < i && is_mutual(i, j, neighbours) { 1 } else { 0 }
    };
    scan(
        w,
        shared,
        0,
        length,
        move |k| goes(first + k),
        move |k, before| {
            marks[(first + k) as usize].set(before);
            goes(first + k)
        },
    );
    w.phase(move |lane| {
        if lane == 0 {
            gone[chunk as usize].set(total::<W, MARK_WORDS>(shared, 0));
        }
    });
}

/// Words that the workgroup of [`merge`] shares.
pub const MERGE_WORDS: usize = (MOST_GROUPS + SCAN_WORDS) as usize;

/// Workgroup `c` moves the clusters of chunk `c` to their places in the next list, each merged with its right neighbour if they are a pair. Kind: workgroups, scatter: each
/// place of the list and each word of a node is written by one invocation.
///
/// Reads `marks[c]` and `gone[chunks]`, `neighbours[c]`, `clusters[c]` and `progress[1]`; writes `nodes[2n-1]` (the
/// new nodes and `up` of their children), `next_clusters` and, the first workgroup, `next_progress[1]`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn merge<W: Workgroup>(
    w: &W,
    params: &MergeParams,
    neighbours: &[u32],
    marks: &[u32],
    gone: &[u32],
    clusters: &[Cluster],
    progress: &[Progress],
    nodes: &[AtomicNode],
    next_clusters: &[Slot<Cluster>],
    next_progress: &[Slot<Progress>],
    before_chunk: &[SharedU32; MERGE_WORDS],
) {
    let now = progress[0];
    let chunk = params.chunk;
    scan(
        w,
        before_chunk,
        MOST_GROUPS,
        params.chunks,
        move |k| gone[k as usize],
        move |k, before| {
            before_chunk[k as usize].store(before);
            gone[k as usize]
        },
    );
    let group = w.group();
    let first = umin(group * chunk, now.clusters);
    let length = umin(chunk, now.clusters - first);
    // How many clusters go before cluster `i`.
    let gone_before = move |i: u32| before_chunk[(i / chunk) as usize].load() + marks[i as usize];
    w.each(length, move |k| {
        let i = first + k;
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
            let v = now.clusters - 2 - gone_before(j);
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
        next_clusters[(i - gone_before(i)) as usize].set(cluster);
    });
    w.phase(move |lane| {
        if lane == 0 && group == 0 {
            next_progress[0].set(advance(now, total::<W, MERGE_WORDS>(before_chunk, MOST_GROUPS)));
        }
    });
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

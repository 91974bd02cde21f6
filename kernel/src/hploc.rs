//! H-PLOC: clusters merge with their nearest neighbours as the ranges of a radix tree join, in one climb.
//!
//! Source: Benthin, Meister, Barczak, Mehalwal, Tsakok & Kensler 2024, *H-PLOC*. The radix tree is that of the Morton codes ([`crate::lbvh`]);
//! nothing of it is left in the result. Each of its nodes takes over the clusters of both children; where they are more than [`KEPT`], rounds of PLOC
//! ([`crate::ploc`]) over these few merge them until they are not, and at the root until one is left.
//!
//! Kind: [`climb`](mod@crate::climb), in stages.
//!
//! # Differences from the paper
//! *One invocation* does the rounds of a node, where a subgroup did: at most 32 clusters, and no subgroup operations.
//!
//! *Stages.* A climb ends after [`STEPS`] nodes and goes on in the next dispatch, so that no invocation comes near the rounds that a device lets its
//! loops run.
//!
//! *Ties* are told apart by `i ^ j` of the places in the list, as in [`crate::ploc`]: equal boxes make a balanced tree.
//!
//! *Numbers.* A merge takes its node from those that the radix tree has in the range, where the paper counts with an atomic: the tree is the same
//! array on every device. Of `c` clusters in a range `c - 1` nodes are not yet taken, and the root of the range is the last to be.

use crate::forest::Forest;
use crate::math::umin;
use crate::mem::{AtomicU32, Slot};
use crate::node::{AtomicNode, Links, NO_NODE, Node, RIGHT, ROOT};
use crate::ploc::nearest::distance;
use bytemuck::{Pod, Zeroable};

/// Most clusters that a range hands on.
pub const KEPT: u32 = 16;

/// Most nodes that an invocation completes in a stage.
pub const STEPS: u32 = 4;

const SLOTS: usize = 2 * KEPT as usize;

/// Most rounds of all loops of a stage: per node a round for each merge, or fewer, over all pairs within any radius, and the list read, closed up and
/// written.
const MOST_ROUNDS: u32 = STEPS * (KEPT * (KEPT * (2 * KEPT - 1) + 6 * KEPT) + 8 * KEPT);
// lavapipe leaves a loop after 65,535 rounds in all, without a word.
const _: () = assert!(MOST_ROUNDS < 65_535);

/// Value of `places` where a climb is over.
const OVER: u32 = u32::MAX;

/// Push constants of [`stage`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct HplocParams {
    /// Invocations: one per leaf, `n`.
    pub count: u32,
    /// Places in the list that a cluster looks to the left and to the right, at least 1; beyond 31 there are none.
    pub radius: u32,
}

/// Invocation `i` goes on from where it is, `places[i]`: leaf `i` at first, where it is 0, else one less than the number.
///
/// Reads the radix tree `radix[2n-1]` and the leaves `nodes[n-1..2n-1]`; writes the other `nodes[2n-1]` and `up` of all. `clusters[n]` and `spare[n]` hold
/// clusters and nodes not yet taken of each range, `sizes[n-1]` how many clusters these are. `arrivals[n-1]` starts as 0. Adds to `waiting[1]` the climbs
/// that are not over.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn stage(
    i: u32,
    params: &HplocParams,
    radix: &[Node],
    nodes: &[AtomicNode],
    clusters: &[AtomicU32],
    spare: &[AtomicU32],
    sizes: &[AtomicU32],
    arrivals: &[AtomicU32],
    places: &[Slot<u32>],
    waiting: &[AtomicU32],
) {
    let internal = params.count - 1;
    let place = places[i as usize].get();
    if place == OVER {
        return;
    }
    let mut v = if place == 0 { internal + i } else { place - 1 };
    let mut is_over = false;
    for _ in 0..STEPS {
        let p = radix.parent(v);
        if p == NO_NODE || arrivals[p as usize].arrive() == 0 {
            is_over = true;
            break;
        }
        let left = radix.down(p);
        let right = radix.up(left);
        let mut list = List::new();
        list.spare[0] = p;
        list.spares = 1;
        list.take(left, true, nodes, clusters, spare, sizes);
        list.take(right, false, nodes, clusters, spare, sizes);
        let most = if p == ROOT { 1 } else { KEPT };
        for _ in 0..SLOTS {
            if list.forest.count <= most {
                break;
            }
            list.find_nearest(params.radius);
            list.merge(nodes);
        }
        list.leave(p, radix[p as usize].is_left(), clusters, spare, sizes);
        v = p;
    }
    places[i as usize].set(if is_over { OVER } else { v + 1 });
    if !is_over {
        waiting[0].add(1);
    }
}

/// Where the clusters of an internal node of the radix tree begin. A left child has the number of the last leaf of its range, a right one of the first
/// (Karras 2012, §3): they lie beside that place.
#[inline(always)]
fn first(v: u32, is_left: bool, count: u32) -> u32 {
    if is_left { v + 1 - count } else { v }
}

/// The clusters of a range in their order, in memory of the invocation's own.
struct List {
    forest: Forest<SLOTS>,
    /// Place of the nearest, and how far it is.
    nearest: [u32; SLOTS],
    distances: [u32; SLOTS],
    /// Nodes not yet taken.
    spares: u32,
    spare: [u32; SLOTS],
}

impl List {
    #[inline(always)]
    fn new() -> Self {
        Self { forest: Forest::new(), nearest: [0; SLOTS], distances: [0; SLOTS], spares: 0, spare: [0; SLOTS] }
    }

    /// Adds the clusters of a node of the radix tree, and its nodes not yet taken.
    #[inline(always)]
    fn take(
        &mut self,
        v: u32,
        is_left: bool,
        nodes: &[AtomicNode],
        clusters: &[AtomicU32],
        spare: &[AtomicU32],
        sizes: &[AtomicU32],
    ) {
        if v >= sizes.len() as u32 {
            self.forest.push(v, nodes[v as usize].aabb());
            return;
        }
        let count = umin(sizes[v as usize].load(), KEPT);
        let first = first(v, is_left, count);
        for k in 0..count {
            let at = (first + k) as usize;
            let node = clusters[at].load();
            self.forest.push(node, nodes[node as usize].aabb());
            if k > 0 {
                self.spare[self.spares as usize] = spare[at].load();
                self.spares += 1;
            }
        }
    }

    /// Leaves the clusters to the parent of node `p`, with the nodes not yet taken.
    #[inline(always)]
    fn leave(&self, p: u32, is_left: bool, clusters: &[AtomicU32], spare: &[AtomicU32], sizes: &[AtomicU32]) {
        sizes[p as usize].store(self.forest.count);
        let first = first(p, is_left, self.forest.count);
        for k in 0..self.forest.count {
            let at = (first + k) as usize;
            clusters[at].store(self.forest.node(k));
            if k > 0 {
                spare[at].store(self.spare[(k - 1) as usize]);
            }
        }
    }

    /// Finds the nearest neighbour of every cluster: the smallest (distance, `i ^ j`).
    #[inline(always)]
    fn find_nearest(&mut self, radius: u32) {
        for i in 0..self.forest.count {
            self.nearest[i as usize] = i;
            self.distances[i as usize] = u32::MAX;
        }
        for i in 0..self.forest.count {
            let own = self.forest.aabb(i);
            let last = umin(self.forest.count - 1, i + umin(radius, SLOTS as u32));
            for j in i + 1..last + 1 {
                let distance = distance(own, self.forest.aabb(j));
                self.offer(i, j, distance);
                self.offer(j, i, distance);
            }
        }
    }

    #[inline(always)]
    fn offer(&mut self, i: u32, j: u32, distance: u32) {
        let least = self.distances[i as usize];
        if distance < least || (distance == least && i ^ j < i ^ self.nearest[i as usize]) {
            self.nearest[i as usize] = j;
            self.distances[i as usize] = distance;
        }
    }

    /// Merges the pairs that are nearest to each other, each in the place of its left one, and closes the gaps.
    #[inline(always)]
    fn merge(&mut self, nodes: &[AtomicNode]) {
        let mut kept = 0;
        for i in 0..self.forest.count {
            let j = self.nearest[i as usize];
            let is_pair = i != j && self.nearest[j as usize] == i;
            if !is_pair {
                self.forest.put(kept, self.forest.node(i), self.forest.aabb(i));
                kept += 1;
            } else if i < j {
                self.spares -= 1;
                let v = self.spare[self.spares as usize];
                let aabb = self.forest.aabb(i).union(self.forest.aabb(j));
                let (left, right) = (self.forest.node(i), self.forest.node(j));
                let node = &nodes[v as usize];
                node.set_aabb(aabb);
                node.set_down(left);
                nodes[left as usize].set_up(right);
                nodes[right as usize].set_up(v | RIGHT);
                if v == ROOT {
                    node.set_up(NO_NODE);
                }
                self.forest.put(kept, v, aabb);
                kept += 1;
            }
        }
        self.forest.count = kept;
    }
}

//! One treelet: its leaves are found, joined anew, and the result is kept where it is cheaper.
//!
//! Source: Domingues & Pedrini 2015; the choice of the leaves is that of Karras & Aila 2013. Kind: scatter: an
//! invocation reads and writes nodes of its treelet only (see [`super`]).
//!
//! The cost of a treelet is the sum of its internal nodes' areas: its leaves and its root are the same before and after. What differs from the
//! published code: the nearest lower neighbour of each cluster is kept instead of a matrix of all distances (64 words instead of 496, the
//! same pairs), and a treelet is only replaced where the sums differ by more than their rounding.

use super::MAX_TREELET;
use super::clusters::Clusters;
use crate::mem::AtomicU32;
use crate::node::{AtomicNode, Links, RIGHT};
use crate::status::{self, APPLIED, FAULT_TREELET};
use bytemuck::{Pod, Zeroable};

/// A sum of areas must fall by this part of it. Two sums of 30 areas are each off by no more than 36 roundings of 2^-24.
pub const RELATIVE_THRESHOLD: f32 = 1.0 / (1 << 17) as f32;

/// Most rounds of all loops of one invocation: after each join a search in every slot, and less than four times the slots for all else. Invocations
/// that run in lockstep share the count, so that no loop is taken for shorter than the longest.
const MOST_ROUNDS: u32 = MAX_TREELET * MAX_TREELET * (MAX_TREELET + 4);
// lavapipe leaves a loop after 65,535 rounds in all, without a word.
const _: () = assert!(MOST_ROUNDS < 65_535);

/// Push constants of [`restructure`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct RestructureParams {
    /// Invocations: one per treelet.
    pub count: u32,
    /// Where the treelet roots begin in the order.
    pub first: u32,
    /// Most leaves of a treelet, 3 to [`MAX_TREELET`].
    pub treelet: u32,
    /// Internal nodes of the tree, `n-1`.
    pub internal: u32,
}

const SLOTS: usize = MAX_TREELET as usize;

/// Invocation `i` processes the treelet below the internal node `order[first + i]`. Reads and writes `nodes[2n-1]`; counts the treelets that it
/// replaced in `report`.
#[inline(always)]
pub fn restructure(i: u32, params: &RestructureParams, order: &[u32], nodes: &[AtomicNode], report: &[AtomicU32]) {
    let root = order[(params.first + i) as usize];
    let mut clusters = Clusters::new();
    let mut opened = [0u32; SLOTS];
    let old_area = open(root, params, nodes, &mut clusters, &mut opened);
    let leaves = clusters.count;

    // Join `k` makes `made[k]` out of `left[k]` and `right[k]`; the last one makes the root.
    let mut made = [0u32; SLOTS];
    let mut left = [0u32; SLOTS];
    let mut right = [0u32; SLOTS];
    let mut new_area = 0.0f32;
    clusters.find_all_nearest();
    for k in 0..leaves - 1 {
        let pair = clusters.nearest_pair();
        let last = k == leaves - 2;
        // Nodes that were near the root are near it again.
        let node = if last { root } else { opened[(leaves - 3 - k) as usize] };
        made[k as usize] = node;
        left[k as usize] = clusters.node(pair.low);
        right[k as usize] = clusters.node(pair.high);
        if !last {
            new_area += pair.area;
        }
        clusters.join(pair, node);
    }
    if !clusters.are_joined() {
        status::raise(report, 0, FAULT_TREELET);
        return;
    }
    // Written so that a NaN changes nothing.
    if new_area < old_area - RELATIVE_THRESHOLD * old_area {
        let mut written = 0;
        for k in 0..leaves - 1 {
            let (node, l, r) = (made[k as usize], left[k as usize], right[k as usize]);
            nodes[node as usize].set_down(l);
            nodes[l as usize].set_up(r);
            nodes[r as usize].set_up(node | RIGHT);
            if node != root {
                nodes[node as usize].set_aabb(nodes[l as usize].aabb().union(nodes[r as usize].aabb()));
            }
            written += 1;
        }
        if written == leaves - 1 {
            report[APPLIED].add(1);
        } else {
            status::raise(report, 0, FAULT_TREELET);
        }
    }
}

/// Finds the leaves of the treelet below `root`: its children, of which the one with the largest area is replaced by its children, again and
/// again; the first of equals. Returns the sum of the half areas of the nodes that it opened, which it lists in `opened`, the root left out.
#[inline(always)]
fn open(
    root: u32,
    params: &RestructureParams,
    nodes: &[AtomicNode],
    clusters: &mut Clusters,
    opened: &mut [u32; SLOTS],
) -> f32 {
    // Negative where there is nothing to open.
    let mut areas = [-1.0f32; SLOTS];
    let mut sum = 0.0f32;
    let mut slot = 0;
    let mut node = root;
    for step in 1..params.treelet {
        if step > 1 {
            let mut largest = -1.0f32;
            for k in 0..clusters.count {
                if areas[k as usize] > largest {
                    largest = areas[k as usize];
                    slot = k;
                }
            }
            if largest < 0.0 {
                break;
            }
            node = clusters.node(slot);
            opened[(step - 2) as usize] = node;
            sum += largest;
        }
        let first = nodes.down(node);
        areas[slot as usize] = put(slot, first, params.internal, nodes, clusters);
        let second = nodes.up(first);
        areas[step as usize] = put(step, second, params.internal, nodes, clusters);
        clusters.count = step + 1;
    }
    sum
}

/// Puts node `v` into `slot`. Returns its half area, at least 0, or -1 if it is a leaf of the tree.
#[inline(always)]
fn put(slot: u32, v: u32, internal: u32, nodes: &[AtomicNode], clusters: &mut Clusters) -> f32 {
    let aabb = nodes[v as usize].aabb();
    clusters.put(slot, v, aabb);
    let area = aabb.half_area();
    if v >= internal {
        -1.0
    } else if area > 0.0 {
        area
    } else {
        0.0
    }
}

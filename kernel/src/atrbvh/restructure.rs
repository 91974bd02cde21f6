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
use super::treelet::{RELATIVE_THRESHOLD, RestructureParams, link, open};
use crate::mem::AtomicU32;
use crate::node::AtomicNode;
use crate::status::{self, APPLIED, FAULT_TREELET};

/// Most rounds of all loops of one invocation: after each join a search in every slot, and less than four times the slots for all else. Invocations
/// that run in lockstep share the count, so that no loop is taken for shorter than the longest.
const MOST_ROUNDS: u32 = MAX_TREELET * MAX_TREELET * (MAX_TREELET + 4);
// lavapipe leaves a loop after 65,535 rounds in all, without a word.
const _: () = assert!(MOST_ROUNDS < 65_535);

const SLOTS: usize = MAX_TREELET as usize;

/// Invocation `i` processes the treelet below the internal node `order[first + i]`. Reads and writes `nodes[2n-1]`; counts the treelets that it
/// replaced in `report`.
#[inline(always)]
pub fn restructure(i: u32, params: &RestructureParams, order: &[u32], nodes: &[AtomicNode], report: &[AtomicU32]) {
    let root = order[(params.first + i) as usize];
    let mut clusters = Clusters::new();
    let mut opened = [0u32; SLOTS];
    let old_area = open(root, params, nodes, &mut clusters.forest, &mut opened);
    let leaves = clusters.forest.count;

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
        left[k as usize] = clusters.forest.node(pair.low);
        right[k as usize] = clusters.forest.node(pair.high);
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
            link(node, l, r, root, nodes);
            written += 1;
        }
        if written == leaves - 1 {
            report[APPLIED].add(1);
        } else {
            status::raise(report, 0, FAULT_TREELET);
        }
    }
}

//! One treelet: its leaves are found, and the best of all trees over them takes its place if it is cheaper.
//!
//! Source: Karras & Aila 2013 (dynamic programming over the subsets of the leaves). Kind: scatter: an invocation reads and writes nodes of its
//! treelet only (see [`super`]).
//!
//! A subset is a word with a bit for each leaf, so that every subset comes after its own subsets in the order of the words. The cost of a subset
//! is the area of its box and the least that two halves of it cost; a leaf costs nothing, since it stays what it is. What differs from the
//! published code: an invocation does a treelet alone where a warp did, and a treelet is only replaced where the sums differ by more than
//! their rounding.

use super::treelet::{RELATIVE_THRESHOLD, RestructureParams, link, open};
use crate::aabb::Aabb;
use crate::forest::Forest;
use crate::mem::AtomicU32;
use crate::node::AtomicNode;
use crate::status::{self, APPLIED, FAULT_TREELET};

/// Most leaves of a treelet that is made optimal. The work grows by three for each leaf more.
pub const OPTIMAL_TREELET: u32 = 7;

const SLOTS: usize = OPTIMAL_TREELET as usize;

/// Subsets of the leaves.
const SETS: usize = 1 << OPTIMAL_TREELET;

/// Most rounds of all loops of one invocation: every half of every subset, the box of every subset, and little else.
const MOST_ROUNDS: u32 = 3u32.pow(OPTIMAL_TREELET) + (2 + OPTIMAL_TREELET) * SETS as u32 + 8 * OPTIMAL_TREELET;
// lavapipe leaves a loop after 65,535 rounds in all, without a word.
const _: () = assert!(MOST_ROUNDS < 65_535);

/// Half area of the box around the leaves in `set`.
#[inline(always)]
fn area(leaves: &Forest<SLOTS>, set: u32) -> f32 {
    let mut aabb = Aabb::EMPTY;
    for slot in 0..leaves.count {
        if (set >> slot) & 1 == 1 {
            aabb = aabb.union(leaves.aabb(slot));
        }
    }
    aabb.half_area()
}

/// Invocation `i` processes the treelet below the internal node `order[first + i]`, of at most [`OPTIMAL_TREELET`] leaves. Reads and writes
/// `nodes[2n-1]`; counts the treelets that it replaced in `report`.
#[inline(always)]
pub fn restructure_optimally(
    i: u32,
    params: &RestructureParams,
    order: &[u32],
    nodes: &[AtomicNode],
    report: &[AtomicU32],
) {
    let root = order[(params.first + i) as usize];
    let mut leaves = Forest::new();
    let mut opened = [0u32; SLOTS];
    let old_area = open(root, params, nodes, &mut leaves, &mut opened);
    let count = leaves.count;
    let all = (1u32 << count) - 1;

    // Of each subset what it costs, and the half of the best split that has not its lowest leaf.
    let mut costs = [0.0f32; SETS];
    let mut halves = [0u32; SETS];
    let mut solved = 0;
    for set in 1..all + 1 {
        let rest = set & (set - 1);
        if rest != 0 {
            let mut best = f32::INFINITY;
            let mut best_half = rest;
            let mut half = rest;
            for _ in 0..SETS as u32 / 2 {
                if half == 0 {
                    break;
                }
                let cost = costs[half as usize] + costs[(set ^ half) as usize];
                if cost < best {
                    best = cost;
                    best_half = half;
                }
                half = (half - 1) & rest;
            }
            // The root is there before and after.
            let own = if set == all { 0.0 } else { area(&leaves, set) };
            costs[set as usize] = own + best;
            halves[set as usize] = best_half;
        }
        solved += 1;
    }
    if solved != all {
        status::raise(report, 0, FAULT_TREELET);
        return;
    }
    // Written so that a NaN changes nothing.
    if costs[all as usize] < old_area - RELATIVE_THRESHOLD * old_area {
        // From the root down: nodes that were near the root are near it again.
        let mut made = [0u32; SLOTS];
        let mut sets = [0u32; SLOTS];
        let mut left = [0u32; SLOTS];
        let mut right = [0u32; SLOTS];
        made[0] = root;
        sets[0] = all;
        let mut filled = 1;
        for k in 0..count - 1 {
            let high = halves[sets[k as usize] as usize];
            let low = sets[k as usize] ^ high;
            for side in 0..2u32 {
                let set = if side == 0 { low } else { high };
                let node = if set & (set - 1) == 0 {
                    leaves.node(31 - set.leading_zeros())
                } else {
                    let node = opened[(filled - 1) as usize];
                    made[filled as usize] = node;
                    sets[filled as usize] = set;
                    filled += 1;
                    node
                };
                if side == 0 {
                    left[k as usize] = node;
                } else {
                    right[k as usize] = node;
                }
            }
        }
        // From below, for the boxes.
        let mut written = 0;
        for k in 0..count - 1 {
            let at = (count - 2 - k) as usize;
            link(made[at], left[at], right[at], root, nodes);
            written += 1;
        }
        if written == count - 1 && filled == count - 1 {
            report[APPLIED].add(1);
        } else {
            status::raise(report, 0, FAULT_TREELET);
        }
    }
}

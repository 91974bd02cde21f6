//! The clusters of a part become a binary subtree, and parts of the next level.

use super::assign::raised;
use super::{COUNT, LEFT, MOST_CLUSTERS, MOVED, NONE, PER_CLUSTER, Part, TALLY_WORDS, link, node_of};
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, SharedU32, Slot};
use crate::node::{AtomicNode, NO_NODE, ROOT};
use crate::workgroup::Workgroup;
use bytemuck::{Pod, Zeroable};

// What the workgroup of `join` shares. Clusters are numbered by their slots, pairs from `MOST_CLUSTERS` on.
const BOXES: u32 = 0;
/// Slot of the nearest cluster, and how far it is.
const NEAREST: u32 = BOXES + 6 * MOST_CLUSTERS;
const DISTANCES: u32 = NEAREST + MOST_CLUSTERS;
/// What is in a slot: the number of a cluster or a pair, or [`NONE`].
const HELD: u32 = DISTANCES + MOST_CLUSTERS;
/// Children of each pair.
const LOW: u32 = HELD + MOST_CLUSTERS;
const HIGH: u32 = LOW + MOST_CLUSTERS;
/// Of clusters and pairs: references, and the first place, with [`LEFT`].
const SIZES: u32 = HIGH + MOST_CLUSTERS;
const FIRST: u32 = SIZES + 2 * MOST_CLUSTERS;
/// The slots of the last pair; the first one is [`NONE`] if there was none to make. Then how many pairs there are.
const PAIR: u32 = FIRST + 2 * MOST_CLUSTERS;
const PAIRS: u32 = PAIR + 2;
/// Words that the workgroup of [`join`] shares.
pub const JOIN_WORDS: usize = (PAIRS + 1) as usize;

type Shared = [SharedU32; JOIN_WORDS];

/// A target: the part is halved.
const HALVED: u32 = u32::MAX;

/// Push constants of [`join`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct JoinParams {
    /// Invocations: a workgroup for each large part.
    pub count: u32,
    /// References of all parts, `n`.
    pub references: u32,
    /// Clusters of a part.
    pub clusters: u32,
    /// Whether all parts are halved (1): clusters did not become small for many levels.
    pub halves: u32,
}

/// Workgroup `g` joins the clusters of part `g`: the two whose common box is smallest, again and again. Of equal ones those whose slots differ in lower bits come first.
/// A part of which all references are in one cluster is halved.
///
/// Reads and empties `tallies`. Writes by slot the first place of each cluster, `targets`, and by first place `sizes[n]`, links of `nodes[2n-1]`; appends large
/// parts to `next` and the first places of small ones to `small`, as many as `progress` then counts.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn join<W: Workgroup>(
    w: &W,
    params: &JoinParams,
    parts: &[Part],
    tallies: &[Slot<u32>],
    targets: &[Slot<u32>],
    sizes: &[Slot<u32>],
    nodes: &[AtomicNode],
    next: &[Slot<Part>],
    small: &[Slot<u32>],
    progress: &[AtomicU32],
    shared: &Shared,
) {
    let JoinParams { references, clusters, halves, .. } = *params;
    let part = parts[w.group() as usize];
    let (start, size) = (part.start, part.size & !LEFT);
    let slot = start / PER_CLUSTER;
    w.each(clusters, move |j| {
        let count = tallies[((slot + j) * TALLY_WORDS + COUNT) as usize].get();
        set(shared, SIZES + j, count);
        set(shared, HELD + j, if count > 0 && halves == 0 { j } else { NONE });
        put(shared, j, raised(slot + j, tallies));
        if j == 0 {
            set(shared, PAIRS, 0);
        }
    });
    w.each(clusters, move |j| find_nearest(shared, j, clusters));
    for _ in 1..clusters {
        w.phase(move |lane| {
            if lane == 0 {
                make_pair(shared, clusters);
            }
        });
        w.each(clusters, move |j| {
            let (low, high) = (get(shared, PAIR), get(shared, PAIR + 1));
            let nearest = get(shared, NEAREST + j);
            if low != NONE && (j == low || nearest == low || nearest == high) {
                find_nearest(shared, j, clusters);
            }
        });
    }
    w.phase(move |lane| {
        if lane == 0 {
            let node = node_of(start, size, part.size & LEFT != 0, references);
            if node == ROOT {
                nodes[0].set_up(NO_NODE);
            }
            let pairs = get(shared, PAIRS);
            if pairs == 0 {
                link(node, start, size / 2, size - size / 2, references, nodes);
            } else {
                set(shared, FIRST + MOST_CLUSTERS + pairs - 1, start | part.size & LEFT);
            }
            for k in 0..pairs {
                let pair = pairs - 1 - k;
                let own = MOST_CLUSTERS + pair;
                let (low, high) = (get(shared, LOW + pair), get(shared, HIGH + pair));
                let first = get(shared, FIRST + own);
                let (left, right) = (get(shared, SIZES + low), get(shared, SIZES + high));
                let begin = first & !LEFT;
                link(
                    node_of(begin, left + right, first & LEFT != 0, references),
                    begin,
                    left,
                    right,
                    references,
                    nodes,
                );
                set(shared, FIRST + low, begin | LEFT);
                set(shared, FIRST + high, begin + left);
            }
        }
    });
    let hand_on = move |first: u32, count: u32, aabb: Aabb| {
        let begin = first & !LEFT;
        sizes[begin as usize].set(count | first & LEFT);
        if count >= PER_CLUSTER * clusters {
            let at = progress[0].add(1);
            let next_part = Part { min: aabb.min, start: begin, max: aabb.max, size: count | first & LEFT };
            next[at as usize].set(next_part);
        } else if count > 1 {
            let at = progress[1].add(1);
            small[at as usize].set(begin);
        }
    };
    w.each(clusters, move |j| {
        let is_halved = get(shared, PAIRS) == 0;
        let count = get(shared, SIZES + j);
        if is_halved {
            targets[(slot + j) as usize].set(HALVED);
            if j == 0 {
                let aabb = Aabb { min: part.min, max: part.max };
                hand_on(start | LEFT, size / 2, aabb);
                hand_on(start + size / 2, size - size / 2, aabb);
            }
        } else if count > 0 {
            let first = get(shared, FIRST + j);
            targets[(slot + j) as usize].set(first & !LEFT);
            hand_on(first, count, raised(slot + j, tallies));
        }
        for word in 0..MOVED {
            tallies[((slot + j) * TALLY_WORDS + word) as usize].set(0);
        }
    });
}

#[inline(always)]
fn get(shared: &Shared, at: u32) -> u32 {
    shared[at as usize].load()
}

#[inline(always)]
fn set(shared: &Shared, at: u32, value: u32) {
    shared[at as usize].store(value);
}

#[inline(always)]
fn put(shared: &Shared, slot: u32, aabb: Aabb) {
    for axis in 0..3u32 {
        shared[(BOXES + 6 * slot + axis) as usize].store_f32(aabb.min[axis as usize]);
        shared[(BOXES + 6 * slot + 3 + axis) as usize].store_f32(aabb.max[axis as usize]);
    }
}

#[inline(always)]
fn aabb(shared: &Shared, slot: u32) -> Aabb {
    let word = move |k: u32| shared[(BOXES + 6 * slot + k) as usize].load_f32();
    Aabb { min: [word(0), word(1), word(2)], max: [word(3), word(4), word(5)] }
}

/// Finds the nearest of what is in a slot, if anything is: the smallest (half area of the common box, `i ^ j`).
#[inline(always)]
fn find_nearest(shared: &Shared, j: u32, clusters: u32) {
    let (mut nearest, mut least) = (NONE, u32::MAX);
    if get(shared, HELD + j) != NONE {
        let own = aabb(shared, j);
        for other in 0..clusters {
            if other != j && get(shared, HELD + other) != NONE {
                // Half areas are not negative, save a zero: floats of one sign are in the order of their bits.
                let distance = own.union(aabb(shared, other)).half_area().to_bits() & !(1 << 31);
                if distance < least || (distance == least && j ^ other < j ^ nearest) {
                    least = distance;
                    nearest = other;
                }
            }
        }
    }
    set(shared, NEAREST + j, nearest);
    set(shared, DISTANCES + j, least);
}

/// Makes one of the two nearest, in the lower slot.
#[inline(always)]
fn make_pair(shared: &Shared, clusters: u32) {
    let (mut first, mut least) = (NONE, u32::MAX);
    for j in 0..clusters {
        let distance = get(shared, DISTANCES + j);
        if get(shared, NEAREST + j) != NONE && (first == NONE || distance < least) {
            least = distance;
            first = j;
        }
    }
    set(shared, PAIR, NONE);
    if first != NONE {
        // The first of equal ones: its nearest is in a higher slot.
        let (low, high) = (first, get(shared, NEAREST + first));
        let pairs = get(shared, PAIRS);
        let (left, right) = (get(shared, HELD + low), get(shared, HELD + high));
        set(shared, LOW + pairs, left);
        set(shared, HIGH + pairs, right);
        set(shared, SIZES + MOST_CLUSTERS + pairs, get(shared, SIZES + left) + get(shared, SIZES + right));
        set(shared, PAIRS, pairs + 1);
        set(shared, HELD + low, MOST_CLUSTERS + pairs);
        set(shared, HELD + high, NONE);
        put(shared, low, aabb(shared, low).union(aabb(shared, high)));
        set(shared, NEAREST + high, NONE);
        set(shared, PAIR, low);
        set(shared, PAIR + 1, high);
    }
}

/// Push constants of [`relabel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct RelabelParams {
    /// Invocations: one per place, `n`.
    pub count: u32,
}

/// Invocation `i` writes where the part begins that the reference of place `i` belongs to now. Reads `labels[n]`, `targets` and `sizes[n]`, changes `starts[n]`, which the places are to be
/// sorted by.
#[inline(always)]
pub fn relabel(i: u32, labels: &[u32], targets: &[u32], sizes: &[u32], starts: &[Slot<u32>]) {
    let label = labels[i as usize];
    if label != NONE {
        let start = starts[i as usize].get();
        let target = targets[(start / PER_CLUSTER + label) as usize];
        let half = sizes[start as usize] & !LEFT;
        let next = if target != HALVED {
            target
        } else if i - start < half {
            start
        } else {
            start + half
        };
        starts[i as usize].set(next);
    }
}

//! Which cluster each reference belongs to.

use super::{COUNT, EXTENTS, Frame, LEFT, MOST_CLUSTERS, MOVED, NONE, PER_CLUSTER, Point, TALLY_WORDS, distance};
use crate::aabb::Aabb;
use crate::math::umin;
use crate::mem::{AtomicU32, SharedU32, Slot};
use crate::sum::Sum;
use crate::workgroup::Workgroup;
use bytemuck::{Pod, Zeroable};

/// Places of a workgroup. So many coordinates of a frame add up to less than 2^32.
pub const CHUNK: u32 = 1024;

/// Words of a cluster that a workgroup adds up: six sums and the references.
const SHARED: u32 = 7;
/// Words that the workgroup of [`assign`] shares.
pub const ASSIGN_WORDS: usize = (SHARED * MOST_CLUSTERS) as usize;

/// Push constants of [`assign`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct AssignParams {
    /// Invocations: a workgroup for each [`CHUNK`] places.
    pub count: u32,
    /// Places, `n`.
    pub references: u32,
    /// Clusters of a part.
    pub clusters: u32,
    /// Number of the round, from 0.
    pub round: u32,
    /// Whether points are added up (1), or only counted (0).
    pub adds: u32,
}

/// Workgroup `g` gives the references of places `[1024 g, 1024 (g+1))` the nearest centre, the first of equal ones.
///
/// Reads `starts[n]`, the first place of the part of each place, and of each part `sizes`, `frames`, `centres`. Writes `labels[n]`; adds to the `tallies` of each cluster. A part in which
/// nothing moved in the round before stays as it is.
///
/// Where all places of the group are in one part, as most are where many invocations would meet at few words, they are added up among the group first.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn assign<W: Workgroup>(
    w: &W,
    params: &AssignParams,
    order: &[u32],
    boxes: &[Aabb],
    starts: &[u32],
    sizes: &[u32],
    frames: &[Frame],
    centres: &[Point],
    labels: &[Slot<u32>],
    tallies: &[AtomicU32],
    shared: &[SharedU32; ASSIGN_WORDS],
) {
    let AssignParams { references, clusters, round, adds, .. } = *params;
    let first = w.group() * CHUNK;
    let length = umin(CHUNK, references - first);
    let of_all = starts[first as usize];
    let is_one = starts[(first + length - 1) as usize] == of_all;
    w.each(SHARED * clusters, move |k| shared[k as usize].store(0));
    w.each(length, move |k| {
        let place = (first + k) as usize;
        let start = starts[place];
        let is_large = sizes[start as usize] & !LEFT >= PER_CLUSTER * clusters;
        let slot = start / PER_CLUSTER;
        if !is_large {
            if round == 0 {
                labels[place].set(NONE);
            }
        } else if tallies[(slot * TALLY_WORDS + MOVED) as usize].load() >= round {
            let point = frames[slot as usize].point(boxes[order[place] as usize]);
            let (mut nearest, mut least) = (0, f32::INFINITY);
            for j in 0..clusters {
                let distance = distance(centres[(slot + j) as usize], point);
                if distance < least {
                    least = distance;
                    nearest = j;
                }
            }
            if round == 0 || labels[place].get() != nearest {
                labels[place].set(nearest);
                let moved = &tallies[(slot * TALLY_WORDS + MOVED) as usize];
                if moved.load() != round + 1 {
                    moved.store(round + 1);
                }
            }
            let tally = (slot + nearest) * TALLY_WORDS;
            let own = SHARED * nearest;
            for axis in 0..6u32 {
                let step = point[axis as usize] as u32;
                if adds != 0 {
                    if is_one {
                        shared[(own + axis) as usize].add(step);
                    } else {
                        Sum::from_words([step, 0]).add_to(tallies, (tally + 2 * axis) as usize);
                    }
                }
            }
            if is_one {
                shared[(own + 6) as usize].add(1);
            } else {
                tallies[(tally + COUNT) as usize].add(1);
            }
        }
    });
    w.each(SHARED * clusters, move |k| {
        let value = shared[k as usize].load();
        if is_one && value != 0 {
            let tally = (of_all / PER_CLUSTER + k / SHARED) * TALLY_WORDS;
            if k % SHARED == 6 {
                tallies[(tally + COUNT) as usize].add(value);
            } else {
                Sum::from_words([value, 0]).add_to(tallies, (tally + 2 * (k % SHARED)) as usize);
            }
        }
    });
}

/// Push constants of [`tally`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TallyParams {
    /// Invocations: one per place, `n`.
    pub count: u32,
}

/// A number that grows with a float, and is not 0.
#[inline(always)]
fn rank(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// The float of a [`rank`].
#[inline(always)]
fn of_rank(rank: u32) -> f32 {
    f32::from_bits(if rank >> 31 == 1 { rank & !(1 << 31) } else { !rank })
}

#[inline(always)]
fn raise(word: &AtomicU32, value: u32) {
    // Most are inside already: a read costs less than to own the word.
    if value > word.load() {
        word.max(value);
    }
}

/// Invocation `i` puts the reference of place `i` into the box of its cluster. Reads `order`, `boxes`, `starts[n]`, `labels[n]`, raises `tallies`.
#[inline(always)]
pub fn tally(i: u32, order: &[u32], boxes: &[Aabb], starts: &[u32], labels: &[u32], tallies: &[AtomicU32]) {
    let label = labels[i as usize];
    if label != NONE {
        let aabb = boxes[order[i as usize] as usize];
        let at = ((starts[i as usize] / PER_CLUSTER + label) * TALLY_WORDS + EXTENTS) as usize;
        for axis in 0..3usize {
            raise(&tallies[at + axis], !rank(aabb.min[axis]));
            raise(&tallies[at + 3 + axis], rank(aabb.max[axis]));
        }
    }
}

/// The box that was raised.
#[inline(always)]
pub(super) fn raised(slot: u32, tallies: &[Slot<u32>]) -> Aabb {
    let at = (slot * TALLY_WORDS + EXTENTS) as usize;
    let least = move |k: usize| of_rank(!tallies[at + k].get());
    let most = move |k: usize| of_rank(tallies[at + 3 + k].get());
    Aabb { min: [least(0), least(1), least(2)], max: [most(0), most(1), most(2)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_in_the_order_of_floats() {
        let floats = [-f32::MAX, -3.5, -1.0, -1e-30, -0.0, 0.0, 1e-30, 1.0, 3.5, f32::MAX];
        for pair in floats.windows(2) {
            assert!(rank(pair[0]) < rank(pair[1]) && !rank(pair[0]) > !rank(pair[1]), "{pair:?}");
        }
        for x in floats {
            assert!(of_rank(rank(x)).to_bits() == x.to_bits() && rank(x) != 0 && !rank(x) != 0, "{x}");
        }
    }
}

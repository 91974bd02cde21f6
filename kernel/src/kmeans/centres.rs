//! The first centres of a part.

use super::{Frame, LEFT, MOST_CANDIDATES, MOST_CLUSTERS, MOVED, PER_CLUSTER, Part, Point, TALLY_WORDS};
use super::{distance, drawn, key};
use crate::aabb::Aabb;
use crate::math::min;
use crate::mem::{AtomicU32, Slot};
use bytemuck::{Pod, Zeroable};

// lavapipe leaves a loop after 65,535 rounds in all, without a word.
const _: () = assert!(MOST_CLUSTERS * ((MOST_CLUSTERS - 1) / 2 + 1) * MOST_CANDIDATES + 2048 < 65_535);

/// Push constants of [`centres`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CentresParams {
    /// Invocations: one per large part.
    pub count: u32,
    /// Clusters of a part, `k`.
    pub clusters: u32,
    /// References drawn for each centre after the first, `p`.
    pub candidates: u32,
    /// What the draws are made of.
    pub seed: u32,
}

/// Invocation `i` draws the centres of part `i`: the first at random, each other is of `p` drawn the one that is farthest from all before it, the first of equal ones.
///
/// Reads `parts[i]` and its references. Writes `frames` and the last round of `tallies` by the first slot of the part, and `centres` by slot.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn centres(
    i: u32,
    params: &CentresParams,
    parts: &[Part],
    order: &[u32],
    boxes: &[Aabb],
    frames: &[Slot<Frame>],
    centres: &[Slot<Point>],
    tallies: &[AtomicU32],
) {
    let part = parts[i as usize];
    let size = part.size & !LEFT;
    let frame = Frame::of(part.min, part.max);
    let slot = part.start / PER_CLUSTER;
    frames[slot as usize].set(frame);
    tallies[(slot * TALLY_WORDS + MOVED) as usize].store(0);
    let key = key(params.seed, part.start, size);
    let draw = move |number: u32| {
        let place = part.start + drawn(key, number, size);
        frame.point(boxes[order[place as usize] as usize])
    };
    centres[slot as usize].set(draw(0));
    let mut number = 1;
    for k in 1..params.clusters {
        let (mut farthest, mut most) = (number, -1.0);
        for _ in 0..params.candidates {
            let candidate = draw(number);
            let mut nearest = f32::INFINITY;
            for other in 0..k {
                nearest = min(distance(centres[(slot + other) as usize].get(), candidate), nearest);
            }
            if nearest > most {
                most = nearest;
                farthest = number;
            }
            number += 1;
        }
        centres[(slot + k) as usize].set(draw(farthest));
    }
}

//! PLOC nearest: for every cluster the neighbour in the list with which it has the smallest union.
//!
//! Source: Meister & Bittner 2017, §3.1. Kind: map.

use super::{Cluster, Progress};
use crate::aabb::Aabb;
use crate::math::umin;
use crate::mem::Slot;
use bytemuck::{Pod, Zeroable};

/// Push constants of [`nearest`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct NearestParams {
    /// Invocations: one per cluster, or more.
    pub count: u32,
    /// Places in the list that a cluster looks to the left and to the right, at least 1.
    pub radius: u32,
}

/// Half area of the union as a key that orders like it. What is no number is as far as can be, and no area is negative.
#[inline(always)]
pub(crate) fn distance(left: Aabb, right: Aabb) -> u32 {
    const FARTHEST: u32 = f32::INFINITY.to_bits();
    let area = left.union(right).half_area();
    if area <= f32::MAX { if area > 0.0 { area.to_bits() } else { 0 } } else { FARTHEST }
}

/// Invocation `i` finds the nearest neighbour of cluster `i`: the smallest (distance, `i ^ j`); a cluster that is alone is its own. Reads
/// `clusters[c]` and `progress[1]`, writes `neighbours[c]`: places in the list.
#[inline(always)]
pub fn nearest(i: u32, params: &NearestParams, clusters: &[Cluster], progress: &[Progress], neighbours: &[Slot<u32>]) {
    let count = progress[0].clusters;
    if i >= count {
        return;
    }
    let partner = i ^ 1;
    let mut best = if partner < count { partner } else { i - umin(i, 1) };
    if !progress[0].is_slow() {
        let mut best_distance = u32::MAX;
        let own = clusters[i as usize].aabb;
        let first = i - umin(i, params.radius);
        let last = i + umin(count - 1 - i, params.radius);
        // The left one comes first, so that a union is the same bits seen from either side, whatever the boxes hold.
        for j in first..i {
            let distance = distance(clusters[j as usize].aabb, own);
            if distance < best_distance || (distance == best_distance && i ^ j < i ^ best) {
                best_distance = distance;
                best = j;
            }
        }
        for j in i + 1..last + 1 {
            let distance = distance(own, clusters[j as usize].aabb);
            if distance < best_distance || (distance == best_distance && i ^ j < i ^ best) {
                best_distance = distance;
                best = j;
            }
        }
    }
    neighbours[i as usize].set(best);
}

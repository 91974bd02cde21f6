//! The leaves of a treelet, and what they become as they are joined.

use super::MAX_TREELET;
use super::treelet::Slots;
use crate::aabb::Aabb;

const SLOTS: usize = MAX_TREELET as usize;

/// Clusters of the invocation's own, each in a slot: node, box, and the nearest cluster in a lower slot.
///
/// Arrays of words: rust-gpu is surest with these.
pub(super) struct Clusters {
    /// Slots in use, from 0 on.
    pub(super) count: u32,
    nodes: [u32; SLOTS],
    boxes: [f32; 6 * SLOTS],
    nearest: [u32; SLOTS],
    /// Half area of the union with the nearest.
    distances: [f32; SLOTS],
    /// A bit for each slot that holds a cluster.
    active: u32,
}

/// Two clusters to be joined.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    /// Slot of the first, the lower one.
    pub(super) low: u32,
    /// Slot of the second.
    pub(super) high: u32,
    /// Half area of their union.
    pub(super) area: f32,
}

impl Clusters {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            nodes: [0; SLOTS],
            boxes: [0.0; 6 * SLOTS],
            nearest: [0; SLOTS],
            distances: [0.0; SLOTS],
            active: 0,
        }
    }

    #[inline(always)]
    fn aabb(&self, slot: u32) -> Aabb {
        let k = 6 * slot as usize;
        Aabb {
            min: [self.boxes[k], self.boxes[k + 1], self.boxes[k + 2]],
            max: [self.boxes[k + 3], self.boxes[k + 4], self.boxes[k + 5]],
        }
    }

    /// Whether `slot` holds a cluster.
    #[inline(always)]
    fn is_active(&self, slot: u32) -> bool {
        (self.active >> slot) & 1 == 1
    }

    /// Whether all clusters have become one.
    #[inline(always)]
    pub(super) fn are_joined(&self) -> bool {
        self.active == 1
    }

    /// Finds the nearest cluster below `slot`, which is not 0; the lowest of equals. Slot 0 is always active, and it is the answer where no
    /// area is a number.
    #[inline(always)]
    fn find_nearest(&mut self, slot: u32) {
        let aabb = self.aabb(slot);
        let mut nearest = 0;
        let mut distance = aabb.union(self.aabb(0)).half_area();
        for other in 1..slot {
            if self.is_active(other) {
                let area = aabb.union(self.aabb(other)).half_area();
                if area < distance {
                    distance = area;
                    nearest = other;
                }
            }
        }
        self.nearest[slot as usize] = nearest;
        self.distances[slot as usize] = distance;
    }

    /// Finds the nearest of every cluster.
    #[inline(always)]
    pub(super) fn find_all_nearest(&mut self) {
        for slot in 1..self.count {
            self.find_nearest(slot);
        }
    }

    /// The two clusters with the smallest union; the lowest of equals, by the higher slot first. There are at least two clusters.
    #[inline(always)]
    pub(super) fn nearest_pair(&self) -> Pair {
        let mut high = 0;
        let mut area = 0.0;
        for slot in 1..self.count {
            if self.is_active(slot) && (high == 0 || self.distances[slot as usize] < area) {
                high = slot;
                area = self.distances[slot as usize];
            }
        }
        Pair { low: self.nearest[high as usize], high, area }
    }

    /// Joins a pair into `node`, in the lower slot of the two.
    #[inline(always)]
    pub(super) fn join(&mut self, pair: Pair, node: u32) {
        let Pair { low, high, .. } = pair;
        let aabb = self.aabb(low).union(self.aabb(high));
        self.put(low, node, aabb);
        self.active &= !(1 << high);
        if low > 0 {
            self.find_nearest(low);
        }
        for slot in low + 1..self.count {
            if self.is_active(slot) {
                let nearest = self.nearest[slot as usize];
                if nearest == low || nearest == high {
                    self.find_nearest(slot);
                } else {
                    let area = aabb.union(self.aabb(slot)).half_area();
                    let distance = self.distances[slot as usize];
                    if area < distance || (area == distance && low < nearest) {
                        self.nearest[slot as usize] = low;
                        self.distances[slot as usize] = area;
                    }
                }
            }
        }
    }
}

impl Slots for Clusters {
    #[inline(always)]
    fn put(&mut self, slot: u32, node: u32, aabb: Aabb) {
        self.nodes[slot as usize] = node;
        let k = 6 * slot as usize;
        self.boxes[k] = aabb.min[0];
        self.boxes[k + 1] = aabb.min[1];
        self.boxes[k + 2] = aabb.min[2];
        self.boxes[k + 3] = aabb.max[0];
        self.boxes[k + 4] = aabb.max[1];
        self.boxes[k + 5] = aabb.max[2];
        self.active |= 1 << slot;
    }

    #[inline(always)]
    fn node(&self, slot: u32) -> u32 {
        self.nodes[slot as usize]
    }

    #[inline(always)]
    fn set_count(&mut self, count: u32) {
        self.count = count;
    }
}

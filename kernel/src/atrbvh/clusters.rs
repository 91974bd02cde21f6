//! The leaves of a treelet, and what they become as they are joined.

use super::MAX_TREELET;
use crate::forest::Forest;

const SLOTS: usize = MAX_TREELET as usize;

/// Clusters of the invocation's own, each in a slot, and for each the nearest cluster in a lower slot.
pub(super) struct Clusters {
    /// The leaves of the treelet, and then what they became.
    pub(super) forest: Forest<SLOTS>,
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
        Self { forest: Forest::new(), nearest: [0; SLOTS], distances: [0.0; SLOTS], active: 0 }
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
        let aabb = self.forest.aabb(slot);
        let mut nearest = 0;
        let mut distance = aabb.union(self.forest.aabb(0)).half_area();
        for other in 1..slot {
            if self.is_active(other) {
                let area = aabb.union(self.forest.aabb(other)).half_area();
                if area < distance {
                    distance = area;
                    nearest = other;
                }
            }
        }
        self.nearest[slot as usize] = nearest;
        self.distances[slot as usize] = distance;
    }

    /// Finds the nearest of every cluster. All slots in use hold one, two at least.
    #[inline(always)]
    pub(super) fn find_all_nearest(&mut self) {
        self.active = u32::MAX >> (MAX_TREELET - self.forest.count);
        for slot in 1..self.forest.count {
            self.find_nearest(slot);
        }
    }

    /// The two clusters with the smallest union; the lowest of equals, by the higher slot first. There are at least two clusters.
    #[inline(always)]
    pub(super) fn nearest_pair(&self) -> Pair {
        let mut high = 0;
        let mut area = 0.0;
        for slot in 1..self.forest.count {
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
        let aabb = self.forest.aabb(low).union(self.forest.aabb(high));
        self.forest.put(low, node, aabb);
        self.active &= !(1 << high);
        if low > 0 {
            self.find_nearest(low);
        }
        for slot in low + 1..self.forest.count {
            if self.is_active(slot) {
                let nearest = self.nearest[slot as usize];
                if nearest == low || nearest == high {
                    self.find_nearest(slot);
                } else {
                    let area = aabb.union(self.forest.aabb(slot)).half_area();
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

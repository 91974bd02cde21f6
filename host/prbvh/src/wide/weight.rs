//! What a box weighs in a cost: its area in that of the root.

use crate::bvh::half_area;
use prbvh_kernel::aabb::Aabb;

/// Ratios of areas.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weight {
    root: f64,
}

impl Weight {
    pub(super) fn of(root: &Aabb) -> Self {
        Self { root: half_area(root) }
    }

    /// Whether every ratio counts as 1: no random ray hits a root without area.
    pub(super) fn is_flat(self) -> bool {
        self.root <= 0.0
    }

    pub(super) fn ratio(self, aabb: &Aabb) -> f64 {
        if self.is_flat() { 1.0 } else { half_area(aabb) / self.root }
    }
}

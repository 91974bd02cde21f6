//! Axis-aligned boxes.

use crate::math::{max, min, select};
use bytemuck::{Pod, Zeroable};

/// An axis-aligned box: corners in scene units, 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: [f32; 3],
    /// Largest coordinates.
    pub max: [f32; 3],
}

impl Aabb {
    /// The neutral element of [`Aabb::union`]. Its area has no meaning.
    pub const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The smallest box around both.
    #[inline(always)]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: [min(self.min[0], other.min[0]), min(self.min[1], other.min[1]), min(self.min[2], other.min[2])],
            max: [max(self.max[0], other.max[0]), max(self.max[1], other.max[1]), max(self.max[2], other.max[2])],
        }
    }

    /// `a` if `condition`, else `b`, by coordinates.
    #[inline(always)]
    #[must_use]
    pub fn select(condition: bool, a: Self, b: Self) -> Self {
        Self {
            min: [
                select(condition, a.min[0], b.min[0]),
                select(condition, a.min[1], b.min[1]),
                select(condition, a.min[2], b.min[2]),
            ],
            max: [
                select(condition, a.max[0], b.max[0]),
                select(condition, a.max[1], b.max[1]),
                select(condition, a.max[2], b.max[2]),
            ],
        }
    }

    /// Whether `other` lies inside; not if a coordinate is NaN.
    #[inline(always)]
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.min[0] <= other.min[0]
            && self.min[1] <= other.min[1]
            && self.min[2] <= other.min[2]
            && self.max[0] >= other.max[0]
            && self.max[1] >= other.max[1]
            && self.max[2] >= other.max[2]
    }

    /// Half the surface area, scene units².
    ///
    /// Written as `dy(dx + dz) + dz·dx`, which no optimiser can factor further. Every step is monotone in the extents,
    /// also after rounding: a box inside another never has the larger computed area. [`crate::prbvh`] relies on it.
    #[inline(always)]
    pub fn half_area(self) -> f32 {
        let dx = self.max[0] - self.min[0];
        let dy = self.max[1] - self.min[1];
        let dz = self.max[2] - self.min[2];
        dy * (dx + dz) + dz * dx
    }
}

//! Presplitting: a triangle whose box is mostly empty becomes several references before a tree is built, each a box around a piece of it.
//!
//! Sources: Karras & Aila 2013, §4.3 (priorities, a number of splits in proportion to them, planes of the scene's own grid); Ernst & Greiner 2007 (splits before
//! the build). Every number of splits is a whole one, so that sums have one value in every order, and every piece has its place before it is made.
//!
//! | kernel | invocation | |
//! |---|---|---|
//! | `presplit_priorities` | a triangle | how much a split of it promises |
//! | `presplit_sums` | a workgroup per chunk | splits of the chunk for each of 16 scales |
//! | `presplit_places` | a workgroup per chunk | splits of each triangle, and the place of its first piece |
//! | `presplit_pieces` | a triangle | the pieces |
//!
//! The host looks for the largest scale whose splits are within the budget: 17 intervals of the scale's bits become one by each `presplit_sums`. The next
//! larger scale would be beyond the budget; what is left of it goes to those that it would give more, the first ones first. So the budget is met exactly.
//!
//! # Coordinates
//! Triangles are in the safe range. Priorities are in units of the scene: a power of two brings its largest extent to between 1 and 2, and edges become multiples of
//! 2^-40 of that, so that no product is denormal.

pub mod clip;
pub mod pieces;
pub mod places;
pub mod priority;

use crate::aabb::Aabb;
use bytemuck::{Pod, Zeroable};

/// Cells of the scene's grid along each axis.
pub const CELLS: u32 = 1 << CELL_BITS;
/// Levels of the grid.
pub const CELL_BITS: u32 = 20;

/// Most splits of a triangle: one invocation makes them one after another.
pub const MOST_SPLITS: u32 = 4095;

/// Triangles of a chunk, whose splits are counted together.
pub const CHUNK: u32 = 2048;

/// Scales that `presplit_sums` tries at once.
pub const SCALES: u32 = 16;

/// The scene's own planes, and the unit of priorities.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Grid {
    /// Smallest coordinates of the scene box.
    pub origin: [f32; 3],
    /// Cells per scene unit in each axis; 0 in an axis in which the scene is flat.
    pub cells_per_unit: [f32; 3],
    /// Extent of a cell in each axis, scene units.
    pub cell: [f32; 3],
    /// Brings the largest extent of the scene to between 1 and 2: a power of two.
    pub unit: f32,
}

/// A plane across a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The axis that it is across.
    pub axis: u32,
    /// Where it is.
    pub at: f32,
    /// Halvings of the grid that lead to it, 0 for the plane in the middle of the scene; [`CELL_BITS`] for one that is no plane of the grid.
    pub level: u32,
    /// Whether it parts the box.
    pub parts: bool,
}

impl Grid {
    /// Number of the cell, in `0..CELLS`.
    #[inline(always)]
    fn cell_of(&self, x: f32, k: usize) -> u32 {
        let position = (x - self.origin[k]) * self.cells_per_unit[k];
        // Not below 0. Clamped as a float, whose conversion would saturate differently.
        let last = (CELLS - 1) as f32;
        (if position < last { position } else { last }) as u32
    }

    /// The coarsest plane of the grid that parts the box, of equally coarse ones the one across the longest axis; where there is none, the middle of the longest
    /// axis that has one.
    #[inline(always)]
    #[must_use]
    pub fn plane(&self, aabb: &Aabb) -> Plane {
        self.better(self.better(self.across(aabb, 0), self.across(aabb, 1), aabb), self.across(aabb, 2), aabb)
    }

    #[inline(always)]
    fn better(&self, one: Plane, other: Plane, aabb: &Aabb) -> Plane {
        let (k, l) = (one.axis as usize, other.axis as usize);
        let is_longer = aabb.max[l] - aabb.min[l] > aabb.max[k] - aabb.min[k];
        let is_better = !one.parts || other.level < one.level || (other.level == one.level && is_longer);
        if other.parts && is_better { other } else { one }
    }

    /// The coarsest plane across an axis, or the middle.
    #[inline(always)]
    fn across(&self, aabb: &Aabb, axis: u32) -> Plane {
        let k = axis as usize;
        let (min, max) = (aabb.min[k], aabb.max[k]);
        let (first, last) = (self.cell_of(min, k), self.cell_of(max, k));
        let differing = first ^ last;
        if differing != 0 {
            let bit = 31 - differing.leading_zeros();
            let at = self.origin[k] + ((last >> bit) << bit) as f32 * self.cell[k];
            if at > min && at < max {
                return Plane { axis, at, level: CELL_BITS - 1 - bit, parts: true };
            }
        }
        let at = 0.5 * min + 0.5 * max;
        Plane { axis, at, level: CELL_BITS, parts: at > min && at < max }
    }
}

//! The planes that all triangles of a scene are cut at.

use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::presplit::{CELLS, Grid};

/// The grid of a scene in the safe range.
pub(super) fn grid_of(scene: &Aabb) -> Grid {
    let extent = [0, 1, 2].map(|k| f64::from(scene.max[k]) - f64::from(scene.min[k]));
    let cells = f64::from(CELLS);
    let largest = extent.iter().fold(0.0f64, |m, &x| m.max(x));
    // In the safe range it is 0 or at least 2^-62.
    let exponent = if largest > 0.0 { ((largest.to_bits() >> 52) & 0x7ff) as i32 - 1023 } else { 0 };
    Grid {
        origin: scene.min,
        cells_per_unit: extent.map(|extent| if extent > 0.0 { (cells / extent) as f32 } else { 0.0 }),
        cell: extent.map(|extent| (extent / cells) as f32),
        unit: f32::from_bits(((127 - exponent) as u32) << 23),
    }
}

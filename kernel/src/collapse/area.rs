//! Areas in one unit, the same on all devices.

use crate::node::Node;

/// Smallest relative area that counts: 2^-100. Products stay normal numbers, which no device flushes.
const LEAST_AREA: f32 = f32::from_bits(27 << 23);

/// The power of two that brings `area`, a normal number, into `[1, 2)`; 0 for no area.
#[inline(always)]
#[must_use]
pub fn area_scale(area: f32) -> f32 {
    if area > 0.0 { f32::from_bits((254 - (area.to_bits() >> 23)) << 23) } else { 0.0 }
}

/// Area of a node in units of the root's, brought to `[1, 2)` by [`area_scale`]. Where the root has none, every ratio counts as 1, as in the measured cost.
#[inline(always)]
#[must_use]
pub fn relative_area(node: &Node, scale: f32) -> f32 {
    let area = node.aabb().half_area() * scale;
    if scale == 0.0 {
        1.0
    } else if area < LEAST_AREA {
        0.0
    } else {
        area
    }
}

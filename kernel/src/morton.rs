//! Morton codes of box centres.
//!
//! Source: Karras 2012, §4 (codes); 60 bits as in the authors' framework. Kind: map.
//! A coordinate has 20 bits. The two words of a code hold the Morton codes of the upper and of the lower ten bits of each
//! coordinate, so that (`high`, `low`) orders as the 60-bit code does and no 64-bit integer is needed.

use crate::aabb::Aabb;
use crate::math::{max, min};
use crate::mem::Slot;
use bytemuck::{Pod, Zeroable};

/// Bits in a word of a code: ten of each coordinate.
pub const WORD_BITS: u32 = 30;

/// Push constants of [`code_30`] and [`code_60`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct MortonParams {
    /// Invocations: one per reference.
    pub count: u32,
    /// Smallest coordinates of the scene box.
    pub origin: [f32; 3],
    /// Cells per scene unit in each axis; 0 in an axis in which the scene is flat.
    pub cells_per_unit: [f32; 3],
}

/// Spreads the low ten bits three apart.
#[inline(always)]
#[must_use]
pub fn spread(v: u32) -> u32 {
    let v = (v | (v << 16)) & 0x0300_00ff;
    let v = (v | (v << 8)) & 0x0300_f00f;
    let v = (v | (v << 4)) & 0x030c_30c3;
    (v | (v << 2)) & 0x0924_9249
}

/// Interleaves the low ten bits of each coordinate; x is lowest.
#[inline(always)]
#[must_use]
pub fn interleave(x: u32, y: u32, z: u32) -> u32 {
    spread(x) | (spread(y) << 1) | (spread(z) << 2)
}

/// Cell of the box's centre along axis `k`, in `0..cells`.
#[inline(always)]
fn cell(params: &MortonParams, aabb: Aabb, k: usize, cells: u32) -> u32 {
    let centre = 0.5 * (aabb.min[k] + aabb.max[k]);
    let position = (centre - params.origin[k]) * params.cells_per_unit[k];
    // Truncation is floor here: the position is not negative. Clamped as a float, whose conversion would saturate differently.
    min(max(position, 0.0), (cells - 1) as f32) as u32
}

/// Invocation `i`: 30-bit code of reference `i`. Reads `boxes[n]`, writes `codes[n]` and `order[n]` (the identity).
#[inline(always)]
pub fn code_30(i: u32, params: &MortonParams, boxes: &[Aabb], codes: &[Slot<u32>], order: &[Slot<u32>]) {
    let aabb = boxes[i as usize];
    let [x, y, z] = [cell(params, aabb, 0, 1 << 10), cell(params, aabb, 1, 1 << 10), cell(params, aabb, 2, 1 << 10)];
    codes[i as usize].set(interleave(x, y, z));
    order[i as usize].set(i);
}

/// Invocation `i`: 60-bit code of reference `i`. Reads `boxes[n]`, writes `high[n]`, `low[n]` and `order[n]` (the identity).
#[inline(always)]
pub fn code_60(
    i: u32,
    params: &MortonParams,
    boxes: &[Aabb],
    high: &[Slot<u32>],
    low: &[Slot<u32>],
    order: &[Slot<u32>],
) {
    let aabb = boxes[i as usize];
    let [x, y, z] = [cell(params, aabb, 0, 1 << 20), cell(params, aabb, 1, 1 << 20), cell(params, aabb, 2, 1 << 20)];
    high[i as usize].set(interleave(x >> 10, y >> 10, z >> 10));
    low[i as usize].set(interleave(x & 1023, y & 1023, z & 1023));
    order[i as usize].set(i);
}

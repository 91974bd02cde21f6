//! Boxes of triangles and of the scene.
//!
//! Source: common to all methods compared in Meister & Bittner 2018, §5. Kind: map.

use crate::aabb::Aabb;
use crate::math::{max, min, umin};
use crate::mem::Slot;
use bytemuck::{Pod, Zeroable};

/// Boxes that one invocation of `setup_bounds` unites.
pub const BOUNDS_CHUNK: u32 = 256;

/// Three corners, 36 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Triangle {
    /// First corner.
    pub a: [f32; 3],
    /// Second corner.
    pub b: [f32; 3],
    /// Third corner.
    pub c: [f32; 3],
}

impl Triangle {
    /// Smallest box around the three corners.
    #[inline(always)]
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        let lower = |k: usize| min(min(self.a[k], self.b[k]), self.c[k]);
        let upper = |k: usize| max(max(self.a[k], self.b[k]), self.c[k]);
        Aabb { min: [lower(0), lower(1), lower(2)], max: [upper(0), upper(1), upper(2)] }
    }
}

/// Push constants of [`boxes`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct BoxesParams {
    /// Invocations: one per triangle.
    pub count: u32,
}

/// Invocation `i` computes the box of triangle `i`. Reads `triangles[n]`, writes `boxes[n]`.
#[inline(always)]
pub fn boxes(i: u32, triangles: &[Triangle], boxes: &[Slot<Aabb>]) {
    boxes[i as usize].set(triangles[i as usize].aabb());
}

/// Push constants of [`bounds`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct BoundsParams {
    /// Invocations: one per [`BOUNDS_CHUNK`] boxes.
    pub count: u32,
    /// Boxes to unite.
    pub boxes: u32,
}

/// Invocation `i` unites boxes `[256 i, 256 (i+1))` of `boxes[params.boxes]` into `united[i]`. Run again on its own result until
/// one box is left.
#[inline(always)]
pub fn bounds(i: u32, params: &BoundsParams, boxes: &[Aabb], united: &[Slot<Aabb>]) {
    let first = i * BOUNDS_CHUNK;
    let end = umin(first + BOUNDS_CHUNK, params.boxes);
    let mut sum = boxes[first as usize];
    for k in first + 1..end {
        sum = sum.union(boxes[k as usize]);
    }
    united[i as usize].set(sum);
}

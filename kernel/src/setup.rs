//! Boxes of triangles and of the scene.
//!
//! Source: common to all methods compared in Meister & Bittner 2018, §5. Kind: map, and workgroups for the scene: a union of
//! fixed shape, since of 0 and -0 either may be the smaller.

use crate::aabb::Aabb;
use crate::math::{max, min, umin};
use crate::mem::{SharedU32, Slot};
use crate::workgroup::Workgroup;
use bytemuck::{Pod, Zeroable};

/// Boxes that one invocation of `setup_bounds` unites.
const RUN: u32 = 32;
/// Such runs of a workgroup.
const RUNS: u32 = 64;
/// Boxes that one workgroup of `setup_bounds` unites.
pub const BOUNDS_CHUNK: u32 = RUN * RUNS;

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

#[cfg(not(target_arch = "spirv"))]
impl From<[[f32; 3]; 3]> for Triangle {
    fn from([a, b, c]: [[f32; 3]; 3]) -> Self {
        Self { a, b, c }
    }
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
    /// Invocations: a workgroup for each [`BOUNDS_CHUNK`] boxes.
    pub count: u32,
    /// Boxes to unite.
    pub boxes: u32,
}

/// Words that the workgroup of [`bounds`] shares.
pub const BOUNDS_WORDS: usize = (RUNS + RUNS / 8) as usize * 6;

/// Workgroup `g` unites boxes `[2048 g, 2048 (g+1))` of `boxes[params.boxes]` into `united[g]`. Run again on its own result until
/// one box is left.
#[inline(always)]
pub fn bounds<W: Workgroup>(
    w: &W,
    params: &BoundsParams,
    boxes: &[Aabb],
    united: &[Slot<Aabb>],
    shared: &[SharedU32; BOUNDS_WORDS],
) {
    let (group, end) = (w.group(), params.boxes);
    w.each(RUNS, move |run| {
        let first = group * BOUNDS_CHUNK + run * RUN;
        let mut sum = Aabb::EMPTY;
        for k in first..umin(first + RUN, end) {
            sum = sum.union(boxes[k as usize]);
        }
        store(shared, run, sum);
    });
    w.each(RUNS / 8, move |eight| store(shared, RUNS + eight, union_of_8(shared, 8 * eight)));
    w.phase(move |lane| {
        if lane == 0 {
            united[group as usize].set(union_of_8(shared, RUNS));
        }
    });
}

#[inline(always)]
fn union_of_8(shared: &[SharedU32; BOUNDS_WORDS], at: u32) -> Aabb {
    let mut sum = load(shared, at);
    for k in 1..8 {
        sum = sum.union(load(shared, at + k));
    }
    sum
}

#[inline(always)]
fn store(shared: &[SharedU32; BOUNDS_WORDS], place: u32, aabb: Aabb) {
    for k in 0..3 {
        shared[(6 * place + k) as usize].store_f32(aabb.min[k as usize]);
        shared[(6 * place + 3 + k) as usize].store_f32(aabb.max[k as usize]);
    }
}

#[inline(always)]
fn load(shared: &[SharedU32; BOUNDS_WORDS], place: u32) -> Aabb {
    let get = move |k: u32| shared[(6 * place + k) as usize].load_f32();
    Aabb { min: [get(0), get(1), get(2)], max: [get(3), get(4), get(5)] }
}

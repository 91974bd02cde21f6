//! How often each triangle is split, and where its pieces go.
//!
//! Source: Karras & Aila 2013, §4.3: a part of the budget in proportion to the priority, rounded down; the scale by bisection. Kind: workgroups.

use super::{CHUNK, MOST_SPLITS, SCALES};
use crate::math::umin;
use crate::mem::{SharedU32, Slot};
use crate::workgroup::{SCAN_WORDS, Workgroup, scan};
use bytemuck::{Pod, Zeroable};

/// Parts of a chunk that are added up side by side.
const PARTS: u32 = 4;

/// Splits of a triangle.
#[inline(always)]
#[must_use]
pub fn splits(priority: f32, scale: f32) -> u32 {
    let share = priority * scale;
    // What a conversion makes of a number that does not fit is left to the driver.
    if share < MOST_SPLITS as f32 { share as u32 } else { MOST_SPLITS }
}

/// Push constants of [`sums`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SumsParams {
    /// Invocations: a workgroup for each [`CHUNK`] triangles.
    pub count: u32,
    /// Triangles.
    pub triangles: u32,
}

/// Words that the workgroup of [`sums`] shares.
pub const SUMS_WORDS: usize = (SCALES * PARTS) as usize;

/// Workgroup `c` adds up the splits of chunk `c` for each of the scales. Reads `priorities[n]` and `scales[16]`, writes `sums[16 · chunks]`.
#[inline(always)]
pub fn sums<W: Workgroup>(
    w: &W,
    params: &SumsParams,
    priorities: &[f32],
    scales: &[f32],
    sums: &[Slot<u32>],
    shared: &[SharedU32; SUMS_WORDS],
) {
    let chunk = w.group();
    let triangles = params.triangles;
    w.each(SCALES * PARTS, move |item| {
        let (k, part) = (item % SCALES, item / SCALES);
        let scale = scales[k as usize];
        let first = chunk * CHUNK + part * (CHUNK / PARTS);
        let mut sum = 0u32;
        for i in umin(first, triangles)..umin(first + CHUNK / PARTS, triangles) {
            sum += splits(priorities[i as usize], scale);
        }
        shared[item as usize].store(sum);
    });
    w.each(SCALES, move |k| {
        let mut sum = 0u32;
        for part in 0..PARTS {
            sum += shared[(part * SCALES + k) as usize].load();
        }
        sums[(chunk * SCALES + k) as usize].set(sum);
    });
}

/// What a chunk has of the budget beyond its splits by the scale, and where its first piece goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ChunkShare {
    /// Further splits, at most as many as the next larger scale has.
    pub more: u32,
    /// Place of the first piece.
    pub place: u32,
}

/// Push constants of [`places`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PlacesParams {
    /// Invocations: a workgroup for each [`CHUNK`] triangles.
    pub count: u32,
    /// Triangles.
    pub triangles: u32,
    /// The scale.
    pub scale: f32,
    /// The next larger one.
    pub next_scale: f32,
}

/// Words that the workgroup of [`places`] shares.
pub const PLACES_WORDS: usize = SCAN_WORDS as usize;

/// Workgroup `c` gives each triangle of chunk `c` its splits and the place of its first piece. Reads `priorities[n]` and `shares[chunks]`, writes `splits_of[n]` and
/// `places_of[n]`.
#[inline(always)]
pub fn places<W: Workgroup>(
    w: &W,
    params: &PlacesParams,
    priorities: &[f32],
    shares: &[ChunkShare],
    splits_of: &[Slot<u32>],
    places_of: &[Slot<u32>],
    shared: &[SharedU32; PLACES_WORDS],
) {
    let chunk = w.group();
    let first = chunk * CHUNK;
    let length = umin(CHUNK, params.triangles - first);
    let share = shares[chunk as usize];
    let (scale, next) = (params.scale, params.next_scale);
    let more = move |k: u32| {
        let priority = priorities[(first + k) as usize];
        splits(priority, next) - splits(priority, scale)
    };
    scan(w, shared, 0, length, more, move |k, before| {
        let wanted = more(k);
        let left = share.more - umin(before, share.more);
        let taken = umin(wanted, left);
        splits_of[(first + k) as usize].set(splits(priorities[(first + k) as usize], scale) + taken);
        wanted
    });
    // A lane has the same run of triangles in both scans: what it stored is its own.
    scan(
        w,
        shared,
        0,
        length,
        move |k| splits_of[(first + k) as usize].get() + 1,
        move |k, before| {
            places_of[(first + k) as usize].set(share.place + before);
            splits_of[(first + k) as usize].get() + 1
        },
    );
}

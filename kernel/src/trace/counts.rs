//! How many rays were traced and what they cost.
//!
//! Kind: map over fixed chunks; the host adds up the chunks.

use crate::math::umin;
use crate::mem::Slot;
use crate::ray::{Hit, NO_TRIANGLE, Ray, UNFINISHED};
use bytemuck::{Pod, Zeroable};

/// Rays that one invocation counts.
pub const COUNT_CHUNK: u32 = 256;

/// Sums over a chunk of rays, 20 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct RayCounts {
    /// Rays that were traced.
    pub rays: u32,
    /// Those that hit something.
    pub hits: u32,
    /// Tests against boxes.
    pub box_tests: u32,
    /// Tests against triangles.
    pub triangle_tests: u32,
    /// Rays that need more steps than one dispatch has.
    pub unfinished: u32,
}

/// Push constants of [`count_rays`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CountParams {
    /// Invocations: one per [`COUNT_CHUNK`] rays.
    pub count: u32,
    /// Rays.
    pub rays: u32,
}

/// Invocation `i` adds what rays `[256 i, 256 (i+1))` cost to `counts[i]`.
#[inline(always)]
pub fn count_rays(i: u32, params: &CountParams, rays: &[Ray], hits: &[Hit], counts: &[Slot<RayCounts>]) {
    let first = i * COUNT_CHUNK;
    let end = umin(first + COUNT_CHUNK, params.rays);
    let mut sum = counts[i as usize].get();
    for k in first..end {
        if rays[k as usize].is_active() {
            let hit = hits[k as usize];
            sum.rays += 1;
            if hit.triangle == UNFINISHED {
                sum.unfinished += 1;
            } else if hit.triangle != NO_TRIANGLE {
                sum.hits += 1;
            }
            sum.box_tests = sum.box_tests.wrapping_add(hit.box_tests);
            sum.triangle_tests = sum.triangle_tests.wrapping_add(hit.triangle_tests);
        }
    }
    counts[i as usize].set(sum);
}

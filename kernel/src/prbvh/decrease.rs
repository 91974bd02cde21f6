//! Sums of area decreases: what the reinsertions of an iteration promise together.
//!
//! Kind: map over fixed chunks: the host adds the partial sums in f64.

use super::Reinsertion;
use crate::math::umin;
use crate::mem::Slot;
use bytemuck::{Pod, Zeroable};

/// Reinsertions whose decreases one invocation adds up.
pub const DECREASE_CHUNK: u32 = 256;

/// Push constants of [`decrease`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct DecreaseParams {
    /// Invocations: one per [`DECREASE_CHUNK`] elements of `found`.
    pub count: u32,
    /// Elements of `found`.
    pub found: u32,
    /// Where in `partial` the sums begin.
    pub first: u32,
}

/// Invocation `i` adds up the area decreases of 256 elements of `found`, in which those that do not move are 0, into `partial[first + i]`.
/// Each addition hands its rounding on to the next (Kahan 1965), so that the sum is as good as its terms.
#[inline(always)]
pub fn decrease(i: u32, params: &DecreaseParams, found: &[Reinsertion], partial: &[Slot<f32>]) {
    let first = i * DECREASE_CHUNK;
    let mut sum = 0.0f32;
    let mut excess = 0.0f32;
    for k in first..umin(first + DECREASE_CHUNK, params.found) {
        let term = found[k as usize].area_decrease - excess;
        let next = sum + term;
        excess = (next - sum) - term;
        sum = next;
    }
    partial[(params.first + i) as usize].set(sum);
}

//! Random numbers without state: a hash of what they are for.
//!
//! Source: Jarzynski & Olano 2020 (PCG hash); no number depends on the order in which invocations run.

use crate::math::{add_scaled, dot, reciprocal_sqrt};

/// A hash of one word.
#[inline(always)]
#[must_use]
pub fn hash(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A key for the numbers of one path vertex.
#[inline(always)]
#[must_use]
pub fn key(pixel: u32, sample: u32, bounce: u32) -> u32 {
    hash(hash(hash(pixel).wrapping_add(sample)).wrapping_add(bounce))
}

/// Number `dimension` of a key, in [0, 1).
#[inline(always)]
#[must_use]
pub fn uniform(key: u32, dimension: u32) -> f32 {
    (hash(key.wrapping_add(dimension.wrapping_mul(0x9e37_79b9))) >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
}

/// A direction around the unit vector `normal` with density cos/π, from dimensions `first` to `first + 23`.
///
/// The normal plus a point of the unit sphere; the point by rejection from a cube, so that no sine is needed. After eight rejections
/// (once in 26,000 times) it is the normal.
#[inline(always)]
#[must_use]
pub fn cosine_direction(normal: [f32; 3], key: u32, first: u32) -> [f32; 3] {
    let mut on_sphere = normal;
    for attempt in 0..8u32 {
        let d = first + 3 * attempt;
        let v = [2.0 * uniform(key, d) - 1.0, 2.0 * uniform(key, d + 1) - 1.0, 2.0 * uniform(key, d + 2) - 1.0];
        let square = dot(v, v);
        if square > 1e-4 && square <= 1.0 {
            let s = reciprocal_sqrt(square);
            on_sphere = [v[0] * s, v[1] * s, v[2] * s];
            break;
        }
    }
    let sum = add_scaled(normal, 1.0, on_sphere);
    let square = dot(sum, sum);
    if square > 1e-6 {
        let s = reciprocal_sqrt(square);
        [sum[0] * s, sum[1] * s, sum[2] * s]
    } else {
        normal
    }
}

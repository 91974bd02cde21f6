//! Minimum, maximum and the error bound of a sum, in one fixed form for both compilations.

/// Smaller of two; the second if either is NaN.
#[inline(always)]
pub fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Larger of two; the second if either is NaN.
#[inline(always)]
pub fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Smaller of two integers (`u32::min` may pull 8-bit integers into SPIR-V).
#[inline(always)]
pub fn umin(a: u32, b: u32) -> u32 {
    if a < b { a } else { b }
}

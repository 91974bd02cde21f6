//! Small functions in one fixed form for both compilations, made of operations that have one result on every device.

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

/// Larger of two integers; see [`umin`].
#[inline(always)]
pub fn umax(a: u32, b: u32) -> u32 {
    if a > b { a } else { b }
}

/// `a` if `condition`, else `b`: without a branch where that is cheaper.
#[inline(always)]
pub fn select<T: Copy>(condition: bool, a: T, b: T) -> T {
    if condition { a } else { b }
}

/// `1 / x` by Newton's method from a guess, for `2^-120 < |x| < 2^120`: the error is below 3 units in the last place.
///
/// Vulkan leaves the last digits of a division and of a square root to the driver; products and sums have one result.
#[inline(always)]
#[must_use]
pub fn reciprocal(x: f32) -> f32 {
    let sign = x.to_bits() & 0x8000_0000;
    let magnitude = f32::from_bits(x.to_bits() & 0x7fff_ffff);
    let mut y = f32::from_bits(0x7ef3_11c7u32.wrapping_sub(magnitude.to_bits()));
    y *= 2.0 - magnitude * y;
    y *= 2.0 - magnitude * y;
    y *= 2.0 - magnitude * y;
    y *= 2.0 - magnitude * y;
    f32::from_bits(y.to_bits() | sign)
}

/// `1 / √x` by Newton's method from a guess, for `2^-100 < x < 2^100`, to a few units in the last place. See [`reciprocal`].
#[inline(always)]
#[must_use]
pub fn reciprocal_sqrt(x: f32) -> f32 {
    let half = 0.5 * x;
    let mut y = f32::from_bits(0x5f37_59dfu32.wrapping_sub(x.to_bits() >> 1));
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y
}

/// Scalar product.
#[inline(always)]
#[must_use]
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + s · b`.
#[inline(always)]
#[must_use]
pub fn add_scaled(a: [f32; 3], s: f32, b: [f32; 3]) -> [f32; 3] {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

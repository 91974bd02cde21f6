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

/// `x` without its sign.
#[inline(always)]
#[must_use]
pub fn magnitude(x: f32) -> f32 {
    if x < 0.0 { -x } else { x }
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

/// What rounding took from a product: `a · b - p` without error, where `p` is the rounded `a · b`. Holds as long as `p` does not overflow and the last
/// places of `a` and `b` multiply to 2^-126 or more.
///
/// Source: Dekker 1971. The halves are cut by their bits, 12 and 12: no compiler can simplify that, and no fused operation is needed.
#[inline(always)]
#[must_use]
pub fn product_error(a: f32, b: f32, p: f32) -> f32 {
    let (a_high, b_high) = (f32::from_bits(a.to_bits() & 0xffff_f000), f32::from_bits(b.to_bits() & 0xffff_f000));
    let (a_low, b_low) = (a - a_high, b - b_high);
    (((a_high * b_high - p) + a_high * b_low) + a_low * b_high) + a_low * b_low
}

/// `a · b - c · d` to 3 units in the last place, also where the products cancel, with the sign of the exact value. See [`product_error`] for the range.
///
/// Source: Kahan's formula (Jeannerod, Louvet & Muller 2013) without fused operations. Swapping the products changes the sign and nothing else.
#[inline(always)]
#[must_use]
pub fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let (p, q) = (a * b, c * d);
    (p - q) + (product_error(a, b, p) - product_error(c, d, q))
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

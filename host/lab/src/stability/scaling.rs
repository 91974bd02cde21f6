//! Scenes that must have the same tree: times a power of two, and with the axes in other places.

use prbvh_kernel::setup::Triangle;

/// The largest and the smallest power of two, 0 aside, that every coordinate can be multiplied by without a rounding; none for a
/// scene of zeros or one that fills float32.
pub(super) fn exact_exponents(triangles: &[Triangle]) -> Vec<i32> {
    let coordinates: &[f32] = bytemuck::cast_slice(triangles);
    let ends = coordinates.iter().filter(|x| **x != 0.0).map(|&x| {
        // Every float32 but 0 is a normal float64.
        let bits = f64::from(x).to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i32 - 1023;
        let mantissa = bits & ((1 << 52) - 1) | 1 << 52;
        (exponent, exponent - 52 + mantissa.trailing_zeros() as i32)
    });
    let Some((highest, lowest)) = ends.reduce(|a, b| (a.0.max(b.0), a.1.min(b.1))) else { return Vec::new() };
    // The bits of float32 stand for 2^127 down to 2^-149.
    let mut exponents = vec![127 - highest, -149 - lowest];
    exponents.retain(|&exponent| exponent != 0);
    exponents
}

/// The triangles times 2^`exponent`.
pub(super) fn scaled(triangles: &[Triangle], exponent: i32) -> Vec<Triangle> {
    // 2^±276 at most: a normal float64.
    let by = f64::from_bits(((exponent + 1023) as u64) << 52);
    let scale = |point: [f32; 3]| point.map(|x| (f64::from(x) * by) as f32);
    triangles.iter().map(|t| Triangle { a: scale(t.a), b: scale(t.b), c: scale(t.c) }).collect()
}

/// A turn of the axes, and a mirror.
pub(super) const AXES: [[usize; 3]; 2] = [[1, 2, 0], [0, 2, 1]];

/// The triangles with axis `axes[k]` in place `k`.
pub(super) fn turned(triangles: &[Triangle], axes: [usize; 3]) -> Vec<Triangle> {
    let turn = |point: [f32; 3]| axes.map(|axis| point[axis]);
    triangles.iter().map(|t| Triangle { a: turn(t.a), b: turn(t.b), c: turn(t.c) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(coordinates: [f32; 9]) -> Vec<Triangle> {
        bytemuck::cast_slice(&coordinates).to_vec()
    }

    #[test]
    fn the_ends_are_exact_and_one_further_is_not() {
        for x in [1.0f32, 0.1, 3e38, 1e-45, 1e-30, 12345.678] {
            let triangles = of([x, -x, 0.0, x / 3.0, 0.0, 0.0, x, x, x]);
            let exact = |exponent: i32| scaled(&scaled(&triangles, exponent), -exponent) == triangles;
            for exponent in exact_exponents(&triangles) {
                let further = exponent + exponent.signum();
                assert!(exact(exponent) && !exact(further), "{x:e}, 2^{exponent}");
            }
        }
        assert_eq!(exact_exponents(&of([1.0; 9])), [127, -149]);
        assert!(exact_exponents(&of([0.0; 9])).is_empty());
        let all = of([f32::MAX, f32::from_bits(1), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(exact_exponents(&all).is_empty());
    }

    #[test]
    fn axes_change_places() {
        let triangles = of([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        assert_eq!(turned(&triangles, AXES[0])[0].a, [2.0, 3.0, 1.0]);
        assert_eq!(turned(&triangles, AXES[1])[0].c, [7.0, 9.0, 8.0]);
    }
}

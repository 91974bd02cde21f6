//! Faces of boxes as whole steps from an origin, never inside of what they are around.
//!
//! Source: Ylitie, Karras & Laine 2017, §3.2. A step is a power of two, so that a product with it is exact; the sum with the origin is compared without
//! rounding. A face in f32, rounded, is on the right side, too: rounding keeps the order, and what it is compared with is an f32.

/// Most steps.
const STEPS: f64 = 255.0;

/// An axis of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Where the node starts, scene units.
    pub(super) origin: f32,
    /// A step is `2^(exponent - 127)`; from 1 to 254.
    pub(super) exponent: u8,
}

impl Axis {
    /// The smallest step with which [`Axis::above`] reaches from `min` to `max`.
    pub(super) fn of(min: f32, max: f32) -> Self {
        let origin = min + 0.0;
        let step = (f64::from(max) - f64::from(min)) / STEPS;
        // The largest power of two that is no larger, and from there up.
        let smallest = (step as f32).to_bits() >> 23;
        let fits = |exponent: &u8| is_at_least(origin, STEPS * scale(*exponent), max);
        let exponent = (smallest.saturating_sub(1).clamp(1, 254) as u8..=254).find(fits);
        Self { origin, exponent: exponent.unwrap_or(254) }
    }

    /// Most steps that lead no farther than `x`, which is no less than the origin.
    pub(super) fn below(self, x: f32) -> u8 {
        let scale = scale(self.exponent);
        let mut steps = ((f64::from(x) - f64::from(self.origin)) / scale).floor().clamp(0.0, STEPS);
        while steps > 0.0 && !is_at_most(self.origin, steps * scale, x) {
            steps -= 1.0;
        }
        steps as u8
    }

    /// Steps that lead at least as far as `x`, which is no more than the end of the node.
    pub(super) fn above(self, x: f32) -> u8 {
        let scale = scale(self.exponent);
        let mut steps = ((f64::from(x) - f64::from(self.origin)) / scale).ceil().clamp(0.0, STEPS);
        while steps < STEPS && !is_at_least(self.origin, steps * scale, x) {
            steps += 1.0;
        }
        steps as u8
    }
}

/// `2^(exponent - 127)`.
fn scale(exponent: u8) -> f64 {
    f64::from(f32::from_bits(u32::from(exponent) << 23))
}

/// The sum of two numbers, rounded, and what rounding took from it (Knuth 1997, 4.2.2, theorem B).
fn sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// Whether `a + b <= x` without rounding.
fn is_at_most(a: f32, b: f64, x: f32) -> bool {
    let (sum, lost) = sum(f64::from(a), b);
    let x = f64::from(x);
    sum < x || (sum == x && lost <= 0.0)
}

/// Whether `a + b >= x` without rounding.
fn is_at_least(a: f32, b: f64, x: f32) -> bool {
    let (sum, lost) = sum(f64::from(a), b);
    let x = f64::from(x);
    sum > x || (sum == x && lost >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The number as a whole multiple of 2^-149 in 512 bits or so: its bits from the lowest place on.
    fn places(x: f32) -> Option<i128> {
        // Small enough for 128 bits.
        let scaled = f64::from(x) * 2f64.powi(40);
        (scaled.fract() == 0.0 && scaled.abs() < 2f64.powi(100)).then_some(scaled as i128)
    }

    proptest! {
        #[test]
        fn steps_contain_and_are_the_best(
            a in -1_000_000i32..1_000_000, extent in 0u32..3_000_000, at in 0u32..=1000, places_after in 0i32..20
        ) {
            let unit = 2f32.powi(-places_after);
            let (min, max) = (a as f32 * unit, (a as f32 + extent as f32) * unit);
            let x = (min + (max - min) * at as f32 / 1000.0).clamp(min, max);
            let axis = Axis::of(min, max);
            let exact = |steps: u8| {
                places(axis.origin).zip(places(scale(axis.exponent) as f32)).map(|(o, s)| o + s * i128::from(steps))
            };
            let (below, above) = (axis.below(x), axis.above(x));
            if let (Some(low), Some(high), Some(x), Some(end)) = (exact(below), exact(above), places(x), places(max)) {
                prop_assert!(low <= x && x <= high);
                // The next step would not do.
                prop_assert!(below == 255 || exact(below + 1).unwrap() > x);
                prop_assert!(above == 0 || exact(above - 1).unwrap() < x);
                prop_assert!(exact(255).unwrap() >= end);
                let half = places(scale(axis.exponent) as f32 / 2.0);
                let finer = half.map(|half| places(axis.origin).unwrap() + 255 * half);
                prop_assert!(axis.exponent == 1 || finer.is_none_or(|finer| finer < end));
            }
        }

        #[test]
        fn any_two_numbers(a: f32, b: f32, at in 0.0f32..1.0) {
            prop_assume!(a.is_finite() && b.is_finite());
            let (min, max) = (a.min(b), a.max(b));
            let x = (min + (max * at - min * at)).clamp(min, max);
            let axis = Axis::of(min, max);
            let step = f32::from_bits(u32::from(axis.exponent) << 23);
            let face = |steps: u8| axis.origin + f32::from(steps) * step;
            prop_assert!(face(axis.below(x)) <= x, "{axis:?}");
            prop_assert!(face(axis.above(x)) >= x, "{axis:?}");
            prop_assert!(face(axis.above(max)) >= max, "{axis:?}");
        }
    }

    #[test]
    fn what_rounding_hides_is_seen() {
        // 1 + 2^-60 is 1 in f64.
        let tiny = 2f64.powi(-60);
        assert!(!is_at_most(1.0, tiny, 1.0) && is_at_least(1.0, tiny, 1.0));
        assert!(is_at_most(1.0, -tiny, 1.0) && !is_at_least(1.0, -tiny, 1.0));
        assert!(is_at_most(1.0, 0.0, 1.0) && is_at_least(1.0, 0.0, 1.0));
    }

    #[test]
    fn a_flat_axis_stays_flat() {
        let axis = Axis::of(0.3, 0.3);
        assert_eq!((axis.exponent, axis.below(0.3), axis.above(0.3)), (1, 0, 0));
        let tiny = f32::from_bits(1);
        let axis = Axis::of(0.0, tiny);
        assert_eq!((axis.below(0.0), axis.above(tiny)), (0, 1));
    }
}

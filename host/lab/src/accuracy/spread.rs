//! How differences are spread over powers of two, which is what roundings come in.

use serde::Serialize;
use std::collections::BTreeMap;

/// Magnitudes of any number of values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Values.
    pub count: u64,
    /// Values that are exactly 0.
    pub zeros: u64,
    /// Values that are infinite or no number.
    pub not_finite: u64,
    /// The largest magnitude; infinite if one is not finite, 0 without a value.
    pub max: f64,
    /// `k: n` for `n` magnitudes of at least 2^k and below 2^(k+1).
    pub log2: BTreeMap<i32, u64>,
}

impl Spread {
    /// Counts one value.
    pub fn add(&mut self, value: f64) {
        let magnitude = value.abs();
        self.count += 1;
        if !magnitude.is_finite() {
            self.not_finite += 1;
            self.max = f64::INFINITY;
            return;
        }
        self.max = self.max.max(magnitude);
        if magnitude == 0.0 {
            self.zeros += 1;
        } else {
            // The exponent field; what is denormal counts as the smallest normal.
            let k = ((magnitude.to_bits() >> 52).max(1) as i32) - 1023;
            *self.log2.entry(k).or_default() += 1;
        }
    }

    /// Counts the values of another.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.zeros += other.zeros;
        self.not_finite += other.not_finite;
        self.max = self.max.max(other.max);
        for (k, n) in &other.log2 {
            *self.log2.entry(*k).or_default() += n;
        }
    }

    /// A bound that holds for a `part` of the values: 0, a power of two, or the maximum. 0 without a value.
    #[must_use]
    pub fn bound_of(&self, part: f64) -> f64 {
        let mut missing = (part * self.count as f64).ceil() as u64;
        missing = missing.saturating_sub(self.zeros);
        if missing == 0 {
            return 0.0;
        }
        for (&k, &n) in &self.log2 {
            missing = missing.saturating_sub(n);
            if missing == 0 {
                return 2f64.powi(k + 1).min(self.max);
            }
        }
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Spread {
        let mut spread = Spread::default();
        values.iter().for_each(|&value| spread.add(value));
        spread
    }

    #[test]
    fn values_fall_into_powers_of_two() {
        let spread = of(&[0.0, -0.25, 0.3, 0.5, -1.0, 1.999, 5e-324]);
        assert_eq!((spread.count, spread.zeros, spread.not_finite, spread.max), (7, 1, 0, 1.999));
        assert_eq!(spread.log2, BTreeMap::from([(-1022, 1), (-2, 2), (-1, 1), (0, 2)]));
    }

    #[test]
    fn bounds_hold_for_their_part_and_no_less() {
        let values: Vec<f64> = (0..1000).map(|k| f64::from(k) / 1000.0).collect();
        let spread = of(&values);
        for part in [0.001, 0.1, 0.5, 0.9, 0.99, 1.0] {
            let bound = spread.bound_of(part);
            let below = values.iter().filter(|value| **value <= bound).count() as f64;
            assert!(below >= part * 1000.0, "{part}: {bound}");
            let half = values.iter().filter(|value| **value < bound / 2.0).count() as f64;
            assert!(half < part * 1000.0 || bound == 0.0, "{part}: {bound} is not tight");
        }
        assert_eq!((spread.bound_of(1.0), of(&[0.0; 3]).bound_of(1.0), of(&[]).bound_of(0.5)), (0.999, 0.0, 0.0));
    }

    #[test]
    fn what_is_no_number_is_beyond_every_bound() {
        let spread = of(&[f64::NAN, 1.0, f64::INFINITY, 0.0]);
        assert_eq!((spread.count, spread.not_finite, spread.max), (4, 2, f64::INFINITY));
        assert_eq!((spread.bound_of(0.5), spread.bound_of(0.75)), (2.0, f64::INFINITY));
    }

    #[test]
    fn merging_is_adding_all() {
        let (a, b) = ([0.0, 0.25, 3.0], [0.3, f64::NAN, 1e-9]);
        let mut merged = of(&a);
        merged.merge(&of(&b));
        assert_eq!(merged, of(&[a, b].concat()));
    }
}

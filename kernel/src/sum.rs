//! Sums of areas that are the same in every order.
//!
//! A float sum depends on the order of its terms, and invocations have none. So terms become whole multiples of a unit, 2⁻⁴⁴ of the root's area or
//! a little less, in 64 bits made of two words: integers add up to the same in every order, also without 64-bit atomics.

use crate::mem::AtomicU32;

/// Binary digits of a root's area that a sum keeps behind the point.
pub const DIGITS: u32 = 44;

/// Units of the higher word.
const WORD: f32 = 4_294_967_296.0;

/// A sum of terms that are not negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sum {
    low: u32,
    high: u32,
}

impl Sum {
    /// Of no terms.
    pub const ZERO: Self = Self { low: 0, high: 0 };

    /// One term times `scale`, a power of two; 0 if that is below 1, negative or NaN.
    #[inline(always)]
    #[must_use]
    pub fn of(term: f32, scale: f32) -> Self {
        let scaled = term * scale;
        // Not below: what a conversion makes of a number that does not fit is left to the driver.
        let fits = scaled < WORD * WORD;
        if fits && scaled >= 1.0 {
            let high = (scaled * (1.0 / WORD)) as u32;
            // Exact: what is left has some of the 24 digits of the term.
            let low = (scaled - high as f32 * WORD) as u32;
            Self { low, high }
        } else {
            Self::ZERO
        }
    }

    /// Both together.
    #[inline(always)]
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        let low = self.low.wrapping_add(other.low);
        let carry = (low < other.low) as u32;
        Self { low, high: self.high.wrapping_add(other.high).wrapping_add(carry) }
    }

    /// The first less the second, in two's complement.
    #[inline(always)]
    #[must_use]
    pub fn minus(self, other: Self) -> Self {
        let borrow = (self.low < other.low) as u32;
        Self { low: self.low.wrapping_sub(other.low), high: self.high.wrapping_sub(other.high).wrapping_sub(borrow) }
    }

    /// Whether it is more than the other, both in two's complement.
    #[inline(always)]
    #[must_use]
    pub fn exceeds(self, other: Self) -> bool {
        let (own, their) = (self.high as i32, other.high as i32);
        own > their || (own == their && self.low > other.low)
    }

    /// How much more it is than the other, both in two's complement; 0 if it is less.
    #[inline(always)]
    #[must_use]
    pub fn excess(self, other: Self) -> f32 {
        if self.exceeds(other) { self.minus(other).to_f32() } else { 0.0 }
    }

    /// A sum that is not negative, rounded.
    #[inline(always)]
    #[must_use]
    pub fn to_f32(self) -> f32 {
        self.high as f32 * WORD + self.low as f32
    }

    /// Of these two words.
    #[inline(always)]
    #[must_use]
    pub fn from_words(words: [u32; 2]) -> Self {
        Self { low: words[0], high: words[1] }
    }

    /// The sum in two words from `at` on.
    #[inline(always)]
    #[must_use]
    pub fn load(words: &[AtomicU32], at: usize) -> Self {
        Self { low: words[at].load(), high: words[at + 1].load() }
    }

    /// Replaces the sum in two words from `at` on.
    #[inline(always)]
    pub fn store(self, words: &[AtomicU32], at: usize) {
        words[at].store(self.low);
        words[at + 1].store(self.high);
    }

    /// Adds to the sum in two words from `at` on, which are whole again at the end of the dispatch.
    #[inline(always)]
    pub fn add_to(self, words: &[AtomicU32], at: usize) {
        if self.low != 0 || self.high != 0 {
            let before = words[at].add(self.low);
            let carry = (before.wrapping_add(self.low) < self.low) as u32;
            if self.high + carry != 0 {
                words[at + 1].add(self.high + carry);
            }
        }
    }
}

/// The power of two that brings a root of this half area just below 2⁴⁴ units.
#[cfg(not(target_arch = "spirv"))]
#[must_use]
pub fn scale_of(root_area: f64) -> f32 {
    let exponent = if root_area > 0.0 && root_area.is_finite() { root_area.log2().ceil() } else { 0.0 };
    (f64::from(DIGITS) - exponent).exp2() as f32
}

/// A sum of two words as a number of areas.
#[cfg(not(target_arch = "spirv"))]
#[must_use]
pub fn to_f64(low: u32, high: u32, scale: f32) -> f64 {
    ((u64::from(high) << 32 | u64::from(low)) as i64) as f64 / f64::from(scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(sum: Sum) -> i64 {
        (u64::from(sum.high) << 32 | u64::from(sum.low)) as i64
    }

    #[test]
    fn a_term_is_cut_to_whole_units() {
        for (term, units) in [(0.0, 0), (0.99, 0), (1.0, 1), (5.75, 5), (-3.0, 0), (f32::NAN, 0)] {
            assert_eq!(number(Sum::of(term, 1.0)), units, "{term}");
        }
        let large = 12_345_678_848_000.0f32;
        assert_eq!(number(Sum::of(large, 1.0)), large as i64);
        assert_eq!(number(Sum::of(f32::MAX, 1.0)), 0, "no sum of a tree");
    }

    #[test]
    fn words_carry_in_every_order() {
        let terms = [4e9f32, 3.9e9, 1.7, 8e12, 4.1e9, 65_536.5];
        let expected: i64 = terms.iter().map(|&term| term as i64).sum();
        for turn in 0..terms.len() {
            let mut words = [0; 4];
            let words = AtomicU32::from_mut_slice(&mut words);
            for k in 0..terms.len() {
                Sum::of(terms[(k + turn) % terms.len()], 1.0).add_to(words, 1);
            }
            assert_eq!(number(Sum::load(words, 1)), expected);
        }
    }

    #[test]
    fn differences_may_be_negative() {
        let (small, large) = (Sum::of(7.0, 1.0), Sum::of(9e9, 1.0));
        assert_eq!(number(small.minus(large)), 7 - 9e9f32 as i64);
        assert!(large.exceeds(small) && !small.exceeds(small) && small.exceeds(small.minus(large)));
        assert_eq!(small.minus(large).plus(large), small);
    }

    #[test]
    fn an_excess_is_rounded_and_never_negative() {
        let (small, large) = (Sum::of(7.0, 1.0), Sum::of(9e9, 1.0));
        assert_eq!(large.excess(small), 9e9 - 7.0);
        assert_eq!(small.excess(large), 0.0);
        assert_eq!(small.excess(small.minus(large)), 9e9, "the other is negative");
        assert_eq!(Sum::from_words([5, 2]).to_f32(), 8_589_934_597.0);
    }

    #[test]
    fn a_root_has_room_above_it() {
        for area in [1e-20, 3.0, 1.0, 7e18] {
            let scaled = area * f64::from(scale_of(area));
            assert!(scaled <= 2f64.powi(44) && scaled > 2f64.powi(43), "{area}");
        }
    }
}

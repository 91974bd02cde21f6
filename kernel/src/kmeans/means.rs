//! Centres become the means of their clusters.

use super::{COUNT, MOVED, PER_CLUSTER, Part, Point, TALLY_WORDS};
use crate::mem::{AtomicU32, Slot};
use bytemuck::{Pod, Zeroable};

/// Push constants of [`means`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct MeansParams {
    /// Invocations: one per cluster of each large part.
    pub count: u32,
    /// Clusters of a part.
    pub clusters: u32,
    /// Number of the round, from 0.
    pub round: u32,
}

/// Invocation `i` moves centre `i % k` of part `i / k` to the mean of its references, rounded down, and empties its sums; nothing if no reference of the part moved in this round. A centre without
/// references stays where it is.
#[inline(always)]
pub fn means(i: u32, params: &MeansParams, parts: &[Part], tallies: &[AtomicU32], centres: &[Slot<Point>]) {
    let first = parts[(i / params.clusters) as usize].start / PER_CLUSTER;
    let slot = first + i % params.clusters;
    let at = (slot * TALLY_WORDS) as usize;
    let count = tallies[at + COUNT as usize].load();
    let moved = tallies[(first * TALLY_WORDS + MOVED) as usize].load();
    if moved == params.round + 1 {
        if count > 0 {
            let mean = move |axis: usize| {
                let word = at + 2 * axis;
                quotient(tallies[word].load(), tallies[word + 1].load(), count) as f32
            };
            centres[slot as usize].set([mean(0), mean(1), mean(2), mean(3), mean(4), mean(5)]);
        }
        for word in 0..COUNT as usize + 1 {
            tallies[at + word].store(0);
        }
    }
}

/// `(high · 2^32 + low) / divisor`, rounded down, of which the lower word is enough; the divisor is below 2^31.
#[inline(always)]
fn quotient(low: u32, high: u32, divisor: u32) -> u32 {
    let (mut quotient, mut rest) = (0u32, 0u32);
    for k in 0..64u32 {
        let word = if k < 32 { high >> (31 - k) } else { low >> (63 - k) };
        rest = rest << 1 | word & 1;
        quotient <<= 1;
        if rest >= divisor {
            rest -= divisor;
            quotient |= 1;
        }
    }
    quotient
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_are_rounded_down() {
        for (dividend, divisor) in
            [(0u64, 1), (7, 2), (u64::from(u32::MAX) * 3, 3), (1 << 52, (1 << 31) - 1), (99, 100)]
        {
            let words = [dividend as u32, (dividend >> 32) as u32];
            assert_eq!(u64::from(quotient(words[0], words[1], divisor)), dividend / u64::from(divisor));
        }
    }
}

//! How many nodes a round wants where the rounds before it may have hurried.
//!
//! Where rounds find nothing, four times as many nodes are wanted from then on. The host plans many rounds before it knows; so the books count how often there was
//! [hurry](HURRIED), and rounds want more by what was counted since they were planned. Numbers are whole ones with a fraction, so that both come to the same.

use super::RoundParams;
use super::words::HURRIED;
use crate::math::{umax, umin};
use crate::mem::AtomicU32;

/// Bits of four.
const BITS_OF_ONE: u32 = 2;
/// A shift by so much is beyond the most nodes that there are.
const MOST_BITS: u32 = 30;

/// `[whole, fraction]` times four to the power of `times`, without its fraction; `most` at the most.
#[inline(always)]
fn times_four([whole, fraction]: [u32; 2], times: u32, most: u32) -> u32 {
    let bits = BITS_OF_ONE * umin(times, MOST_BITS / BITS_OF_ONE);
    if bits == 0 {
        umin(whole, most)
    } else if whole >> (32 - bits) != 0 {
        most
    } else {
        umin(whole << bits | fraction >> (32 - bits), most)
    }
}

/// How often there was hurry since the round was planned.
#[inline(always)]
fn since(params: &RoundParams, books: &[AtomicU32]) -> u32 {
    books[HURRIED].load().wrapping_sub(params.hurried)
}

/// Nodes to search in the round.
#[inline(always)]
pub(in crate::prbvh) fn wanted(params: &RoundParams, books: &[AtomicU32]) -> u32 {
    times_four(params.wanted, since(params, books), params.most)
}

/// As many nodes as should be in the pool for the next round.
#[inline(always)]
pub(in crate::prbvh) fn pool(params: &RoundParams, books: &[AtomicU32]) -> u32 {
    let pools = umax(params.pools, 1);
    umin(times_four(params.next, since(params, books), params.most), u32::MAX / pools) * pools
}

/// Takes note of hurry; returns whether the rounds that are planned can do what is wanted then.
#[inline(always)]
pub(super) fn hurry(params: &RoundParams, books: &[AtomicU32]) -> bool {
    books[HURRIED].add(1);
    times_four(params.next, since(params, books), params.most) <= params.room
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_times_a_number_is_what_the_host_says() {
        let most = 1_234_567.0;
        for first in [1.0f64, 8.0, 63.9, 400.125, 1e5] {
            let mut wanted = first;
            for _ in 0..40 {
                let parts = [wanted as u32, (wanted.fract() * 4_294_967_296.0) as u32];
                let mut hurried = wanted;
                for times in 0..20 {
                    assert_eq!(times_four(parts, times, most as u32), hurried as u32, "{wanted}, {times}");
                    hurried = (4.0 * hurried).min(most);
                }
                wanted = (1.3 * wanted).min(most);
            }
        }
        assert_eq!(times_four([u32::MAX, u32::MAX], 0, u32::MAX), u32::MAX);
        assert_eq!(times_four([0, u32::MAX], 16, 9), 9);
    }
}

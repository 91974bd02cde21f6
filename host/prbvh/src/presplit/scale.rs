//! The largest scale of the priorities whose splits are within the budget.

use prbvh_kernel::presplit::SCALES;
use prbvh_kernel::presplit::places::ChunkShare;

/// Scales of one pass.
pub(super) type Scales = [f32; SCALES as usize];

/// An interval of scales, by their bits, which are in the order of the numbers: the splits by the lower end are within the budget, those by the upper end are not, or nobody
/// asked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    low: u32,
    high: u32,
}

impl Interval {
    /// From a scale that splits nothing to one that splits whatever has a priority as often as it goes.
    pub(super) fn whole() -> Self {
        Self { low: 2f32.powi(-20).to_bits(), high: 2f32.powi(60).to_bits() }
    }

    /// Whether nothing lies between the ends.
    pub(super) fn is_found(&self) -> bool {
        self.high - self.low <= 1
    }

    fn inner(&self, k: u32) -> u32 {
        let part = u64::from(self.high - self.low) * u64::from(k + 1) / u64::from(SCALES + 1);
        self.low + part as u32
    }

    /// Scales that part it into 17.
    pub(super) fn scales(&self) -> Scales {
        std::array::from_fn(|k| f32::from_bits(self.inner(k as u32)))
    }

    /// The part in which the budget is reached, by the splits of its [`scales`](Self::scales).
    pub(super) fn narrowed(&self, splits: [u64; SCALES as usize], budget: u64) -> Self {
        let within = splits.iter().take_while(|&&splits| splits <= budget).count() as u32;
        let low = if within > 0 { self.inner(within - 1) } else { self.low };
        let high = if within < SCALES { self.inner(within) } else { self.high };
        Self { low, high }
    }

    /// Its ends.
    pub(super) fn ends(&self) -> [f32; 2] {
        [self.low, self.high].map(f32::from_bits)
    }
}

/// The sums over all chunks, from `sums[16 · chunks]`.
pub(super) fn totals(sums: &[u32]) -> [u64; SCALES as usize] {
    let mut totals = [0; SCALES as usize];
    for chunk in sums.chunks(SCALES as usize) {
        for (total, &sum) in totals.iter_mut().zip(chunk) {
            *total += u64::from(sum);
        }
    }
    totals
}

/// The shares of the chunks, by their splits at the scale, the first sum of each, and at the next larger one, the second; and how many pieces there will be.
pub(super) fn shares(sums: &[u32], chunk_lengths: impl Iterator<Item = u32>, budget: u64) -> (Vec<ChunkShare>, u64) {
    let by_scale: u64 = sums.chunks(SCALES as usize).map(|sums| u64::from(sums[0])).sum();
    let mut left = budget.saturating_sub(by_scale);
    let mut place = 0u64;
    let share = |(sums, length): (&[u32], u32)| {
        let more = u64::from(sums[1] - sums[0]).min(left);
        left -= more;
        let share = ChunkShare { more: more as u32, place: place as u32 };
        place += u64::from(length) + u64::from(sums[0]) + more;
        share
    };
    let shares = sums.chunks(SCALES as usize).zip(chunk_lengths).map(share).collect();
    (shares, place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh_kernel::presplit::places::splits;
    use proptest::prelude::*;

    fn found(priorities: &[f32], budget: u64) -> Interval {
        let mut interval = Interval::whole();
        let mut passes = 0;
        while !interval.is_found() {
            let scales = interval.scales();
            let of = |scale: f32| priorities.iter().map(|&priority| u64::from(splits(priority, scale))).sum();
            interval = interval.narrowed(scales.map(of), budget);
            passes += 1;
        }
        assert!(passes <= 8, "{passes}");
        interval
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn the_scale_is_the_last_within_the_budget(priorities in prop::collection::vec(0.0f32..1.5, 1..60), budget in 0u64..200) {
            let [scale, next] = found(&priorities, budget).ends();
            let of = |scale: f32| -> u64 { priorities.iter().map(|&p| u64::from(splits(p, scale))).sum() };
            prop_assert!(of(scale) <= budget && of(next) > budget, "{} {} {}", of(scale), of(next), budget);
            prop_assert_eq!(next.to_bits(), scale.to_bits() + 1);
        }
    }

    #[test]
    fn equal_priorities_share_what_is_left() {
        let [scale, next] = found(&[0.5; 70], 21).ends();
        assert_eq!((splits(0.5, scale), splits(0.5, next)), (0, 1));
        let mut sums = vec![0u32; 3 * SCALES as usize];
        for (k, length) in [30, 30, 10].into_iter().enumerate() {
            sums[k * SCALES as usize + 1] = length;
        }
        let (shares, pieces) = shares(&sums, [30, 30, 10].into_iter(), 41);
        let expected = [(30, 0), (11, 60), (0, 101)].map(|(more, place)| ChunkShare { more, place });
        assert_eq!((shares, pieces), (expected.to_vec(), 111));
    }
}

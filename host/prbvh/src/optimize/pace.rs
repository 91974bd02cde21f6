//! How many rounds go in one submission.

use super::Limits;
use crate::device::{DeviceInfo, DeviceKind};
use std::time::Duration;

/// Most rounds of the first submission of a search; each further one has twice as many. Those after the end of a search do nothing, but a GPU takes a microsecond or two
/// for each of their dispatches. So there are never more of these than rounds that did something, or the few that take less time than a submission.
const AT_FIRST: u32 = 32;
/// Most rounds of any submission.
pub(super) const MOST_AT_ONCE: u32 = 64;
/// A round takes as long as to search so many nodes more.
const OF_A_ROUND: f64 = 1000.0;
/// Nodes searched in a second, before it is known.
const FIRST_RATE: f64 = 1e6;
/// A rate rises by so much at the most from one submission to the next.
const MOST_RISE: f64 = 8.0;

/// What a device did in the submissions so far.
#[derive(Debug)]
pub(super) struct Pace {
    news: Duration,
    rate: f64,
    /// Whether rounds behind the end of a search cost less than to ask whether it has ended. Not where the CPU does both.
    goes_beyond: bool,
    /// Most rounds that go next.
    most: u32,
    /// Work of each round that goes next.
    planned: Vec<f64>,
}

impl Pace {
    /// Nothing is known. A submission should take about as long as `news`.
    pub(super) fn new(news: Duration, device: &DeviceInfo) -> Self {
        Self {
            news,
            rate: FIRST_RATE,
            goes_beyond: device.kind == DeviceKind::VulkanGpu,
            most: AT_FIRST,
            planned: Vec::new(),
        }
    }

    /// Says that a search begins.
    pub(super) fn begin(&mut self) {
        self.most = AT_FIRST;
    }

    /// How many rounds go next, of those that search so many nodes each and after which the search may end or not: no more than the limits leave, and one at
    /// least.
    pub(super) fn rounds(
        &mut self,
        rounds: impl IntoIterator<Item = (f64, bool)>,
        limits: &Limits,
        iterations: u32,
        elapsed: Duration,
    ) -> u32 {
        let left = limits.max_time.map_or(self.news, |most| most.saturating_sub(elapsed).min(self.news));
        let most = self.most.min(limits.max_iterations.saturating_sub(iterations)).max(1);
        let mut room = self.rate * left.as_secs_f64();
        self.planned.clear();
        for (searched, may_end) in rounds.into_iter().take(most as usize) {
            let work = searched + OF_A_ROUND;
            room -= work;
            if room < 0.0 && !self.planned.is_empty() {
                break;
            }
            self.planned.push(work);
            if room < 0.0 || may_end && !self.goes_beyond {
                break;
            }
        }
        self.planned.len() as u32
    }

    /// Takes note of how long it took to make so many of them.
    pub(super) fn note(&mut self, made: usize, seconds: f64) {
        if made == self.planned.len() {
            self.most = (2 * self.most).min(MOST_AT_ONCE);
        }
        if made > 0 && seconds > 0.0 {
            let rate = self.planned[..made].iter().sum::<f64>() / seconds;
            self.rate = rate.min(MOST_RISE * self.rate);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pace(news: Duration, kind: DeviceKind) -> Pace {
        Pace::new(news, &DeviceInfo::new("any", kind))
    }

    fn all(searched: &[f64]) -> Vec<(f64, bool)> {
        searched.iter().map(|&searched| (searched, true)).collect()
    }

    const NONE: Duration = Duration::ZERO;
    const NEWS: Duration = Duration::from_millis(20);

    #[test]
    fn rounds_fill_a_slice_of_time() {
        let limits = Limits::iterations(1000);
        let mut pace = pace(NEWS, DeviceKind::VulkanGpu);
        let few = |pace: &mut Pace| pace.rounds(all(&[1000.0; 100]), &limits, 0, NONE);
        assert_eq!(few(&mut pace), 10);
        pace.note(10, 0.001);
        for most in [64, 64] {
            assert_eq!(few(&mut pace), most, "the rate rises");
            pace.note(most as usize, 0.001);
        }
        pace.note(60, 0.1);
        assert_eq!(few(&mut pace), 12, "and falls");
        pace.begin();
        pace.note(6, 0.001);
        assert_eq!(few(&mut pace), 32, "another search");
        assert_eq!(pace.rounds(all(&[1e9, 1.0]), &limits, 0, NONE), 1, "one round goes in any case");
        assert_eq!(pace.rounds(all(&[1e3, 1e9, 1.0]), &limits, 0, NONE), 1);
    }

    #[test]
    fn limits_and_observers_of_trees_make_them_fewer() {
        let mut gpu = pace(NEWS, DeviceKind::VulkanGpu);
        let limits = Limits { max_time: Some(Duration::from_millis(100)), ..Limits::iterations(8) };
        let mut rounds =
            |iterations, elapsed| gpu.rounds(all(&[0.0; 100]), &limits, iterations, Duration::from_millis(elapsed));
        assert_eq!(rounds(0, 0), 8);
        assert_eq!(rounds(5, 0), 3);
        assert_eq!(rounds(0, 95), 5);
        assert_eq!(rounds(0, 200), 1);
        assert_eq!(pace(NONE, DeviceKind::VulkanGpu).rounds(all(&[0.0; 100]), &Limits::iterations(8), 0, NONE), 1);
    }

    #[test]
    fn where_the_cpu_does_both_no_round_goes_beyond_the_end() {
        let limits = Limits::iterations(100);
        let rounds = [(0.0, false), (0.0, false), (0.0, true), (0.0, true)];
        for (kind, expected) in [(DeviceKind::Cpu, 3), (DeviceKind::VulkanCpu, 3), (DeviceKind::VulkanGpu, 4)] {
            assert_eq!(pace(NEWS, kind).rounds(rounds, &limits, 0, NONE), expected);
        }
    }
}

//! Device time by kind of work.

use prbvh::device::Timing;
use serde::{Deserialize, Serialize};

/// All dispatches of one label.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Label under which they were recorded.
    pub label: String,
    /// Seconds on the device in all.
    pub seconds: f64,
    /// Dispatches.
    pub calls: u64,
    /// Share of the device time of all phases, 0 to 1.
    pub share: f64,
}

/// Adds up timings as they come.
#[derive(Clone, Debug, Default)]
pub struct PhaseTimes {
    sums: Vec<(&'static str, f64, u64)>,
}

impl PhaseTimes {
    /// Adds what one recording took.
    pub fn add(&mut self, timings: &[Timing]) {
        for timing in timings {
            // A dozen labels: a walk over them is cheaper than a map.
            match self.sums.iter_mut().find(|(label, ..)| *label == timing.label) {
                Some((_, seconds, calls)) => {
                    *seconds += timing.seconds;
                    *calls += 1;
                }
                None => self.sums.push((timing.label, timing.seconds, 1)),
            }
        }
    }

    /// The phases, longest first; equally long ones in the order of their first dispatch.
    #[must_use]
    pub fn phases(&self) -> Vec<Phase> {
        let total: f64 = self.sums.iter().map(|(_, seconds, _)| seconds).sum();
        let share = |seconds: f64| if total > 0.0 { seconds / total } else { 0.0 };
        let mut phases: Vec<Phase> = self
            .sums
            .iter()
            .map(|&(label, seconds, calls)| Phase { label: label.to_owned(), seconds, calls, share: share(seconds) })
            .collect();
        phases.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
        phases
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timings_add_up_by_label() {
        let timing = |label, seconds| Timing { label, seconds };
        let mut times = PhaseTimes::default();
        times.add(&[timing("lock", 0.5), timing("search", 2.0)]);
        times.add(&[timing("search", 1.0), timing("lock", 0.5)]);
        let phase = |label: &str, seconds, calls, share| Phase { label: label.to_owned(), seconds, calls, share };
        assert_eq!(times.phases(), [phase("search", 3.0, 2, 0.75), phase("lock", 1.0, 2, 0.25)]);
    }

    #[test]
    fn a_device_without_a_clock_has_no_shares() {
        let mut times = PhaseTimes::default();
        assert!(times.phases().is_empty());
        times.add(&[Timing { label: "b", seconds: 0.0 }, Timing { label: "a", seconds: 0.0 }]);
        let phases = times.phases();
        assert_eq!((phases[0].label.as_str(), phases[0].share), ("b", 0.0));
    }
}

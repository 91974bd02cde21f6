//! The largest reinsertions first: levels of a floor that every reinsertion of a level must exceed.
//!
//! Most searches of the published order find nothing, and most of what the others find is small. A floor ends the search of a node that cannot
//! gain so much after a few steps, and every other search as soon as no output is left that could. So the first levels, which
//! make most of the gain, cost next to nothing. In each level the nodes are searched in turn, every `mu`-th at a time: the more there are, the more of
//! their reinsertions are in each other's way. Those that lose their locks have a second try.

use crate::build::{Scanner, Scratch};
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::PrbvhParams;

/// Levels; the last floor is 2⁻²⁴ of the half area of the root.
const LEVELS: u32 = 10;

/// The floor of a level as a part of the half area of the root: a quarter of the floor before.
fn floor(level: u32) -> f32 {
    1.0 / (1u32 << (6 + 2 * level)) as f32
}

/// One pass over every `mu`-th candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pass {
    /// Floor as a part of the half area of the root.
    pub(super) floor: f32,
    pub(super) mu: u32,
    pub(super) first: u32,
    /// Whether it is the first of its level, and needs a new list.
    pub(super) begins_level: bool,
}

/// Where the descent is.
#[derive(Debug)]
pub(super) struct Descent {
    most_mu: u32,
    level: u32,
    first: u32,
}

impl Descent {
    pub(super) fn new(most_mu: u32) -> Self {
        Self { most_mu: most_mu.max(1), level: 0, first: 0 }
    }

    /// No descent.
    pub(super) fn over() -> Self {
        Self { most_mu: 1, level: LEVELS, first: 0 }
    }

    pub(super) fn is_over(&self) -> bool {
        self.level >= LEVELS
    }

    fn mu(&self) -> u32 {
        self.level.clamp(1, self.most_mu)
    }
}

impl Iterator for Descent {
    type Item = Pass;

    fn next(&mut self) -> Option<Pass> {
        if self.is_over() {
            return None;
        }
        let (level, first, mu) = (self.level, self.first, self.mu());
        self.first += 1;
        if self.first == mu {
            (self.level, self.first) = (level + 1, 0);
        }
        Some(Pass { floor: floor(level), mu, first, begins_level: first == 0 })
    }
}

/// Buffers of the list of candidates.
#[derive(Debug)]
pub(super) struct Candidates {
    flags: Buffer,
    pub(super) list: Buffer,
    scanner: Scanner,
}

impl Candidates {
    pub(super) fn new(scratch: &mut Scratch, device: &mut dyn Device, nodes: u32) -> Result<Self, DeviceError> {
        let internal = nodes as usize / 2;
        let flags = scratch.allocate(device, "candidate flags", internal + 1, 4)?;
        let list = scratch.allocate(device, "candidates", (2 * internal).max(1), 4)?;
        let scanner = Scanner::new(scratch, device, internal + 1)?;
        Ok(Self { flags, list, scanner })
    }

    /// Records the making of the list of all nodes that may gain more than `floor`; `report` gets their number.
    pub(super) fn record(
        &self,
        recording: &mut Recording,
        nodes: &Buffer,
        node_count: u32,
        floor: f32,
        report: &Buffer,
    ) {
        let Self { flags, list, scanner } = self;
        let params = |count| PrbvhParams { count, mu: 1, first: 0, nodes: node_count, floor };
        let internal = node_count / 2;
        let flagged = internal + 1;
        recording.dispatch("candidates", Kernel::PrbvhFlag, flagged, &params(flagged), &[nodes, flags]);
        scanner.record(recording, "candidates", flags, flagged);
        let buffers = [flags, nodes, list, report];
        recording.dispatch("candidates", Kernel::PrbvhPack, internal, &params(internal), &buffers);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_searches_every_candidate_once() {
        let passes: Vec<Pass> = Descent::new(4).collect();
        for level in 0..LEVELS {
            let of_level: Vec<&Pass> = passes.iter().filter(|pass| pass.floor == floor(level)).collect();
            let mu = of_level[0].mu;
            assert_eq!(mu, level.clamp(1, 4));
            let firsts: Vec<u32> = of_level.iter().map(|pass| pass.first).collect();
            assert_eq!(firsts, (0..mu).collect::<Vec<_>>());
        }
        assert!(passes.is_sorted_by(|a, b| a.floor >= b.floor));
    }

    #[test]
    fn a_list_holds_each_candidate_of_a_level() {
        let mut floor = f32::INFINITY;
        for pass in Descent::new(9) {
            assert_eq!(pass.begins_level, pass.floor != floor);
            floor = pass.floor;
        }
    }

    #[test]
    fn a_descent_that_is_over_has_no_pass() {
        assert_eq!(Descent::over().next(), None);
        assert!(Descent::over().is_over());
    }
}

//! How many nodes the searches of PRBVH visit.

use prbvh_kernel::mem::{AtomicU32, Slot};
use prbvh_kernel::node::{Node, WideNode};
use prbvh_kernel::prbvh::search::search;
use prbvh_kernel::prbvh::worst::books::BOOKS_WORDS;
use prbvh_kernel::prbvh::{Move, PrbvhParams};
use prbvh_kernel::status::{FOUND, MOST_STEPS, REPORT_WORDS};
use rayon::prelude::*;

/// Searches of all nodes of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Searches: nodes but the root.
    pub searches: u64,
    /// Steps of them all. A step loads one node on the way down or to the side; ways up and pivots load some again.
    pub steps: u64,
    /// Steps of the longest.
    pub most: u32,
    /// Searches that found a reinsertion.
    pub found: u64,
}

impl Visits {
    /// Steps per search.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.steps as f64 / self.searches as f64
    }

    fn and(self, other: Self) -> Self {
        Self {
            searches: self.searches + other.searches,
            steps: self.steps + other.steps,
            most: self.most.max(other.most),
            found: self.found + other.found,
        }
    }
}

/// Counts by running the kernel for one node after another.
#[must_use]
pub fn count(nodes: &[Node]) -> Visits {
    let wide: &[WideNode] = bytemuck::cast_slice(nodes);
    let of_node = |v: u32| {
        let params = PrbvhParams { count: 1, ..PrbvhParams::every(1, v, nodes.len() as u32) };
        let mut found = [Move::NONE];
        let mut books = [0; BOOKS_WORDS as usize];
        let mut report = [0; REPORT_WORDS as usize];
        let (books, report) = (AtomicU32::from_mut_slice(&mut books), AtomicU32::from_mut_slice(&mut report));
        search(0, &params, wide, Slot::from_mut_slice(&mut found), books, report);
        let steps = report[MOST_STEPS].load();
        Visits { searches: 1, steps: steps.into(), most: steps, found: report[FOUND].load().into() }
    };
    (1..nodes.len() as u32).into_par_iter().map(of_node).reduce(Visits::default, Visits::and)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{soup, working};
    use prbvh::build::{DeviceTree, sah_binned};
    use prbvh::device::cpu::CpuDevice;
    use prbvh::optimize::{Limits, PrbvhSettings, prbvh};
    use std::ops::ControlFlow;

    #[test]
    fn the_counts_are_those_of_an_iteration() {
        let nodes = sah_binned(&working(&soup(400, 0.1, 5)));
        let visits = count(&nodes);
        let mut device = CpuDevice::new(1).unwrap();
        let tree = DeviceTree::upload(&mut device, &nodes).unwrap();
        let settings = PrbvhSettings::published().with(|s| {
            s.mu = 1;
            s.limits = Limits::iterations(1);
        });
        let outcome = prbvh(&mut device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap();
        let row = outcome.rows[1];
        assert_eq!((visits.searches, visits.found, visits.most), (798, row.found.into(), row.most_steps));
        assert!(visits.mean() > 1.0 && visits.mean() <= f64::from(visits.most), "{visits:?}");
    }
}

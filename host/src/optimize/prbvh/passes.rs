//! Passes: search, lock, check, reinsert, refit. An iteration is one of them, or some of a descent.

use super::super::descent::Descent;
use super::{WorkingSet, sum};
use crate::build::record_refit;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::cost::COST_CHUNK;
use prbvh_kernel::prbvh::PrbvhParams;
use prbvh_kernel::prbvh::decrease::{DECREASE_CHUNK, DecreaseParams};
use prbvh_kernel::status::CANDIDATES;

/// In a descent a row follows after searches of at least this part of the nodes: the cost of the whole tree and a copy of its links take
/// their time.
const SEARCHES_OF_A_ROW: u32 = 16;

/// Tries of each candidate on a list. Among the largest reinsertions every second is in the way of another; all but these are off the list
/// by the second try, which costs next to nothing.
pub(super) const TRIES: u32 = 2;

/// What the passes of an iteration did.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Work {
    pub(super) mu: u32,
    pub(super) searched: u32,
    /// Sum of the half areas of the internal nodes after it.
    pub(super) areas: f64,
    /// Sum of the area decreases of all moves.
    pub(super) decreases: f64,
}

impl WorkingSet<'_> {
    pub(super) fn params(&self, mu: u32, first: u32, floor: f32) -> PrbvhParams {
        PrbvhParams { count: 0, mu, first, nodes: self.node_count, floor }
    }

    /// Makes passes of the descent until they searched enough to be worth a look at the cost, or to the end of the descent. What is recorded
    /// already runs before the first of them; without one it stays recorded.
    pub(super) fn descend(
        &mut self,
        device: &mut dyn Device,
        recording: &mut Recording,
        descent: &mut Descent,
        root: f64,
    ) -> Result<Work, DeviceError> {
        let mut work = Work::default();
        while let Some(pass) = descent.next() {
            let floor = |part: f32| (f64::from(part) * root) as f32;
            if pass.begins_level {
                self.listed = self.list_candidates(device, std::mem::take(recording), floor(pass.floor))?;
            }
            let params = PrbvhParams {
                count: self.listed.saturating_sub(pass.first).div_ceil(pass.mu),
                ..self.params(pass.mu, pass.first, floor(pass.floor))
            };
            if params.count == 0 {
                continue;
            }
            work.mu = pass.mu;
            let ends = descent.is_over() || (work.searched + params.count) >= self.node_count / SEARCHES_OF_A_ROW;
            self.pass(device, std::mem::take(recording), &params, true, ends, &mut work)?;
            if ends {
                return Ok(work);
            }
        }
        // The last passes had no candidates.
        if work.searched > 0 {
            work.areas = self.internal_areas(device)?;
        }
        Ok(work)
    }

    /// Makes the list of all nodes that may gain more than `floor`; returns how many there are.
    fn list_candidates(
        &mut self,
        device: &mut dyn Device,
        mut recording: Recording,
        floor: f32,
    ) -> Result<u32, DeviceError> {
        let Some(candidates) = &self.candidates else { return Ok(0) };
        candidates.record(&mut recording, &self.tree.nodes, self.node_count, floor, &self.report);
        self.submit(device, &recording)?;
        Ok(self.read_report(device)?[CANDIDATES])
    }

    /// Searches, reinserts and refits; adds to `work`, with the areas of the internal nodes if `measures`.
    pub(super) fn pass(
        &mut self,
        device: &mut dyn Device,
        mut recording: Recording,
        params: &PrbvhParams,
        of_list: bool,
        measures: bool,
        work: &mut Work,
    ) -> Result<(), DeviceError> {
        let count = params.count;
        let area_chunks = self.internal.div_ceil(COST_CHUNK);
        if self.arrived != 0 {
            recording.clear("refit", &self.arrivals);
            self.arrived = 0;
        }
        let list = self.candidates.as_ref().filter(|_| of_list).map(|candidates| &candidates.list);
        let mut chunks = 0;
        for _ in 0..if of_list { TRIES } else { 1 } {
            chunks += self.record_reinsertions(&mut recording, params, list, chunks);
        }
        let (nodes, report) = (&self.tree.nodes, &self.report);
        if let Some(dual) = self.dual.as_ref().filter(|_| !of_list) {
            let params =
                PrbvhParams { count: self.internal.saturating_sub(params.first).div_ceil(params.mu), ..*params };
            dual.record(&mut recording, &params, &self.moves, nodes, report);
            chunks += self.record_decreases(&mut recording, params.count, chunks);
            dual.record_reinsert(&mut recording, &params, &self.moves, nodes, report);
            record_refit(&mut recording, self.tree.references, nodes, &self.arrivals);
            self.arrived = 2;
        }
        if measures {
            self.record_area_sum(&mut recording, 0, self.internal, 0);
        }
        self.submit(device, &recording)?;
        let partial = self.read_partial(device, (area_chunks + chunks) as usize)?;
        let (areas, decreases) = partial.split_at(area_chunks as usize);
        if measures {
            work.areas = sum(areas);
        }
        work.decreases += sum(decreases);
        work.searched += count;
        Ok(())
    }

    /// Records search, reinsertion and refit; puts sums of what the reinsertions promise behind `before` others and returns how many there are.
    fn record_reinsertions(
        &self,
        recording: &mut Recording,
        params: &PrbvhParams,
        list: Option<&Buffer>,
        before: u32,
    ) -> u32 {
        let (nodes, found, report) = (&self.tree.nodes, &self.moves.found, &self.report);
        let count = params.count;
        self.moves.record(recording, params, list, nodes, report);
        let sums = self.record_decreases(recording, count, before);
        recording.dispatch("reinsert", Kernel::PrbvhReinsert, count, params, &[found, nodes, report]);
        recording.dispatch("refit", Kernel::PrbvhMarkPaths, count, params, &[found, nodes, &self.arrivals]);
        recording.dispatch("refit", Kernel::PrbvhRefitPaths, count, params, &[found, nodes, &self.arrivals]);
        sums
    }

    /// Sums what `found` reinsertions promise behind `before` other sums of that kind; returns how many sums it makes.
    fn record_decreases(&self, recording: &mut Recording, found: u32, before: u32) -> u32 {
        let count = found.div_ceil(DECREASE_CHUNK);
        let sums = DecreaseParams { count, found, first: self.internal.div_ceil(COST_CHUNK) + before };
        recording.dispatch("cost", Kernel::PrbvhDecrease, count, &sums, &[&self.moves.found, &self.partial]);
        count
    }
}

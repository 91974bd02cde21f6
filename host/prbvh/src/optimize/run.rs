//! A run worst first, of searches one after another.

use super::lists::Lists;
use super::pace::MOST_AT_ONCE;
use super::search::{Next, Rounds, Search};
use super::session::{Observe, Outcome, Session};
use super::{PrbvhSettings, StopReason, TreeAreas};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Recording};

/// A tree that is optimised.
#[derive(Debug)]
pub(super) struct Run<'a> {
    pub(super) session: Session<'a>,
    pub(super) rounds: Rounds,
    pub(super) settings: &'a PrbvhSettings,
    /// What the next submission begins with.
    pub(super) next: Recording,
    working_bytes: u64,
}

impl<'a> Run<'a> {
    /// Measures the tree if nobody has done so, and makes row 0.
    pub(super) fn begin(
        device: &mut dyn Device,
        tree: &'a DeviceTree,
        areas: Option<TreeAreas>,
        settings: &'a PrbvhSettings,
    ) -> Result<Self, DeviceError> {
        let mut session = Session::new(device, tree, tree.references - 1, MOST_AT_ONCE)?;
        let lists = Lists::new(device, &mut session.scratch, session.internal)?;
        let working_bytes = device.memory().bytes;
        let areas = session.begin(device, areas, 1)?;
        let rounds = Rounds::new(lists, areas, tree.references, settings, device);
        Ok(Self { session, rounds, settings, next: Recording::new(), working_bytes })
    }

    /// Rounds until nothing is gained; the reason if that is not why it stops.
    pub(super) fn search(
        &mut self,
        device: &mut dyn Device,
        observe: Observe<'_>,
        search: Search,
    ) -> Result<Option<StopReason>, DeviceError> {
        let Self { session, rounds, settings, next, .. } = self;
        let mut searching = rounds.begin(search, session, settings);
        if session.row().iteration == 0 && observe(session.row(), session.tree, device).is_break() {
            return Ok(Some(StopReason::Cancelled));
        }
        loop {
            if let Some(stop) = session.ended(&settings.limits) {
                return Ok(Some(stop));
            }
            let mut recording = std::mem::take(next);
            rounds.record(&mut searching, session, settings, &mut recording);
            let start = session.clock();
            let timings = device.run(&recording)?;
            match rounds.note(&mut searching, session, device, (start, &timings), observe)? {
                Next::GoesOn => {}
                Next::Settled => return Ok(None),
                Next::Cancelled => return Ok(Some(StopReason::Cancelled)),
            }
        }
    }

    /// Brings the best tree back and gives the memory back.
    pub(super) fn finish(mut self, device: &mut dyn Device, stop: StopReason) -> Result<Outcome, DeviceError> {
        if self.rounds.is_worse(&self.session) {
            self.session.record_restore(&mut self.next);
        }
        if !self.next.commands().is_empty() {
            self.session.submit(device, &self.next)?;
        }
        Ok(self.session.finish(device, stop, self.working_bytes))
    }
}

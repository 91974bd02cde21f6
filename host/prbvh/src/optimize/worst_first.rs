//! Worst first: rounds of dual moves of the nodes that look worst, few at first and then ever more ([`prbvh_kernel::prbvh::worst`]); where they settle, new
//! [tops](super::new_top); the broad tail at the end.

use super::lists::Lists;
use super::new_top;
use super::pace::MOST_AT_ONCE;
use super::search::{Next, Rounds, Search, of};
use super::session::{Observe, Outcome, Session};
use super::{PrbvhSettings, StopReason, TreeAreas};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Recording};
use prbvh_kernel::prbvh::worst::books::BEST;

/// As many times the gain that counts after new tops counts before them.
const SETTLES_BEFORE: f64 = 10.0;

pub(super) fn run(
    device: &mut dyn Device,
    tree: &DeviceTree,
    areas: Option<TreeAreas>,
    settings: &PrbvhSettings,
    observe: Observe<'_>,
) -> Result<Outcome, DeviceError> {
    let mut session = Session::new(device, tree, tree.references - 1, MOST_AT_ONCE)?;
    let lists = Lists::new(device, &mut session.scratch, session.internal)?;
    let working_bytes = device.memory().bytes;
    let areas = session.begin(device, areas, 1)?;
    let rounds = Rounds::new(lists, areas, tree.references, settings, device);
    let mut run = Run { rounds, settings, next: Recording::new() };
    let stop = run.run(&mut session, device, observe)?;
    if run.rounds.is_worse(&session) {
        session.record_restore(&mut run.next);
    }
    if !run.next.commands().is_empty() {
        session.submit(device, &run.next)?;
    }
    Ok(session.finish(device, stop, working_bytes))
}

struct Run<'a> {
    rounds: Rounds,
    settings: &'a PrbvhSettings,
    /// What the next submission begins with.
    next: Recording,
}

impl Run<'_> {
    fn run(
        &mut self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        observe: Observe<'_>,
    ) -> Result<StopReason, DeviceError> {
        let settings = &self.settings.worst_first;
        let internal = session.internal;
        let initial_cost = self.rounds.ledger.best_cost;
        let tops = settings.tops(internal);
        let worst = Search::worst(settings, internal);
        // What a new top will change need not be perfect.
        let before = if tops.is_empty() { worst } else { Search { settles: SETTLES_BEFORE * worst.settles, ..worst } };
        if let Some(stop) = self.search(session, device, observe, before)? {
            return Ok(stop);
        }
        for &top in &tops {
            if let Some(stop) = self.renew_top(session, device, observe, top)? {
                return Ok(stop);
            }
        }
        // Where nothing was gained so far, nothing will be.
        if !tops.is_empty()
            && self.rounds.ledger.best_cost < initial_cost
            && let Some(stop) = self.search(session, device, observe, worst)?
        {
            return Ok(stop);
        }
        if let Some(tail) = Search::tail(settings, internal)
            && let Some(stop) = self.search(session, device, observe, tail)?
        {
            return Ok(stop);
        }
        Ok(StopReason::Converged)
    }

    /// Builds a top of about so many nodes anew: an iteration in which nothing is searched. It begins with the best tree, and ends with the best tree.
    fn renew_top(
        &mut self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        observe: Observe<'_>,
        nodes: u32,
    ) -> Result<Option<StopReason>, DeviceError> {
        if let Some(stop) = session.ended(&self.settings.limits) {
            return Ok(Some(stop));
        }
        let mut recording = std::mem::take(&mut self.next);
        if self.rounds.is_worse(session) {
            session.record_restore(&mut recording);
        }
        let params = self.rounds.params(session, self.settings).wanting(0, nodes);
        let renewed = new_top::renew(session, device, recording, (&self.rounds.lists, &params), self.settings)?;
        if let Some(grafts) = &renewed.grafts {
            session.record_graft(&mut self.next, grafts);
        }
        self.rounds.lists.record_page(of(session), &mut self.next, &params, BEST);
        if self.settings.news.is_zero() {
            // The observer wants the tree of the row.
            session.submit(device, &std::mem::take(&mut self.next))?;
        }

        let cost = self.rounds.ledger.note_beside(renewed.decrease);
        session.push_new_top(cost, renewed.visits);
        let goes_on = observe(session.row(), session.tree, device).is_continue();
        Ok((!goes_on).then_some(StopReason::Cancelled))
    }

    /// Rounds until nothing is gained; the reason if that is not why it stops.
    fn search(
        &mut self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        observe: Observe<'_>,
        search: Search,
    ) -> Result<Option<StopReason>, DeviceError> {
        let mut searching = self.rounds.begin(search, session, self.settings);
        if session.row().iteration == 0 && observe(session.row(), session.tree, device).is_break() {
            return Ok(Some(StopReason::Cancelled));
        }
        loop {
            if let Some(stop) = session.ended(&self.settings.limits) {
                return Ok(Some(stop));
            }
            let mut recording = std::mem::take(&mut self.next);
            self.rounds.record(&mut searching, session, self.settings, &mut recording, 0);
            let start = session.clock();
            let timings = device.run(&recording)?;
            match self.rounds.note(&mut searching, session, device, (start, &timings), observe)? {
                Next::GoesOn => {}
                Next::Settled => return Ok(None),
                Next::Cancelled => return Ok(Some(StopReason::Cancelled)),
            }
        }
    }
}

//! Small trees, each optimised worst first as if alone, side by side in the same submissions.

use super::lists::Lists;
use super::pace::MOST_AT_ONCE;
use super::search::{Next, Rounds, Search, Searching};
use super::session::{Clock, Session};
use super::{PrbvhSettings, StopReason};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Recording, Timing};
use prbvh_kernel::node::Node;
use std::ops::ControlFlow;

/// What became of a tree.
#[derive(Debug)]
pub(super) struct Optimised {
    /// The best tree.
    pub(super) nodes: Vec<Node>,
    /// Nodes that the searches looked at.
    pub(super) visits: u32,
    /// Time of every command.
    pub(super) timings: Vec<Timing>,
}

/// One of the trees.
#[derive(Debug)]
struct One<'a> {
    session: Session<'a>,
    rounds: Rounds,
    /// Searches that come after this one.
    left: std::vec::IntoIter<Search>,
    searching: Option<Searching>,
}

/// Optimises trees on the device, without new tops.
pub(super) fn optimise(
    device: &mut dyn Device,
    trees: &[DeviceTree],
    settings: &PrbvhSettings,
) -> Result<Vec<Optimised>, DeviceError> {
    let mut all = begin(device, trees, settings)?;
    loop {
        let mut recording = Recording::new();
        let mut parts = Vec::new();
        for (k, one) in all.iter_mut().enumerate() {
            let from = recording.commands().len();
            if one.record(settings, &mut recording) {
                parts.push((k, one.session.clock(), from..recording.commands().len()));
            }
        }
        if parts.is_empty() {
            break;
        }
        let timings = device.run(&recording)?;
        for (k, start, commands) in parts {
            all[k].note(device, (start, timings.get(commands).unwrap_or_default()), settings)?;
        }
    }

    let mut recording = Recording::new();
    for one in &mut all {
        if one.rounds.is_worse(&one.session) {
            one.session.record_restore(&mut recording);
        }
        let nodes = &one.session.tree.nodes;
        recording.fetch("read top", nodes, nodes.bytes() as usize);
    }
    let timings = device.run(&recording)?;
    let mut done = Vec::new();
    for one in all {
        let nodes = one.session.tree.download(device)?;
        let visits = one.session.rows.iter().fold(0u32, |visits, row| visits.saturating_add(row.visits));
        let outcome = one.session.finish(device, StopReason::Converged, 0);
        done.push(Optimised { nodes, visits, timings: outcome.timings });
    }
    if let Some(first) = done.first_mut() {
        first.timings.extend(timings);
    }
    Ok(done)
}

/// Measures the trees.
fn begin<'a>(
    device: &mut dyn Device,
    trees: &'a [DeviceTree],
    settings: &PrbvhSettings,
) -> Result<Vec<One<'a>>, DeviceError> {
    let mut sessions = Vec::new();
    let mut recording = Recording::new();
    for tree in trees {
        let mut session = Session::new(device, tree, tree.references - 1, MOST_AT_ONCE)?;
        let from = recording.commands().len();
        session.record_begin(&mut recording);
        sessions.push((session, from..recording.commands().len()));
    }
    let timings = device.run(&recording)?;
    let mut all = Vec::new();
    for (mut session, commands) in sessions {
        session.take_note(timings.get(commands).unwrap_or_default().to_vec());
        let lists = Lists::new(device, &mut session.scratch, session.internal)?;
        let areas = session.begin_measured(device, 1)?;
        let rounds = Rounds::new(lists, areas, session.tree.references, settings, device);
        let worst = Search::worst(&settings.worst_first, session.internal);
        let tail = Search::tail(&settings.worst_first, session.internal);
        let searches: Vec<Search> = std::iter::once(worst).chain(tail).collect();
        let mut left = searches.into_iter();
        let searching = left.next().map(|search| rounds.begin(search, &session, settings));
        all.push(One { session, rounds, left, searching });
    }
    Ok(all)
}

impl One<'_> {
    /// Records the next rounds; returns whether there are any.
    fn record(&mut self, settings: &PrbvhSettings, recording: &mut Recording) -> bool {
        if self.session.ended(&settings.limits).is_some() {
            self.searching = None;
        }
        let Some(searching) = &mut self.searching else { return false };
        self.rounds.record(searching, &self.session, settings, recording);
        true
    }

    /// Takes note of them.
    fn note(
        &mut self,
        device: &mut dyn Device,
        times: (Clock, &[Timing]),
        settings: &PrbvhSettings,
    ) -> Result<(), DeviceError> {
        let Some(searching) = &mut self.searching else { return Ok(()) };
        let observe = &mut |_: &_, _: &_, _: &mut dyn Device| ControlFlow::Continue(());
        let next = self.rounds.note(searching, &mut self.session, device, times, observe)?;
        if next != Next::GoesOn {
            self.searching = self.left.next().map(|search| self.rounds.begin(search, &self.session, settings));
        }
        Ok(())
    }
}

//! Small trees, each optimised worst first as if alone, side by side in the same submissions.

use super::beginnings::Beginning;
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
    /// A search that comes after this one.
    tail: Option<Search>,
    work: Work,
}

/// What there is to do next.
#[derive(Debug)]
enum Work {
    Search(Searching),
    /// To bring back the best tree, which is not the last.
    Restore,
    /// Nothing: this is the best tree.
    Done(Vec<Node>),
}

/// Optimises trees on the device, without new tops.
pub(super) fn optimise(
    device: &mut dyn Device,
    beginnings: &[Beginning],
    settings: &PrbvhSettings,
) -> Result<Vec<Optimised>, DeviceError> {
    let trees = beginnings.iter().map(|beginning| DeviceTree::upload(device, &beginning.nodes));
    let trees = trees.collect::<Result<Vec<_>, _>>()?;
    let mut all = Vec::new();
    for (tree, Beginning { areas, .. }) in trees.iter().zip(beginnings) {
        let mut session = Session::new(device, tree, tree.references - 1, MOST_AT_ONCE)?;
        let lists = Lists::new(device, &mut session.scratch, session.internal)?;
        let areas = session.begin(device, Some(*areas), 1)?;
        all.push(One::new(session, Rounds::new(lists, areas, tree.references, settings, device), settings));
    }
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
    let done = all.into_iter().map(|one| one.finish(device)).collect();
    for tree in trees {
        tree.free(device);
    }
    Ok(done)
}

impl<'a> One<'a> {
    fn new(session: Session<'a>, mut rounds: Rounds, settings: &PrbvhSettings) -> Self {
        let worst = Search::worst(&settings.worst_first, session.internal);
        let tail = Search::tail(&settings.worst_first, session.internal);
        let work = Work::Search(rounds.begin(worst, &session, settings));
        Self { session, rounds, tail, work }
    }

    /// Records what is next; returns whether there is anything.
    fn record(&mut self, settings: &PrbvhSettings, recording: &mut Recording) -> bool {
        let Self { session, rounds, tail, work } = self;
        let nodes = &session.tree.nodes;
        if matches!(work, Work::Search(_)) && session.ended(&settings.limits).is_some() {
            *work = Work::Restore;
        }
        match work {
            Work::Search(searching) => {
                let begins = recording.commands().len();
                rounds.record(searching, session, settings, recording, begins);
                if tail.is_some() {
                    return true;
                }
            }
            Work::Restore if rounds.is_worse(session) => session.record_restore(recording),
            Work::Restore => {}
            Work::Done(_) => return false,
        }
        // These may be the last rounds: to bring the tree along costs less than another submission.
        recording.fetch("read top", nodes, nodes.bytes() as usize);
        true
    }

    /// Takes note of it.
    fn note(
        &mut self,
        device: &mut dyn Device,
        times: (Clock, &[Timing]),
        settings: &PrbvhSettings,
    ) -> Result<(), DeviceError> {
        let Self { session, rounds, tail, work } = self;
        match work {
            Work::Search(searching) => {
                let observe = &mut |_: &_, _: &_, _: &mut dyn Device| ControlFlow::Continue(());
                if rounds.note(searching, session, device, times, observe)? == Next::GoesOn {
                    return Ok(());
                }
                if let Some(search) = tail.take() {
                    *work = Work::Search(rounds.begin(search, session, settings));
                    return Ok(());
                }
                if rounds.is_worse(session) {
                    *work = Work::Restore;
                    return Ok(());
                }
            }
            Work::Restore => session.take_note(times.1.to_vec()),
            Work::Done(_) => return Ok(()),
        }
        *work = Work::Done(session.tree.download(device)?);
        Ok(())
    }

    fn finish(self, device: &mut dyn Device) -> Optimised {
        let visits = self.session.rows.iter().fold(0u32, |visits, row| visits.saturating_add(row.visits));
        let outcome = self.session.finish(device, StopReason::Converged, 0);
        let nodes = match self.work {
            Work::Done(nodes) => nodes,
            Work::Search(_) | Work::Restore => Vec::new(),
        };
        Optimised { nodes, visits, timings: outcome.timings }
    }
}

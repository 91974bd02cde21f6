//! The published order: every µ-th node in turn, single moves (Meister & Bittner 2018, §4.4).

use super::schedule::Schedule;
use super::session::{Observe, Outcome, Report, Session, no_fault};
use super::{PrbvhSettings, StopReason, Strategy, TreeAreas};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BEGIN, BEST};
use prbvh_kernel::prbvh::{CONSERVATIVE, PrbvhParams};
use prbvh_kernel::status::{FAULTS, SEARCHED};
use prbvh_kernel::sum::scale_of;

pub(super) fn run(
    device: &mut dyn Device,
    tree: &DeviceTree,
    areas: Option<TreeAreas>,
    settings: &PrbvhSettings,
    observe: Observe<'_>,
) -> Result<Outcome, DeviceError> {
    let mut session = Session::new(device, tree, DeviceTree::node_count(tree.references), 1)?;
    let working_bytes = device.memory().bytes;
    let areas = session.begin(device, areas, settings.mu.max(1))?;
    let scale = scale_of(areas.root);
    let mut schedule = Schedule::new(settings, session.row().cost);
    let mut best = session.row().cost;
    let mut is_best = true;
    let mut epoch = 0;
    let stop = loop {
        let done = session.row().iteration;
        if observe(session.row(), tree, device).is_break() {
            break StopReason::Cancelled;
        }
        if done > 0
            && let Some(stop) = schedule.note(session.row())
        {
            break stop;
        }
        if let Some(stop) = schedule.limit(done, session.elapsed()) {
            break stop;
        }
        let mut recording = Recording::new();
        recording.clear("search", &session.moves.report);
        if is_best {
            epoch += 1;
            record_best(&session, &mut recording, epoch);
        }
        let mu = schedule.mu();
        let params = PrbvhParams {
            flags: if settings.strategy == Strategy::Conservative { CONSERVATIVE } else { 0 },
            scale,
            ..PrbvhParams::every(mu, done % mu, session.node_count)
        };
        record_iteration(&session, &mut recording, &params);
        session.submit(device, &recording)?;
        let internal = session.measure.internal_areas(device)?;
        let mut report: Report = session.report(device)?;
        no_fault(device, report[FAULTS])?;
        report[SEARCHED] = params.count;
        let cost = TreeAreas { internal, ..areas }.cost(tree.references);
        is_best = cost < best;
        if is_best {
            best = cost;
        }
        let clock = session.clock();
        session.push_row(&report, mu, cost, &areas, scale, clock);
    };
    // Without an iteration the tree is as it was, and none is kept.
    if session.rows.len() > 1 {
        settle(&mut session, device, is_best, epoch)?;
    }
    Ok(session.finish(device, stop, working_bytes))
}

/// Records that the tree as it is now is the best one.
fn record_best(session: &Session<'_>, recording: &mut Recording, epoch: u32) {
    let page = if epoch == 1 { BEGIN } else { BEST };
    // No fringe: a tree without places has none.
    let params = RoundParams { count: 1, nodes: 0, root_area: 0.0, scale: 0.0, row: 0, page, wanted: 0, pool: 0 };
    session.moves.record_page(recording, "keep best", &params, &session.measure.arrivals);
}

/// Records search, lock, check, reinsertion, refit and the sum of the areas.
fn record_iteration(session: &Session<'_>, recording: &mut Recording, params: &PrbvhParams) {
    let (nodes, ways) = (&session.tree.nodes, &session.measure.arrivals);
    let moves = &session.moves;
    moves.clear_locks(recording);
    moves.dispatch(recording, "search", Kernel::PrbvhSearch, params, &[nodes, &moves.found, &moves.report]);
    moves.record_lock(recording, params);
    moves.record_reinsert(recording, params);
    moves.dispatch(recording, "refit", Kernel::PrbvhMark, params, &[&moves.found, nodes, ways]);
    moves.dispatch(recording, "refit", Kernel::PrbvhRefit, params, &[&moves.found, nodes, ways]);
    session.measure.record_internal(recording);
}

/// Leaves the best tree, with all boxes made anew.
fn settle(session: &mut Session<'_>, device: &mut dyn Device, is_best: bool, epoch: u32) -> Result<(), DeviceError> {
    if !is_best {
        return session.restore(device, epoch);
    }
    let mut recording = Recording::new();
    recording.clear("refit", &session.moves.report);
    session.measure.record_refit(&mut recording);
    session.measure.record_internal(&mut recording);
    session.submit(device, &recording)?;
    let report = session.report(device)?;
    no_fault(device, report[FAULTS])
}

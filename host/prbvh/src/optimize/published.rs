//! The published order: every µ-th node in turn, single moves (Meister & Bittner 2018, §4.4).

use super::ledger::Ledger;
use super::pace::{MOST_AT_ONCE, Pace};
use super::session::{Observe, Outcome, Session};
use super::{Epsilon, PrbvhSettings, StopReason, Strategy, TreeAreas};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BEGIN, CLOSE, RESUME};
use prbvh_kernel::prbvh::worst::verdict::{JUDGES, PUBLISHED};
use prbvh_kernel::prbvh::{CONSERVATIVE, PrbvhParams};
use prbvh_kernel::status::{GOES_ON, REPORT_WORDS, SETTLED};

pub(super) fn run(
    device: &mut dyn Device,
    tree: &DeviceTree,
    areas: Option<TreeAreas>,
    settings: &PrbvhSettings,
    observe: Observe<'_>,
) -> Result<Outcome, DeviceError> {
    let mut session = Session::new(device, tree, DeviceTree::node_count(tree.references), MOST_AT_ONCE)?;
    let working_bytes = device.memory().bytes;
    let areas = session.begin(device, areas, settings.mu.max(1))?;
    let mut ledger = Ledger::new(areas, tree.references);
    let stop = iterate(&mut session, device, &mut ledger, settings, observe)?;
    // Without an iteration the tree is as it was, and none is kept.
    if session.rows.len() > 1 {
        if session.row().cost <= ledger.best_cost {
            session.refit_all(device)?;
        } else {
            session.restore_best(device)?;
        }
    }
    Ok(session.finish(device, stop, working_bytes))
}

/// Iterations until the rule or a limit ends them.
fn iterate(
    session: &mut Session<'_>,
    device: &mut dyn Device,
    ledger: &mut Ledger,
    settings: &PrbvhSettings,
    observe: Observe<'_>,
) -> Result<StopReason, DeviceError> {
    let epsilon = match settings.epsilon {
        Epsilon::Relative(part) => part * ledger.best_cost,
        Epsilon::Absolute(change) => change,
    };
    let rule = RoundParams {
        nodes: session.node_count,
        mu: settings.mu.max(1),
        flags: JUDGES | PUBLISHED,
        patience: settings.patience.max(1),
        epsilon: ledger.units(epsilon),
        ..ledger.params(&settings.limits)
    };
    let flags = if settings.strategy == Strategy::Conservative { CONSERVATIVE } else { 0 };
    let (count, scale) = (session.node_count, ledger.scale);
    let round = PrbvhParams { count, mu: 0, first: 0, nodes: count, flags, row: 0, scale };
    let mut pace = Pace::new(settings.news, device.info());
    let mut page = Some(BEGIN);
    if observe(session.row(), session.tree, device).is_break() {
        return Ok(StopReason::Cancelled);
    }
    loop {
        if let Some(stop) = session.ended(&settings.limits) {
            return Ok(stop);
        }
        let done = session.row().iteration;
        let searched = f64::from(session.node_count) / f64::from(session.row().mu);
        let rounds = pace.rounds(std::iter::repeat((searched, true)), &settings.limits, done, session.elapsed());

        let mut recording = Recording::new();
        recording.clear("search", &session.moves.report);
        if let Some(page) = page {
            record_page(session, &mut recording, &RoundParams { page, ..rule });
        }
        let mut ends = Vec::new();
        for row in (0..rounds).map(|k| k * REPORT_WORDS) {
            record_iteration(session, &mut recording, &PrbvhParams { row, ..round });
            record_page(session, &mut recording, &RoundParams { page: CLOSE, row, ..rule });
            ends.push(recording.commands().len());
        }
        let made = session.run_rounds(device, recording, &ends, (ledger, &mut pace), observe)?;
        if made.flow.is_break() {
            return Ok(StopReason::Cancelled);
        }
        if made.verdict == SETTLED {
            return Ok(StopReason::Converged);
        }
        page = (made.verdict != GOES_ON).then_some(RESUME);
    }
}

/// No fringe: a tree without places has none.
fn record_page(session: &Session<'_>, recording: &mut Recording, params: &RoundParams) {
    session.moves.record_page(recording, "keep best", params, &session.measure.arrivals);
}

/// Records search, lock, check, reinsertion and refit.
fn record_iteration(session: &Session<'_>, recording: &mut Recording, params: &PrbvhParams) {
    let (nodes, ways) = (&session.tree.nodes, &session.measure.arrivals);
    let moves = &session.moves;
    let (found, books, report) = (&moves.found, &moves.books, &moves.report);
    moves.clear_locks(recording);
    moves.dispatch(recording, "search", Kernel::PrbvhSearch, params, &[nodes, found, books, report]);
    moves.record_lock(recording, params);
    moves.record_reinsert(recording, params);
    moves.dispatch(recording, "refit", Kernel::PrbvhMark, params, &[found, nodes, ways, report]);
    moves.dispatch(recording, "refit", Kernel::PrbvhRefit, params, &[found, nodes, ways, report]);
}

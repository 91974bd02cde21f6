//! Worst first: rounds of dual moves of the nodes that look worst, few at first and then ever more ([`prbvh_kernel::prbvh::worst`]); where they settle, new
//! [tops](super::new_top); the broad tail at the end.

use super::new_top;
use super::run::Run;
use super::search::{Search, of};
use super::session::{Observe, Outcome};
use super::{PrbvhSettings, StopReason, TreeAreas};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError};
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
    let mut run = Run::begin(device, tree, areas, settings)?;
    let stop = searches(&mut run, device, observe)?;
    run.finish(device, stop)
}

fn searches(run: &mut Run<'_>, device: &mut dyn Device, observe: Observe<'_>) -> Result<StopReason, DeviceError> {
    let settings = &run.settings.worst_first;
    let internal = run.session.internal;
    let initial_cost = run.rounds.ledger.best_cost;
    let tops = settings.tops(internal);
    let worst = Search::worst(settings, internal);
    // What a new top will change need not be perfect.
    let before = if tops.is_empty() { worst } else { Search { settles: SETTLES_BEFORE * worst.settles, ..worst } };
    if let Some(stop) = run.search(device, observe, before)? {
        return Ok(stop);
    }
    for &top in &tops {
        if let Some(stop) = renew_top(run, device, observe, top)? {
            return Ok(stop);
        }
    }
    // Where nothing was gained so far, nothing will be.
    if !tops.is_empty()
        && run.rounds.ledger.best_cost < initial_cost
        && let Some(stop) = run.search(device, observe, worst)?
    {
        return Ok(stop);
    }
    if let Some(tail) = Search::tail(settings, internal)
        && let Some(stop) = run.search(device, observe, tail)?
    {
        return Ok(stop);
    }
    Ok(StopReason::Converged)
}

/// Builds a top of about so many nodes anew: an iteration in which nothing is searched. It begins with the best tree, and ends with the best tree.
fn renew_top(
    run: &mut Run<'_>,
    device: &mut dyn Device,
    observe: Observe<'_>,
    nodes: u32,
) -> Result<Option<StopReason>, DeviceError> {
    let Run { session, rounds, settings, next, .. } = run;
    if let Some(stop) = session.ended(&settings.limits) {
        return Ok(Some(stop));
    }
    let mut recording = std::mem::take(next);
    if rounds.is_worse(session) {
        session.record_restore(&mut recording);
    }
    let params = rounds.params(session, settings).wanting(0, nodes);
    let renewed = new_top::renew(session, device, recording, (&rounds.lists, &params), settings)?;
    if let Some(grafts) = &renewed.grafts {
        session.record_graft(next, grafts);
    }
    rounds.lists.record_page(of(session), next, &params, BEST);
    if settings.news.is_zero() {
        // The observer wants the tree of the row.
        session.submit(device, &std::mem::take(next))?;
    }

    let cost = rounds.ledger.note_beside(renewed.decrease);
    session.push_new_top(cost, renewed.visits);
    let goes_on = observe(session.row(), session.tree, device).is_continue();
    Ok((!goes_on).then_some(StopReason::Cancelled))
}

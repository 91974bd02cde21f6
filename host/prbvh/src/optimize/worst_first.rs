//! Worst first: rounds of dual moves of the nodes that look worst, few at first and then ever more ([`prbvh_kernel::prbvh::worst`]); where they settle, new
//! [tops](super::new_top); the broad tail at the end.

use super::new_top;
use super::session::{Observe, Outcome, Session, no_fault};
use super::{Limits, PrbvhSettings, StopReason, TreeAreas, WorstFirst};
use crate::build::DeviceTree;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::dual::search::{DualParams, TO_THE_ROOT};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{
    BEGIN, BEST, CLOSE, EPOCH, LIST, MOST_STAGES, OVER_FRINGE, OVER_LIST, OVER_POOL, WORST,
};
use prbvh_kernel::prbvh::{DUAL, PrbvhParams, ROUNDS};
use prbvh_kernel::status::{FAULTS, FRINGE, GREW, REPORT_WORDS, SEARCHED, SHRUNK, WAITING};
use prbvh_kernel::sum::{scale_of, to_f64};

/// Stages that unfold before the first round: nodes of a sixty-fourth of the root's area.
const FIRST_STAGES: u32 = 4;
/// As many times the nodes of a round should be in the pool: to look at a key costs little beside a search.
const POOL: u32 = 16;
/// Rounds of one submission: the first ones are short, and the host would take as long as they.
const AT_ONCE: [u32; 4] = [6, 4, 3, 2];
const MOST_AT_ONCE: u32 = AT_ONCE[0];
/// As many times the gain that counts after new tops counts before them.
const SETTLES_BEFORE: f64 = 10.0;
/// A part of the nodes that is so small that no round of a submission is the last.
const FEW_OF: f64 = 256.0;

pub(super) fn run(
    device: &mut dyn Device,
    tree: &DeviceTree,
    areas: Option<TreeAreas>,
    settings: &PrbvhSettings,
    observe: Observe<'_>,
) -> Result<Outcome, DeviceError> {
    let mut session = Session::new(device, tree, tree.references - 1, MOST_AT_ONCE)?;
    let lists = Lists::new(device, &mut session)?;
    let working_bytes = device.memory().bytes;
    let areas = session.begin(device, areas, 1)?;
    let best_cost = session.row().cost;
    let mut rounds = Rounds { lists, areas, scale: scale_of(areas.root), lost: 0.0, most_lost: 0.0, best_cost };
    let stop = rounds.run(&mut session, device, settings, observe)?;
    rounds.restore_if_worse(&mut session, device)?;
    Ok(session.finish(device, stop, working_bytes))
}

/// Buffers of the order.
#[derive(Debug)]
struct Lists {
    keys: Buffer,
    pool: Buffer,
    fringe: Buffer,
    list: Buffer,
}

impl Lists {
    fn new(device: &mut dyn Device, session: &mut Session<'_>) -> Result<Self, DeviceError> {
        let places = session.internal.max(1) as usize;
        let mut buffer = |label, length| session.scratch.allocate(device, label, length, 4);
        Ok(Self {
            keys: buffer("keys", places)?,
            pool: buffer("pool", 2 * places)?,
            fringe: buffer("fringe", 2 * places)?,
            list: buffer("list", places)?,
        })
    }
}

/// How a part of the run searches.
#[derive(Clone, Copy, Debug)]
struct Search {
    /// Nodes of the first round; each has more by the growth, up to the most.
    first: f64,
    most: f64,
    both_orders: bool,
    climb: u32,
    slack: f32,
    /// As [`WorstFirst::settles`].
    settles: f64,
}

#[derive(Debug)]
struct Rounds {
    lists: Lists,
    areas: TreeAreas,
    scale: f32,
    /// Area that the tree has lost so far.
    lost: f64,
    /// The same of the best tree, and its cost.
    most_lost: f64,
    best_cost: f64,
}

impl Rounds {
    fn run(
        &mut self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        settings: &PrbvhSettings,
        observe: Observe<'_>,
    ) -> Result<StopReason, DeviceError> {
        let WorstFirst { first, most_part, tail_part, climb, slack, .. } = settings.worst_first;
        let internal = session.internal;
        let part = |part: f64| (part * f64::from(internal)).max(f64::from(first));
        let initial_cost = self.best_cost;
        let tops = settings.worst_first.tops(internal);
        let settles = settings.worst_first.settles;
        let worst = Search {
            first: first.into(),
            most: part(most_part),
            both_orders: false,
            climb: climb.min(TO_THE_ROOT),
            slack,
            settles,
        };
        // What a new top will change need not be perfect.
        let before = Search { settles: if tops.is_empty() { settles } else { SETTLES_BEFORE * settles }, ..worst };
        if let Some(stop) = self.search(session, device, settings, observe, before)? {
            return Ok(stop);
        }
        for &top in &tops {
            if let Some(stop) = self.renew_top(session, device, settings, observe, top)? {
                return Ok(stop);
            }
        }
        // Where nothing was gained so far, nothing will be.
        if !tops.is_empty()
            && self.best_cost < initial_cost
            && let Some(stop) = self.search(session, device, settings, observe, worst)?
        {
            return Ok(stop);
        }
        if tail_part > 0.0 {
            let most = part(tail_part);
            let all = Search { first: most, most, both_orders: true, climb: TO_THE_ROOT, slack: 0.0, settles };
            if let Some(stop) = self.search(session, device, settings, observe, all)? {
                return Ok(stop);
            }
        }
        Ok(StopReason::Converged)
    }

    /// Why there is no other iteration, if there is none.
    fn ended(session: &Session<'_>, limits: &Limits) -> Option<StopReason> {
        if limits.is_target(session.row().cost) {
            return Some(StopReason::Target);
        }
        limits.used_up(session.row().iteration, session.elapsed())
    }

    /// Builds a top of about so many nodes anew: an iteration in which nothing is searched. It begins with the best tree, and ends with the best tree.
    fn renew_top(
        &mut self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        settings: &PrbvhSettings,
        observe: Observe<'_>,
        nodes: u32,
    ) -> Result<Option<StopReason>, DeviceError> {
        if let Some(stop) = Self::ended(session, &settings.limits) {
            return Ok(Some(stop));
        }
        self.restore_if_worse(session, device)?;
        let params = RoundParams { pool: nodes, ..self.params(session, 0.0, 0.0, 0) };
        let mut recording = Recording::new();
        recording.clear("select", &session.moves.report);
        self.record_begin(session, &mut recording, &params, true, MOST_STAGES + 1);
        session.submit(device, &recording)?;
        let renewed = new_top::renew(session, device, &self.lists.keys, settings, run)?;
        let mut recording = Recording::new();
        self.page(session, &mut recording, &params, BEST);
        session.submit(device, &recording)?;

        self.lost = self.most_lost + renewed.decrease;
        let cost = self.cost(session);
        session.push_new_top(cost, renewed.visits);
        self.note_best(cost);
        let goes_on = observe(session.row(), session.tree, device).is_continue();
        Ok((!goes_on).then_some(StopReason::Cancelled))
    }

    /// Of the tree as it is now.
    fn cost(&self, session: &Session<'_>) -> f64 {
        let areas = TreeAreas { internal: self.areas.internal - self.lost, ..self.areas };
        areas.cost(session.tree.references)
    }

    fn note_best(&mut self, cost: f64) {
        if cost < self.best_cost {
            self.best_cost = cost;
            self.most_lost = self.lost;
        }
    }

    /// The last tree may be worse than one before it.
    fn restore_if_worse(&self, session: &mut Session<'_>, device: &mut dyn Device) -> Result<(), DeviceError> {
        // Written so that a NaN is worse.
        let is_best = session.rows.len() == 1 || session.row().cost <= self.best_cost;
        if is_best { Ok(()) } else { self.restore(session, device) }
    }

    /// Brings the best tree back.
    fn restore(&self, session: &mut Session<'_>, device: &mut dyn Device) -> Result<(), DeviceError> {
        let mut words = [0u32; EPOCH + 1];
        device.download(&session.moves.books, bytemuck::cast_slice_mut(&mut words))?;
        session.restore(device, words[EPOCH])
    }

    /// Rounds until nothing is gained; the reason if that is not why it stops.
    fn search(
        &mut self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        settings: &PrbvhSettings,
        observe: Observe<'_>,
        search: Search,
    ) -> Result<Option<StopReason>, DeviceError> {
        let WorstFirst { growth, patience, .. } = settings.worst_first;
        let patience = patience.max(1);
        let mut wanted = search.first;
        let mut idle = 0;
        let mut settled_at = self.best_cost;
        // What is decided between submissions is decided after the same rounds if each is one by itself.
        let (mut batches, mut left, mut batch_found) = (0, 0, false);
        let mut found_nothing = false;
        let begins_at = session.row().iteration;
        if begins_at == 0 && observe(session.row(), session.tree, device).is_break() {
            return Ok(Some(StopReason::Cancelled));
        }
        loop {
            let done = session.row().iteration;
            if let Some(stop) = Self::ended(session, &settings.limits) {
                return Ok(Some(stop));
            }
            // Whoever asks for an early end does not want a round more than that takes.
            let Limits { max_time, target_cost, .. } = settings.limits;
            let row_by_row = settings.worst_first.row_by_row || max_time.is_some() || target_cost.is_some();
            if left == 0 {
                let is_small = f64::from(session.internal) < FEW_OF * wanted;
                left = if is_small || found_nothing { 1 } else { AT_ONCE.get(batches).copied().unwrap_or(1) };
                batches += 1;
                batch_found = false;
            }
            let at_once = if row_by_row { 1 } else { left.min(settings.limits.max_iterations - done) };
            left -= at_once;
            let mut recording = Recording::new();
            recording.clear("select", &session.moves.report);
            let mut ends = Vec::new();
            for k in 0..at_once {
                let next = (wanted * growth).min(search.most).max(wanted);
                let params = self.params(session, wanted, next, k);
                if done == begins_at && k == 0 {
                    self.record_begin(session, &mut recording, &params, done > 0, FIRST_STAGES);
                }
                self.record_round(session, &mut recording, &params, &search, settings.worst_first.lock_rounds);
                ends.push(recording.commands().len());
                wanted = next;
            }
            let reports = session.submit_rows(device, &recording, &ends)?;
            let before = session.rows.len();
            for (report, clock) in reports {
                no_fault(device, report[FAULTS])?;
                let change = |word| to_f64(report[word], report[word + 1], self.scale);
                self.lost += change(SHRUNK) - change(GREW);
                let cost = self.cost(session);
                session.push_row(&report, 1, cost, &self.areas, self.scale, clock);
                self.note_best(cost);
                // A round of few nodes may gain nothing, and the next one much; unless there are no more.
                let is_broad = f64::from(report[SEARCHED]) >= 0.5 * search.most || report[FRINGE] == 0;
                if cost < settled_at * (1.0 - search.settles) {
                    settled_at = cost;
                    idle = 0;
                } else if is_broad && report[SEARCHED] > 0 {
                    idle += 1;
                }
                if report[SEARCHED] + report[WAITING] + report[FRINGE] == 0 {
                    idle = patience;
                }
            }
            // Where nothing is to be gained, soon nobody should be left.
            batch_found |= session.rows[before..].iter().any(|row| row.found > 0);
            found_nothing = left == 0 && !batch_found;
            if found_nothing {
                wanted = (4.0 * wanted).min(search.most);
            }
            // The tree is that of the last row.
            if session.rows[before..].iter().any(|row| observe(row, session.tree, device).is_break()) {
                return Ok(Some(StopReason::Cancelled));
            }
            if left == 0 && idle >= patience {
                return Ok(None);
            }
        }
    }

    /// Of the `k`-th round of a submission.
    fn params(&self, session: &Session<'_>, wanted: f64, next: f64, k: u32) -> RoundParams {
        RoundParams {
            count: session.internal,
            nodes: session.node_count,
            root_area: self.areas.root as f32,
            scale: self.scale,
            row: k * REPORT_WORDS,
            page: 0,
            wanted: wanted as u32,
            pool: (next as u32).saturating_mul(POOL),
        }
    }

    /// Records that the pool is empty and unfolds the top of the tree, in so many stages or until the pool is full.
    fn record_begin(
        &self,
        session: &Session<'_>,
        recording: &mut Recording,
        params: &RoundParams,
        again: bool,
        stages: u32,
    ) {
        if again {
            recording.clear("unfold", &self.lists.keys);
        }
        self.page(session, recording, params, BEGIN);
        for _ in 0..stages {
            self.record_unfold(session, recording, params);
            self.page(session, recording, params, CLOSE);
        }
    }

    fn page(&self, session: &Session<'_>, recording: &mut Recording, params: &RoundParams, page: u32) {
        session.moves.record_page(recording, "select", &RoundParams { page, ..*params }, &self.lists.fringe);
    }

    fn record_unfold(&self, session: &Session<'_>, recording: &mut Recording, params: &RoundParams) {
        let Lists { keys, pool, fringe, .. } = &self.lists;
        let books = &session.moves.books;
        let buffers = [&session.tree.nodes, keys, fringe, pool, books];
        recording.dispatch_counted("unfold", Kernel::WorstUnfold, params.count, params, &buffers, books, OVER_FRINGE);
    }

    fn record_round(
        &self,
        session: &Session<'_>,
        recording: &mut Recording,
        params: &RoundParams,
        search: &Search,
        lock_rounds: u32,
    ) {
        let Lists { keys, pool, fringe, list } = &self.lists;
        let (nodes, ways) = (&session.tree.nodes, &session.measure.arrivals);
        let moves = &session.moves;
        let (books, found, report) = (&moves.books, &moves.found, &moves.report);
        let over_pool = |recording: &mut Recording, kernel, buffers: &[&Buffer]| {
            recording.dispatch_counted("select", kernel, params.count, params, buffers, books, OVER_POOL);
        };
        over_pool(recording, Kernel::WorstCount, &[pool, keys, books]);
        self.page(session, recording, params, WORST);
        over_pool(recording, Kernel::WorstSelect, &[keys, pool, list, books]);
        self.record_unfold(session, recording, params);
        self.page(session, recording, params, LIST);

        let dual = DualParams {
            count: params.count,
            nodes: params.nodes,
            both_orders: search.both_orders.into(),
            climb: search.climb,
            slack: search.slack,
            row: params.row,
        };
        let buffers = [nodes, list, found, keys, books, report];
        recording.dispatch_counted("search", Kernel::DualSearch, dual.count, &dual, &buffers, books, OVER_LIST);
        let params_of_moves = PrbvhParams {
            count: params.count,
            mu: 1,
            first: 0,
            nodes: params.nodes,
            flags: DUAL | ROUNDS,
            row: params.row,
            scale: params.scale,
        };
        moves.record_lock_rounds(recording, &params_of_moves, lock_rounds);
        moves.record_reinsert(recording, &params_of_moves);
        let buffers = [found, nodes, ways, keys, fringe, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstMark, &params_of_moves, &buffers);
        let buffers = [found, nodes, ways, keys, pool, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstRefit, &params_of_moves, &buffers);
        self.page(session, recording, params, CLOSE);
    }
}

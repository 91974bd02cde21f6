//! Worst first: rounds of dual moves of the nodes that look worst, few at first and then ever more ([`prbvh_kernel::prbvh::worst`]); where they settle, new
//! [tops](super::new_top); the broad tail at the end.

use super::ledger::Ledger;
use super::new_top;
use super::pace::{MOST_AT_ONCE, Pace};
use super::session::{Observe, Outcome, Session};
use super::{PrbvhSettings, StopReason, TreeAreas, WorstFirst};
use crate::build::DeviceTree;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::dual::search::{DualParams, TO_THE_ROOT};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{
    BEGIN, BEST, CLOSE, LIST, MOST_STAGES, OVER_FRINGE, OVER_LIST, OVER_POOL, RESUME, WORST,
};
use prbvh_kernel::prbvh::worst::verdict::{DECIDES, JUDGES};
use prbvh_kernel::prbvh::{DUAL, PrbvhParams, ROUNDS};
use prbvh_kernel::status::{AT_FAULT, GOES_ON, NOTHING_FOUND, REPORT_WORDS, SETTLED};

/// Stages that unfold before the first round: nodes of a sixty-fourth of the root's area.
const FIRST_STAGES: u32 = 4;
/// As many times the nodes of a round should be in the pool: to look at a key costs little beside a search.
const POOL: u32 = 16;
/// The search may end after so many rounds, then after so many more, and so on; after each, in the end. The first ones are short.
const TOGETHER: [u32; 4] = [6, 4, 3, 2];
/// As many times the gain that counts after new tops counts before them.
const SETTLES_BEFORE: f64 = 10.0;
/// A part of the nodes that is so small that the search may end after any round.
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
    let (areas, faults) = session.begin(device, areas, 1)?;
    let mut rounds = Rounds { lists, ledger: Ledger::new(areas, tree.references), pace: Pace::new(settings.news) };
    let stop =
        if faults == 0 { rounds.run(&mut session, device, settings, observe)? } else { StopReason::Fault(faults) };
    // A tree that is none was never a best one, unless it came so.
    if matches!(stop, StopReason::Fault(_)) && faults == 0 {
        session.restore_best(device)?;
    } else {
        rounds.restore_if_worse(&mut session, device)?;
    }
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

/// How many nodes the rounds of a search want, and after which of them it may end: nothing of this depends on how many go in one submission.
#[derive(Clone, Copy, Debug)]
struct Schedule {
    wanted: f64,
    growth: f64,
    most: f64,
    internal: f64,
    /// How often the search could have ended, and rounds until it may the next time.
    times: usize,
    left: u32,
    found_nothing: bool,
}

/// A round that is planned.
#[derive(Clone, Copy, Debug)]
struct Round {
    wanted: f64,
    next: f64,
    decides: bool,
    /// The schedule after it.
    after: Schedule,
}

impl Schedule {
    fn new(search: &Search, growth: f64, internal: u32) -> Self {
        let Search { first: wanted, most, .. } = *search;
        Self { wanted, growth, most, internal: internal.into(), times: 0, left: 0, found_nothing: false }
    }

    /// Where nothing is to be gained, soon nobody should be left.
    fn hurry(&mut self) {
        self.wanted = (4.0 * self.wanted).min(self.most);
        self.found_nothing = true;
    }
}

impl Iterator for Schedule {
    type Item = Round;

    fn next(&mut self) -> Option<Round> {
        if self.left == 0 {
            let is_small = self.internal < FEW_OF * self.wanted;
            let together = TOGETHER.get(self.times).copied().unwrap_or(1);
            self.left = if is_small || self.found_nothing { 1 } else { together };
            self.times += 1;
            self.found_nothing = false;
        }
        self.left -= 1;
        let wanted = self.wanted;
        self.wanted = (wanted * self.growth).min(self.most).max(wanted);
        Some(Round { wanted, next: self.wanted, decides: self.left == 0, after: *self })
    }
}

#[derive(Debug)]
struct Rounds {
    lists: Lists,
    ledger: Ledger,
    pace: Pace,
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
        let initial_cost = self.ledger.best_cost;
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
            && self.ledger.best_cost < initial_cost
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

    /// Builds a top of about so many nodes anew: an iteration in which nothing is searched. It begins with the best tree, and ends with the best tree.
    fn renew_top(
        &mut self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        settings: &PrbvhSettings,
        observe: Observe<'_>,
        nodes: u32,
    ) -> Result<Option<StopReason>, DeviceError> {
        if let Some(stop) = session.ended(&settings.limits) {
            return Ok(Some(stop));
        }
        self.restore_if_worse(session, device)?;
        let params = RoundParams { pool: nodes, ..self.params(session, settings) };
        let mut recording = Recording::new();
        recording.clear("select", &session.moves.report);
        self.record_begin(session, &mut recording, &params, true, MOST_STAGES + 1);
        session.submit(device, &recording)?;
        let mut renewed = new_top::renew(session, device, &self.lists.keys, settings, run)?;
        let mut recording = std::mem::take(&mut renewed.graft);
        self.page(session, &mut recording, &params, BEST);
        session.submit(device, &recording)?;

        let cost = self.ledger.note_beside(renewed.decrease);
        session.push_new_top(cost, renewed.visits);
        let goes_on = observe(session.row(), session.tree, device).is_continue();
        Ok((!goes_on).then_some(StopReason::Cancelled))
    }

    /// The last tree may be worse than one before it.
    fn restore_if_worse(&self, session: &mut Session<'_>, device: &mut dyn Device) -> Result<(), DeviceError> {
        // Written so that a NaN is worse.
        let is_best = session.rows.len() == 1 || session.row().cost <= self.ledger.best_cost;
        if is_best { Ok(()) } else { session.restore_best(device) }
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
        let WorstFirst { growth, patience, lock_rounds, .. } = settings.worst_first;
        let rule = RoundParams {
            broad: (0.5 * search.most).ceil() as u32,
            patience: patience.max(1),
            settles: search.settles as f32,
            ..self.params(session, settings)
        };
        let mut schedule = Schedule::new(&search, growth, session.internal);
        let mut page = BEGIN;
        let begins_at = session.row().iteration;
        if begins_at == 0 && observe(session.row(), session.tree, device).is_break() {
            return Ok(Some(StopReason::Cancelled));
        }
        loop {
            let done = session.row().iteration;
            if let Some(stop) = session.ended(&settings.limits) {
                return Ok(Some(stop));
            }
            let searched = schedule.map(|round| round.wanted);
            let count = self.pace.rounds(searched, &settings.limits, done, session.elapsed());
            let rounds: Vec<Round> = schedule.take(count as usize).collect();

            let mut recording = Recording::new();
            recording.clear("select", &session.moves.report);
            if page == RESUME {
                self.page(session, &mut recording, &RoundParams { page, ..rule }, RESUME);
            }
            let mut ends = Vec::new();
            for (k, round) in (0..).zip(&rounds) {
                let params = RoundParams {
                    row: k * REPORT_WORDS,
                    wanted: round.wanted as u32,
                    pool: (round.next as u32).saturating_mul(POOL),
                    ..rule
                };
                if page == BEGIN && k == 0 {
                    self.record_begin(session, &mut recording, &params, done > 0, FIRST_STAGES);
                }
                let decides = if round.decides { DECIDES } else { 0 };
                let params = RoundParams { flags: JUDGES | decides, ..params };
                self.record_round(session, &mut recording, &params, &search, lock_rounds);
                ends.push(recording.commands().len());
            }
            let start = session.elapsed_s();
            let reports = session.submit_rows(device, recording, &ends)?;
            let made = &rounds[..reports.len()];
            let wanted = made.iter().map(|round| round.wanted).sum();
            self.pace.note(made.len(), wanted, session.elapsed_s() - start);
            if let Some(last) = made.last() {
                schedule = last.after;
            }
            let mut verdict = GOES_ON;
            for (report, clock) in reports {
                verdict = session.push_round(&report, 1, &mut self.ledger, clock);
            }
            // The tree is that of the last row.
            if session.observe_rows(done, device, observe).is_break() {
                return Ok(Some(StopReason::Cancelled));
            }
            match verdict {
                AT_FAULT => return Ok(Some(StopReason::Fault(session.faults))),
                SETTLED => return Ok(None),
                NOTHING_FOUND => schedule.hurry(),
                _ => {}
            }
            page = if verdict == GOES_ON { CLOSE } else { RESUME };
        }
    }

    /// Of a round that wants nothing.
    fn params(&self, session: &Session<'_>, settings: &PrbvhSettings) -> RoundParams {
        RoundParams { count: session.internal, nodes: session.node_count, ..self.ledger.params(&settings.limits) }
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

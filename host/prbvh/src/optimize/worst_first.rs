//! Worst first: rounds of dual moves of the nodes that look worst, few at first and then ever more ([`prbvh_kernel::prbvh::worst`]); where they settle, new
//! [tops](super::new_top); the broad tail at the end.

use super::ledger::Ledger;
use super::lists::{FIRST_STAGES, Lists, Of, POOL, Trial};
use super::new_top;
use super::pace::{MOST_AT_ONCE, Pace};
use super::session::{Observe, Outcome, Session};
use super::{PrbvhSettings, StopReason, TreeAreas, WorstFirst};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Recording};
use prbvh_kernel::prbvh::dual::search::TO_THE_ROOT;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BEGIN, BEST, MOST_STAGES, RESUME};
use prbvh_kernel::prbvh::worst::verdict::{DECIDES, JUDGES};
use prbvh_kernel::status::{GOES_ON, NOTHING_FOUND, REPORT_WORDS, SETTLED};

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
    let lists = Lists::new(device, &mut session.scratch, session.internal)?;
    let working_bytes = device.memory().bytes;
    let areas = session.begin(device, areas, 1)?;
    let mut rounds =
        Rounds { lists, ledger: Ledger::new(areas, tree.references), pace: Pace::new(settings.news, device.info()) };
    let stop = rounds.run(&mut session, device, settings, observe)?;
    rounds.restore_if_worse(&mut session, device)?;
    Ok(session.finish(device, stop, working_bytes))
}

/// How a part of the run searches.
#[derive(Clone, Copy, Debug)]
struct Search {
    /// Nodes of the first round; each has more by the growth, up to the most.
    first: f64,
    most: f64,
    trial: Trial,
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
        let WorstFirst { first, most_part, tail_part, climb, slack, lock_rounds, .. } = settings.worst_first;
        let internal = session.internal;
        let part = |part: f64| (part * f64::from(internal)).max(f64::from(first));
        let initial_cost = self.ledger.best_cost;
        let tops = settings.worst_first.tops(internal);
        let settles = settings.worst_first.settles;
        let worst = Search {
            first: first.into(),
            most: part(most_part),
            trial: Trial { both_orders: false, climb, slack, lock_rounds },
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
            let trial = Trial { both_orders: true, climb: TO_THE_ROOT, slack: 0.0, lock_rounds };
            let all = Search { first: most, most, trial, settles };
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
        self.lists.record_forget(&mut recording);
        self.lists.record_begin(of(session), &mut recording, &params, MOST_STAGES + 1);
        session.submit(device, &recording)?;
        let mut renewed = new_top::renew(session, device, &self.lists.keys, settings, run)?;
        let mut recording = std::mem::take(&mut renewed.graft);
        self.lists.record_page(of(session), &mut recording, &params, BEST);
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
        let WorstFirst { growth, patience, .. } = settings.worst_first;
        let rule = RoundParams {
            broad: (0.5 * search.most).ceil() as u32,
            patience: patience.max(1),
            settles: search.settles as f32,
            ..self.params(session, settings)
        };
        let mut schedule = Schedule::new(&search, growth, session.internal);
        let mut page = Some(BEGIN);
        let begins_at = session.row().iteration;
        if begins_at == 0 && observe(session.row(), session.tree, device).is_break() {
            return Ok(Some(StopReason::Cancelled));
        }
        loop {
            let done = session.row().iteration;
            if let Some(stop) = session.ended(&settings.limits) {
                return Ok(Some(stop));
            }
            let searched = schedule.map(|round| (round.wanted, round.decides));
            let count = self.pace.rounds(searched, &settings.limits, done, session.elapsed());
            let rounds: Vec<Round> = schedule.take(count as usize).collect();

            let mut recording = Recording::new();
            recording.clear("select", &session.moves.report);
            let mut ends = Vec::new();
            for (k, round) in (0..).zip(&rounds) {
                let params = RoundParams {
                    row: k * REPORT_WORDS,
                    wanted: round.wanted as u32,
                    pool: (round.next as u32).saturating_mul(POOL),
                    ..rule
                };
                match page.take() {
                    Some(BEGIN) => {
                        if done > 0 {
                            self.lists.record_forget(&mut recording);
                        }
                        self.lists.record_begin(of(session), &mut recording, &params, FIRST_STAGES);
                    }
                    Some(page) => self.lists.record_page(of(session), &mut recording, &params, page),
                    None => {}
                }
                let decides = if round.decides { DECIDES } else { 0 };
                let params = RoundParams { flags: JUDGES | decides, ..params };
                self.lists.record_round(of(session), &mut recording, &params, &search.trial);
                ends.push(recording.commands().len());
            }
            let made = session.run_rounds(device, recording, &ends, (&mut self.ledger, &mut self.pace), observe)?;
            if let Some(last) = rounds[..made.rounds].last() {
                schedule = last.after;
            }
            if made.flow.is_break() {
                return Ok(Some(StopReason::Cancelled));
            }
            match made.verdict {
                SETTLED => return Ok(None),
                NOTHING_FOUND => schedule.hurry(),
                _ => {}
            }
            page = (made.verdict != GOES_ON).then_some(RESUME);
        }
    }

    /// Of a round that wants nothing.
    fn params(&self, session: &Session<'_>, settings: &PrbvhSettings) -> RoundParams {
        RoundParams { count: session.internal, nodes: session.node_count, ..self.ledger.params(&settings.limits) }
    }
}

/// What the rounds of a session work on.
fn of<'a>(session: &'a Session<'_>) -> Of<'a> {
    Of { nodes: &session.tree.nodes, ways: &session.measure.arrivals, moves: &session.moves }
}

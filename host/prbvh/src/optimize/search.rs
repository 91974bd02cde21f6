//! The searches of worst first: how many nodes their rounds want, how many rounds go in one submission, and when they end.

use super::ledger::Ledger;
use super::lists::{FIRST_STAGES, Lists, Of, POOL, Trial};
use super::pace::Pace;
use super::session::{Clock, Observe, Session};
use super::{PrbvhSettings, TreeAreas, WorstFirst};
use crate::device::{Device, DeviceError, Recording, Timing};
use prbvh_kernel::prbvh::dual::search::TO_THE_ROOT;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BEGIN, RESUME};
use prbvh_kernel::prbvh::worst::verdict::{DECIDES, JUDGES};
use prbvh_kernel::status::{GOES_ON, REPORT_WORDS, SETTLED};

/// The search may end after so many rounds, then after so many more, and so on; after each, in the end. The first ones are short.
const TOGETHER: [u32; 4] = [6, 4, 3, 2];
/// A part of the nodes that is so small that the search may end after any round.
const FEW_OF: f64 = 256.0;

/// As many times the nodes of the largest small round may be wanted in one by hurry.
const ROOM: u32 = 4;

/// How a part of the run searches.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Nodes of the first round; each has more by the growth, up to the most.
    pub(super) first: f64,
    pub(super) most: f64,
    pub(super) trial: Trial,
    /// As [`WorstFirst::settles`].
    pub(super) settles: f64,
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

    /// Whether the search may end after every round from here on, whatever they find.
    fn is_single(&self) -> bool {
        self.left == 0 && (self.times >= TOGETHER.len() || self.internal < FEW_OF * self.wanted)
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

impl Search {
    /// Rounds of the worst nodes, of a tree of so many internal ones.
    pub(super) fn worst(settings: &WorstFirst, internal: u32) -> Self {
        let WorstFirst { first, most_part, climb, slack, lock_rounds, settles, .. } = *settings;
        let trial = Trial { both_orders: false, climb, slack, lock_rounds };
        Self { first: first.into(), most: part(most_part, first, internal), trial, settles }
    }

    /// The broad tail at the end, if there is to be one: all nodes once more, each child first and up to the root.
    pub(super) fn tail(settings: &WorstFirst, internal: u32) -> Option<Self> {
        let WorstFirst { first, tail_part, lock_rounds, settles, .. } = *settings;
        let most = part(tail_part, first, internal);
        let trial = Trial { both_orders: true, climb: TO_THE_ROOT, slack: 0.0, lock_rounds };
        (tail_part > 0.0).then_some(Self { first: most, most, trial, settles })
    }
}

/// Most nodes of a round.
fn part(part: f64, first: u32, internal: u32) -> f64 {
    (part * f64::from(internal)).max(f64::from(first))
}

/// What rounds work on beside a session.
#[derive(Debug)]
pub(super) struct Rounds {
    pub(super) lists: Lists,
    pub(super) ledger: Ledger,
    pace: Pace,
}

/// A search, from submission to submission.
#[derive(Debug)]
pub(super) struct Searching {
    search: Search,
    rule: RoundParams,
    schedule: Schedule,
    page: Option<u32>,
    /// Before which command of the submission each of its rounds ends.
    ends: Vec<usize>,
}

/// How a search goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// With other rounds.
    GoesOn,
    /// Nothing more is gained.
    Settled,
    /// The observer wants an end.
    Cancelled,
}

impl Rounds {
    /// None made yet, of a tree with these areas.
    pub(super) fn new(
        lists: Lists,
        areas: TreeAreas,
        references: u32,
        settings: &PrbvhSettings,
        device: &dyn Device,
    ) -> Self {
        Self { lists, ledger: Ledger::new(areas, references), pace: Pace::new(settings.news, device.info()) }
    }

    /// Of a round that wants nothing.
    pub(super) fn params(&self, session: &Session<'_>, settings: &PrbvhSettings) -> RoundParams {
        RoundParams { count: session.internal, nodes: session.node_count, ..self.ledger.params(&settings.limits) }
    }

    /// Whether the last tree is worse than one before it.
    pub(super) fn is_worse(&self, session: &Session<'_>) -> bool {
        // Written so that a NaN is worse.
        let is_best = session.rows.len() == 1 || session.row().cost <= self.ledger.best_cost;
        !is_best
    }

    /// A search that begins.
    pub(super) fn begin(&mut self, search: Search, session: &Session<'_>, settings: &PrbvhSettings) -> Searching {
        self.pace.begin();
        let WorstFirst { growth, patience, .. } = settings.worst_first;
        let rule = RoundParams {
            broad: (0.5 * search.most).ceil() as u32,
            patience: patience.max(1),
            settles: search.settles as f32,
            ..self.params(session, settings)
        };
        let schedule = Schedule::new(&search, growth, session.internal);
        Searching { search, rule, schedule, page: Some(BEGIN), ends: Vec::new() }
    }

    /// Records the next rounds of a search, after what the recording begins with.
    pub(super) fn record(
        &mut self,
        searching: &mut Searching,
        session: &Session<'_>,
        settings: &PrbvhSettings,
        recording: &mut Recording,
    ) {
        let Searching { search, rule, schedule, page, ends } = searching;
        let done = session.row().iteration;
        // A copy: only rounds that were made count.
        let planned = *schedule;
        let searched = planned.map(|round| (round.wanted, round.decides));
        let count = self.pace.rounds(searched, &settings.limits, done, session.elapsed());
        let rounds: Vec<Round> = planned.take(count as usize).collect();
        let last_small = rounds.iter().rposition(|round| self.lists.is_small(round.wanted as u32));
        ends.clear();
        recording.clear("select", &session.moves.report);
        for (k, round) in rounds.iter().enumerate() {
            let room = match last_small {
                // There is to be a look at what the rounds find, as they may be fewer until the next one.
                _ if !round.after.is_single() => 0,
                Some(last) if k < last => ROOM * self.lists.small(),
                _ => u32::MAX,
            };
            let params = RoundParams {
                row: k as u32 * REPORT_WORDS,
                wanted: parts(round.wanted),
                next: parts(round.next),
                most: search.most as u32,
                pools: POOL,
                room,
                ..*rule
            };
            match page.take() {
                Some(BEGIN) => {
                    if done > 0 {
                        self.lists.record_forget(recording);
                    }
                    self.lists.record_begin(of(session), recording, &params, FIRST_STAGES);
                }
                Some(page) => self.lists.record_page(of(session), recording, &params, page),
                None => {}
            }
            let decides = if round.decides { DECIDES } else { 0 };
            let params = RoundParams { flags: JUDGES | decides, ..params };
            self.lists.record_round(of(session), recording, &params, &search.trial);
            ends.push(recording.commands().len());
        }
        session.record_reports(recording, rounds.len());
    }

    /// Takes note of the rounds that were recorded last: they began at `start` and took `timings`.
    pub(super) fn note(
        &mut self,
        searching: &mut Searching,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        (start, timings): (Clock, &[Timing]),
        observe: Observe<'_>,
    ) -> Result<Next, DeviceError> {
        let of = (&mut self.ledger, &mut self.pace);
        let made = session.note_rounds(device, start, timings, &searching.ends, of, observe)?;
        for hurries in made.hurries {
            searching.schedule.next();
            if hurries {
                searching.schedule.hurry();
                searching.rule.hurried += 1;
            }
        }
        if made.flow.is_break() {
            return Ok(Next::Cancelled);
        }
        searching.page = (made.verdict != GOES_ON).then_some(RESUME);
        Ok(if made.verdict == SETTLED { Next::Settled } else { Next::GoesOn })
    }
}

/// A whole number and a fraction of 2⁻³².
fn parts(nodes: f64) -> [u32; 2] {
    [nodes as u32, (nodes.fract() * 4_294_967_296.0) as u32]
}

/// What the rounds of a session work on.
pub(super) fn of<'a>(session: &'a Session<'_>) -> Of<'a> {
    Of { nodes: &session.tree.nodes, ways: &session.measure.arrivals, moves: &session.moves }
}

//! Whether there is another round: decided on the device, so that many rounds go in one submission and the host reads afterwards how far they came.
//!
//! Differences of sums are compared as floats: the same two roundings everywhere.

use super::RoundParams;
use super::hurry::hurry;
use super::words::{EVERY, HAS_FOUND, IDLE, LAST_LOST, OVER_LIST, PROGRESS, ROUND, list_in_turn};
use crate::mem::AtomicU32;
use crate::status::{
    AT_FAULT, AT_TARGET, FAULTS, FOUND, FRINGE, GOES_ON, HURRY, MU, NOTHING_FOUND, SEARCHED, SETTLED, VERDICT, WAITING,
};
use crate::sum::Sum;

/// A round ends with the page.
pub const JUDGES: u32 = 1;
/// The search may end after the round.
pub const DECIDES: u32 = 2;
/// The rule is the published one (Meister & Bittner 2018, §4.4).
pub const PUBLISHED: u32 = 4;

/// Says in the row how the rounds go on after this one, at the end of which areas have lost `lost`; returns whether they have ended.
#[inline(always)]
pub(super) fn judge(params: &RoundParams, lost: Sum, books: &[AtomicU32], report: &[AtomicU32]) -> bool {
    let row = params.row as usize;
    let mut verdict = if params.has(PUBLISHED) {
        published(params, lost, books, report)
    } else {
        worst_first(params, lost, books, report)
    };
    if !Sum::from_words(params.target).exceeds(lost) {
        verdict = AT_TARGET;
    }
    if report[row + FAULTS].load() != 0 {
        verdict = AT_FAULT;
    }
    if verdict == NOTHING_FOUND {
        report[row + HURRY].store(1);
        if hurry(params, books) {
            verdict = GOES_ON;
        }
    }
    report[row + VERDICT].store(verdict);
    verdict != GOES_ON
}

/// Where the cost changes by epsilon at the most, or there was no new best tree, by more than epsilon, in some rounds, more nodes are searched in the
/// next ones, until there are no more.
#[inline(always)]
fn published(params: &RoundParams, lost: Sum, books: &[AtomicU32], report: &[AtomicU32]) -> u32 {
    let mu = books[EVERY].load();
    report[params.row as usize + MU].store(mu);
    report[params.row as usize + SEARCHED].store(books[OVER_LIST].load());
    let idle = note_progress(params, lost, params.epsilon, books, true);
    let last = Sum::load(books, LAST_LOST);
    let change = lost.excess(last) + last.excess(lost);
    lost.store(books, LAST_LOST);
    let goes_on = change > params.epsilon && idle < params.patience;
    if !goes_on {
        books[EVERY].store(mu - 1);
        books[IDLE].store(0);
    }
    books[ROUND].add(1);
    list_in_turn(params, books);
    if goes_on || mu > 1 { GOES_ON } else { SETTLED }
}

/// There was no new best tree that counts in some broad rounds, or nobody is left to search.
#[inline(always)]
fn worst_first(params: &RoundParams, lost: Sum, books: &[AtomicU32], report: &[AtomicU32]) -> u32 {
    let word = |word: usize| report[params.row as usize + word].load();
    let (searched, fringe) = (word(SEARCHED), word(FRINGE));
    let counts = params.settles * (params.total - Sum::load(books, PROGRESS).to_f32());
    // A round of few nodes may gain nothing, and the next one much; unless there are no more.
    let is_broad = searched > 0 && (searched >= params.broad || fringe == 0);
    let mut idle = note_progress(params, lost, counts, books, is_broad);
    if searched + word(WAITING) + fringe == 0 {
        idle = params.patience;
        books[IDLE].store(idle);
    }
    let has_found = books[HAS_FOUND].load() != 0 || word(FOUND) > 0;
    books[HAS_FOUND].store((has_found && !params.has(DECIDES)) as u32);
    if !params.has(DECIDES) {
        GOES_ON
    } else if idle >= params.patience {
        SETTLED
    } else if has_found {
        GOES_ON
    } else {
        NOTHING_FOUND
    }
}

/// Counts rounds since the last progress of more than `counts`, those that are `broad`; returns how many there are.
#[inline(always)]
fn note_progress(params: &RoundParams, lost: Sum, counts: f32, books: &[AtomicU32], is_broad: bool) -> u32 {
    let mut idle = books[IDLE].load();
    if lost.excess(Sum::load(books, PROGRESS)) > counts {
        lost.store(books, PROGRESS);
        idle = 0;
    } else if is_broad && idle < params.patience {
        idle += 1;
    }
    books[IDLE].store(idle);
    idle
}

#[cfg(test)]
mod tests {
    use super::super::books::{self, BEGIN, BOOKS_WORDS, CLOSE, EPOCH, FIRST, HURRIED, LIST_LENGTH, RESUME, STOPPED};
    use super::super::hurry;
    use super::*;
    use crate::status::{APPLIED, FAULT_SEARCH_STEPS, GREW, REPORT_WORDS, SHRUNK};
    use bytemuck::Zeroable;

    /// The books of a run, in units of whole areas.
    struct Run {
        rule: RoundParams,
        books: [u32; BOOKS_WORDS as usize],
        report: [u32; REPORT_WORDS as usize],
    }

    impl Run {
        fn new(rule: RoundParams) -> Self {
            let mut run = Self { rule, books: [0; BOOKS_WORDS as usize], report: [0; REPORT_WORDS as usize] };
            run.page(BEGIN, 0);
            run
        }

        fn published(mu: u32, epsilon: f32, patience: u32) -> Self {
            Self::new(RoundParams { flags: PUBLISHED, epsilon, patience, mu, ..rule() })
        }

        fn page(&mut self, page: u32, flags: u32) {
            let params = RoundParams { page, flags: self.rule.flags | flags, ..self.rule };
            let (books, report) =
                (AtomicU32::from_mut_slice(&mut self.books), AtomicU32::from_mut_slice(&mut self.report));
            books::books(&params, books, AtomicU32::from_mut_slice(&mut [0; 2]), report);
        }

        /// A round after which areas have lost `lost` more; some words of its report.
        fn round(&mut self, lost: i32, flags: u32, words: &[(usize, u32)]) -> u32 {
            self.report.fill(0);
            self.report[if lost < 0 { GREW } else { SHRUNK }] = lost.unsigned_abs();
            for &(word, value) in words {
                self.report[word] = value;
            }
            self.page(CLOSE, JUDGES | flags);
            self.report[VERDICT]
        }
    }

    fn rule() -> RoundParams {
        RoundParams { nodes: 9, target: [u32::MAX, i32::MAX as u32], total: 1000.0, ..Zeroable::zeroed() }
    }

    #[test]
    fn mu_falls_by_one_where_the_cost_settles_and_the_end_comes_at_one() {
        let mut run = Run::published(2, 10.0, 20);
        let in_turn = |run: &Run| [EVERY, FIRST, OVER_LIST].map(|word| run.books[word]);
        assert_eq!(in_turn(&run), [2, 0, 5]);
        assert_eq!(run.round(100, 0, &[]), GOES_ON);
        assert_eq!(([MU, SEARCHED].map(|word| run.report[word]), in_turn(&run)), ([2, 5], [2, 1, 4]));
        assert_eq!(run.round(-11, 0, &[]), GOES_ON);
        assert_eq!(in_turn(&run), [2, 0, 5], "a change for the worse is one");
        assert_eq!(run.round(10, 0, &[]), GOES_ON);
        assert_eq!(([MU, SEARCHED].map(|word| run.report[word]), in_turn(&run)), ([2, 5], [1, 0, 9]));
        assert_eq!(run.round(11, 0, &[]), GOES_ON);
        assert_eq!(run.round(0, 0, &[(APPLIED, 0)]), SETTLED);
        assert_eq!((run.books[STOPPED], run.books[OVER_LIST]), (1, 0));
    }

    #[test]
    fn rounds_that_were_stopped_go_on_where_they_were() {
        let mut run = Run::new(RoundParams { target: [1, 0], ..Run::published(2, 10.0, 20).rule });
        assert_eq!(run.round(50, 0, &[]), AT_TARGET);
        assert_eq!((run.books[STOPPED], run.books[OVER_LIST]), (1, 0));
        run.page(RESUME, 0);
        assert_eq!((run.books[STOPPED], run.books[OVER_LIST]), (0, 4));
    }

    #[test]
    fn a_limit_cycle_ends() {
        let mut run = Run::published(1, 10.0, 6);
        let rounds = (0..100).take_while(|k| run.round(if k % 2 == 0 { 50 } else { -50 }, 0, &[]) == GOES_ON);
        assert_eq!(rounds.count(), 6);
    }

    #[test]
    fn an_epsilon_that_is_no_number_ends() {
        assert_eq!(Run::published(1, f32::NAN, 6).round(50, 0, &[]), SETTLED);
    }

    #[test]
    fn worst_first_settles_after_broad_rounds_without_progress() {
        let broad = RoundParams { broad: 5, patience: 2, settles: 0.01, ..rule() };
        let mut run = Run::new(broad);
        let many = [(SEARCHED, 5), (WAITING, 9), (FRINGE, 1), (FOUND, 3)];
        let few = [(SEARCHED, 4), (WAITING, 9), (FRINGE, 1), (FOUND, 3)];
        // The fringe is the books' own.
        run.books[books::FRINGE_LENGTH] = 1;
        run.books[books::UNFOLDS] = 0;
        for _ in 0..9 {
            assert_eq!(run.round(0, DECIDES, &few), GOES_ON);
        }
        assert_eq!(run.round(0, DECIDES, &many), GOES_ON);
        assert_eq!(run.round(11, DECIDES, &many), GOES_ON, "progress");
        assert_eq!(run.round(9, 0, &many), GOES_ON, "too little of it");
        assert_eq!(run.round(-9, 0, &many), GOES_ON, "no end before it may be decided");
        assert_eq!(run.round(0, DECIDES, &many), SETTLED);
        assert_eq!(run.round(500, DECIDES, &many), GOES_ON, "nothing is written after the end");
    }

    #[test]
    fn worst_first_says_where_nothing_was_found() {
        let rule = RoundParams { broad: 5, patience: 2, settles: 0.01, most: 99, ..rule().wanting(7, 9) };
        let mut run = Run::new(rule);
        run.books[books::FRINGE_LENGTH] = 1;
        run.books[books::UNFOLDS] = 0;
        // Enough for every round.
        run.books[books::POOL_LENGTH] = 1000;
        let found = |found| [(SEARCHED, 4), (WAITING, 9), (FOUND, found)];
        assert_eq!(run.round(0, 0, &found(1)), GOES_ON);
        assert_eq!(run.round(0, DECIDES, &found(0)), GOES_ON, "it was, a round ago");
        assert_eq!(run.round(0, 0, &found(0)), GOES_ON);
        assert_eq!(run.round(0, DECIDES, &found(0)), NOTHING_FOUND);
        assert_eq!((run.report[HURRY], run.books[HURRIED]), (1, 1));
        run.page(RESUME, 0);
        run.rule.hurried = 1;
        assert_eq!(run.round(0, DECIDES, &found(1)), GOES_ON);
        assert_eq!(run.report[HURRY], 0);
        // Rounds that are planned want more, as long as they may.
        run.rule.room = 36;
        assert_eq!((run.round(0, DECIDES, &found(0)), run.report[HURRY]), (GOES_ON, 1));
        let wanted = |run: &mut Run| hurry::wanted(&run.rule, AtomicU32::from_mut_slice(&mut run.books));
        assert_eq!(wanted(&mut run), 28);
        assert_eq!(run.round(0, DECIDES, &found(0)), NOTHING_FOUND, "99 are too many");
        assert_eq!((run.books[HURRIED], wanted(&mut run)), (3, 99));
        let mut run = Run::new(RoundParams { patience: 3, settles: 0.01, ..rule });
        run.books[books::FRINGE_LENGTH] = 0;
        assert_eq!(run.round(9, DECIDES, &[]), SETTLED, "nobody is left");
    }

    #[test]
    fn target_and_faults_end_at_once() {
        let mut run =
            Run::new(RoundParams { target: [100, 0], epsilon: 1.0, patience: 9, mu: 1, flags: PUBLISHED, ..rule() });
        assert_eq!(run.round(99, 0, &[]), GOES_ON);
        assert_eq!(run.round(1, 0, &[]), AT_TARGET);
        let mut run = Run::published(1, 1.0, 9);
        let epoch = run.books[EPOCH];
        assert_eq!(run.round(99, 0, &[(FAULTS, FAULT_SEARCH_STEPS)]), AT_FAULT);
        assert_eq!((run.books[EPOCH], run.books[LIST_LENGTH]), (epoch, 0), "no tree to keep");
    }
}

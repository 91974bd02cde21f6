//! Locks from their definition: of all that want a node, the one with the largest key holds it.

use crate::compare::Case;
use prbvh_kernel::Kernel;
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::lock::{TAKEN, claim, lock_key};
use prbvh_kernel::prbvh::{LAST, Move, PrbvhParams, ROUNDS, SECOND_WORD, WON};
use prbvh_kernel::status::{OWNED, PREDICTED, REPORT_WORDS};
use std::collections::BTreeSet;

/// A move, and the nodes that it wants.
#[derive(Clone, Debug)]
pub struct Claimant {
    /// The move as the search found it.
    pub found: Move,
    /// Nodes that it wants for itself.
    pub written: BTreeSet<u32>,
    /// Others, that it shares with who only reads them, too.
    pub read: BTreeSet<u32>,
}

impl Claimant {
    /// A move that wants all of its nodes for itself.
    #[must_use]
    pub fn alone(found: Move, nodes: impl IntoIterator<Item = u32>) -> Self {
        Self { found, written: nodes.into_iter().collect(), read: BTreeSet::new() }
    }

    fn key(&self, written: bool) -> u64 {
        lock_key(self.found.area_decrease, claim(self.found.input, written))
    }

    /// Whether locks leave all of its nodes to it.
    #[must_use]
    pub fn wins(&self, locks: &[u64]) -> bool {
        let lock = |v: &u32| locks[*v as usize];
        self.written.iter().all(|v| lock(v) == self.key(true))
            && self.read.iter().all(|v| lock(v) == self.key(false) || lock(v) & 1 == 0)
    }

    /// Whether it meets one of these nodes.
    #[must_use]
    pub fn meets(&self, nodes: &BTreeSet<u32>) -> bool {
        !nodes.is_disjoint(&self.written) || !nodes.is_disjoint(&self.read)
    }
}

/// The locks of a tree of `length` nodes.
#[must_use]
pub fn locks<'a>(length: usize, claimants: impl IntoIterator<Item = &'a Claimant>) -> Vec<u64> {
    let mut locks = vec![0u64; length];
    for each in claimants {
        for (nodes, written) in [(&each.written, true), (&each.read, false)] {
            for &v in nodes {
                locks[v as usize] = locks[v as usize].max(each.key(written));
            }
        }
    }
    locks
}

/// In which of several rounds of locks each claimant wins its nodes; none if in no round.
#[must_use]
pub fn rounds(length: usize, claimants: &[Claimant], rounds: u32) -> Vec<Option<u32>> {
    let mut won = vec![None; claimants.len()];
    let mut taken = BTreeSet::new();
    for round in 0..rounds {
        let is_open = |k: &usize| won[*k].is_none() && !claimants[*k].meets(&taken);
        let open: Vec<usize> = (0..claimants.len()).filter(is_open).collect();
        let locks = locks(length, open.iter().map(|&k| &claimants[k]));
        for k in open.into_iter().filter(|&k| claimants[k].wins(&locks)) {
            won[k] = Some(round);
            taken.extend(&claimants[k].written);
        }
    }
    won
}

/// What lock and check left.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// Moves; winners are marked.
    pub found: Vec<Move>,
    /// Locks after the lock and before the check.
    pub locked: Vec<u64>,
    /// Locks after the check.
    pub locks: Vec<u64>,
    /// The row of the report.
    pub report: Vec<u32>,
}

/// Lock and check on every device, with locks of one word and of two, which must agree; `locks` is what an earlier round left.
#[must_use]
pub fn lock_and_check(nodes: &[Node], found: &[Move], locks: &[u64], params: &PrbvhParams) -> Checked {
    let words = |part: fn(u64) -> u32| locks.iter().map(|&lock| part(lock)).collect::<Vec<u32>>();
    let (decreases, claims) = (words(|lock| (lock >> 32) as u32), words(|lock| lock as u32));
    let join = |high: Vec<u32>, low: Vec<u32>| {
        high.iter().zip(&low).map(|(&high, &low)| u64::from(high) << 32 | u64::from(low)).collect::<Vec<u64>>()
    };
    let report = REPORT_WORDS as usize;
    let second = PrbvhParams { flags: params.flags | SECOND_WORD, ..*params };
    let case = |kernel, params: &PrbvhParams| Case::new(kernel, params.count, params).with(nodes);

    let locked = case(Kernel::PrbvhLock, params).with(found).with(locks).run_everywhere();
    let first = case(Kernel::PrbvhLockWords, params).with(found).with(&decreases).with(&claims).run_everywhere();
    let found: Vec<Move> = locked.get("found");
    assert_eq!(first.get::<Move>("found"), found, "who is out");
    let (decreases, claims) = (first.get::<u32>("decreases"), first.get::<u32>("claims"));
    let words = case(Kernel::PrbvhLockWords, &second).with(&found).with(&decreases).with(&claims).run_everywhere();
    assert_eq!(words.get::<Move>("found"), found);
    let (decreases, claims) = (words.get::<u32>("decreases"), words.get::<u32>("claims"));
    let locked: Vec<u64> = locked.get("locks");
    assert_eq!(join(decreases.clone(), claims.clone()), locked, "two words hold both halves of one");

    let one = case(Kernel::PrbvhCheck, params).with(&locked).with(&found).zeros(report).run_everywhere();
    let two = case(Kernel::PrbvhCheckWords, params).with(&decreases).with(&claims);
    let two = two.with(&found).zeros(report).run_everywhere();
    let checked = Checked { found: one.get("found"), locked, locks: one.get("locks"), report: one.get("report") };
    assert_eq!(two.get::<Move>("found"), checked.found);
    assert_eq!(join(two.get("decreases"), two.get("claims")), checked.locks);
    assert_eq!(two.get::<u32>("report"), checked.report);
    checked
}

/// What is wrong with a lock and a check without rounds, against the definition.
#[must_use]
pub fn fault_of(found: &[Move], claimants: &[Claimant], checked: &Checked, scale: f32) -> Option<String> {
    let locks = locks(checked.locks.len(), claimants);
    if checked.locked != locks || checked.locks != locks {
        return Some("locks".to_owned());
    }
    let winners: Vec<Move> = claimants.iter().filter(|each| each.wins(&locks)).map(|each| each.found).collect();
    if winners.is_empty() && !claimants.is_empty() {
        return Some("something moves whenever something was found".to_owned());
    }
    let expected: Vec<Move> = found.iter().map(|found| mark(found, winners.contains(found))).collect();
    winners_fault(&checked.found, &expected, &winners, &checked.report, scale)
}

fn mark(found: &Move, wins: bool) -> Move {
    if wins { Move { input: found.input | WON, ..*found } } else { *found }
}

fn winners_fault(found: &[Move], expected: &[Move], winners: &[Move], report: &[u32], scale: f32) -> Option<String> {
    if let Some(k) = (0..expected.len()).find(|&k| found[k] != expected[k]) {
        return Some(format!("{:?}, not {:?}", found[k], expected[k]));
    }
    if report[OWNED] as usize != winners.len() {
        return Some(format!("{} owned, not {}", report[OWNED], winners.len()));
    }
    let said = prbvh_kernel::sum::to_f64(report[PREDICTED], report[PREDICTED + 1], scale);
    let sum: f64 = winners.iter().map(|found| f64::from(found.area_decrease)).sum();
    // Each term is cut to whole units.
    let unit = winners.len() as f64 / f64::from(scale);
    (said > sum || said < sum - unit).then(|| format!("{said} predicted, not {sum}"))
}

/// Several rounds of locks on every device. Returns what the last one left, with all that the check said in its report.
#[must_use]
pub fn lock_rounds(nodes: &[Node], found: &[Move], params: &PrbvhParams, rounds: u32) -> Checked {
    let mut checked =
        Checked { found: found.to_vec(), locked: Vec::new(), locks: vec![0; nodes.len()], report: vec![0; 16] };
    for round in 1..=rounds {
        let last = if round == rounds { LAST } else { 0 };
        let params = PrbvhParams { flags: params.flags | ROUNDS | last, ..*params };
        let before = checked.report;
        checked = lock_and_check(nodes, &checked.found, &checked.locks, &params);
        checked.report[OWNED] += before[OWNED];
    }
    checked
}

/// What is wrong with the result of [`lock_rounds`] against the naive [`rounds`].
#[must_use]
pub fn rounds_fault(claimants: &[Claimant], checked: &Checked, rounds: u32) -> Option<String> {
    let won = self::rounds(checked.locks.len(), claimants, rounds);
    let winners: Vec<&Claimant> =
        claimants.iter().zip(&won).filter(|(_, won)| won.is_some()).map(|(each, _)| each).collect();
    let naive: BTreeSet<u32> = winners.iter().map(|each| each.found.input).collect();
    let made: BTreeSet<u32> = checked.found.iter().filter(|found| found.has_won()).map(Move::input).collect();
    if let Some(v) = made.symmetric_difference(&naive).next() {
        return Some(format!("{v} has won, or should have"));
    }
    if checked.report[OWNED] as usize != made.len() {
        return Some(format!("{} owned, not {}", checked.report[OWNED], made.len()));
    }
    let mut used = BTreeSet::new();
    if let Some(v) = winners.iter().flat_map(|each| &each.written).find(|&&v| !used.insert(v)) {
        return Some(format!("two winners share {v}"));
    }
    checked.locks.iter().position(|&lock| lock != 0).map(|v| format!("{v} is not free"))
}

/// Nodes that are taken.
#[must_use]
pub fn taken(locks: &[u64]) -> BTreeSet<u32> {
    (0..).zip(locks).filter(|(_, lock)| **lock == TAKEN).map(|(v, _)| v).collect()
}

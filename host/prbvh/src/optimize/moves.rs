//! What every round has: buffers of moves, of locks and of the best tree; lock, check, reinsert.

use crate::build::{DeviceTree, Scratch};
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::kept::{GraftParams, Kept, RestoreParams};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BOOKS_WORDS, CLOSE, OVER_LIST, OVER_ROUND};
use prbvh_kernel::prbvh::{LAST, Move, PrbvhParams, ROUNDS, SECOND_WORD};
use std::fmt;

/// When a reinsertion may run beside others (Meister & Bittner 2018, §4.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Strategy {
    /// If their links do not overlap: more of them, whose decreases of the cost need not add up. The cost may rise.
    #[default]
    Aggressive,
    /// If their boxes do not overlap either: the cost falls in each iteration by the sum of the decreases
    /// ([`prbvh_kernel::prbvh::conservative`]).
    Conservative,
}

/// As on the command line.
impl fmt::Display for Strategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Aggressive => "aggressive",
            Self::Conservative => "conservative",
        })
    }
}

/// Locks of one 64-bit word, or of two of 32 bits where the device has no 64-bit atomics.
#[derive(Debug)]
enum Locks {
    Word(Buffer),
    Words { decreases: Buffer, claims: Buffer },
}

/// Buffers of lock, check and reinsert.
#[derive(Debug)]
pub(super) struct Moves {
    nodes: Buffer,
    /// After the check: what moves.
    pub(super) found: Buffer,
    locks: Locks,
    /// Children of nodes in the best tree.
    pub(super) kept: Buffer,
    pub(super) books: Buffer,
    pub(super) report: Buffer,
}

impl Moves {
    /// Room for `found` moves at a time, and for a report of `report` words.
    pub(super) fn new(
        device: &mut dyn Device,
        scratch: &mut Scratch,
        tree: &DeviceTree,
        found: usize,
        report: u32,
    ) -> Result<Self, DeviceError> {
        let atomics_64 = device.info().atomics_64;
        let mut buffer = |label, length: usize, bytes| scratch.allocate(device, label, length.max(1), bytes);
        let length = tree.nodes.length;
        let locks = if atomics_64 {
            Locks::Word(buffer("locks", length, 8)?)
        } else {
            Locks::Words { decreases: buffer("locked decreases", length, 4)?, claims: buffer("claims", length, 4)? }
        };
        Ok(Self {
            nodes: tree.nodes.clone(),
            found: buffer("found", found, size_of::<Move>())?,
            locks,
            kept: buffer("kept children", length / 2, size_of::<Kept>())?,
            books: buffer("books", BOOKS_WORDS as usize, 4)?,
            report: buffer("report", report as usize, 4)?,
        })
    }

    /// Records that all nodes are free.
    pub(super) fn clear_locks(&self, recording: &mut Recording) {
        match &self.locks {
            Locks::Word(locks) => recording.clear("lock", locks),
            Locks::Words { decreases, claims } => {
                recording.clear("lock", decreases);
                recording.clear("lock", claims);
            }
        }
    }

    /// The locks, if they are of one word.
    pub(super) fn word_locks(&self) -> Option<&Buffer> {
        match &self.locks {
            Locks::Word(locks) => Some(locks),
            Locks::Words { .. } => None,
        }
    }

    /// Records a dispatch over the moves, as many as the books list.
    pub(super) fn dispatch(
        &self,
        recording: &mut Recording,
        label: &'static str,
        kernel: Kernel,
        params: &PrbvhParams,
        buffers: &[&Buffer],
    ) {
        recording.dispatch_counted(label, kernel, params.count, params, buffers, &self.books, OVER_LIST);
    }

    /// Records a lock and a check.
    pub(super) fn record_lock(&self, recording: &mut Recording, params: &PrbvhParams) {
        let Self { nodes, found, report, .. } = self;
        let mut dispatch =
            |label, kernel, params: &_, buffers: &[&Buffer]| self.dispatch(recording, label, kernel, params, buffers);
        match &self.locks {
            Locks::Word(locks) => {
                dispatch("lock", Kernel::PrbvhLock, params, &[nodes, found, locks]);
                dispatch("check", Kernel::PrbvhCheck, params, &[nodes, locks, found, report]);
            }
            Locks::Words { decreases, claims } => {
                let second = PrbvhParams { flags: params.flags | SECOND_WORD, ..*params };
                let buffers = [nodes, found, decreases, claims];
                dispatch("lock", Kernel::PrbvhLockWords, params, &buffers);
                dispatch("lock", Kernel::PrbvhLockWords, &second, &buffers);
                dispatch("check", Kernel::PrbvhCheckWords, params, &[nodes, decreases, claims, found, report]);
            }
        }
    }

    /// Records several locks and checks over the same tree; all nodes are free afterwards.
    pub(super) fn record_lock_rounds(&self, recording: &mut Recording, params: &PrbvhParams, rounds: u32) {
        for round in 1..=rounds {
            let last = if round == rounds { LAST } else { 0 };
            self.record_lock(recording, &PrbvhParams { flags: params.flags | ROUNDS | last, ..*params });
        }
    }

    /// Records the moves that won.
    pub(super) fn record_reinsert(&self, recording: &mut Recording, params: &PrbvhParams) {
        let buffers = [&self.found, &self.nodes, &self.kept, &self.books, &self.report];
        self.dispatch(recording, "reinsert", Kernel::PrbvhReinsert, params, &buffers);
    }

    /// Records what a single workgroup does once a round, and not at all behind the end.
    pub(super) fn dispatch_once(
        &self,
        recording: &mut Recording,
        label: &'static str,
        kernel: Kernel,
        params: &RoundParams,
        buffers: &[&Buffer],
    ) {
        let params = RoundParams { count: 1, ..*params };
        recording.dispatch_counted(label, kernel, 1, &params, buffers, &self.books, OVER_ROUND);
    }

    /// Records a page of the books. `fringe` is any buffer of words where the page has no use for one.
    pub(super) fn record_page(
        &self,
        recording: &mut Recording,
        label: &'static str,
        params: &RoundParams,
        fringe: &Buffer,
    ) {
        let buffers = [&self.books, fringe, &self.report];
        if params.page == CLOSE {
            self.dispatch_once(recording, label, Kernel::WorstBooks, params, &buffers);
        } else {
            let params = RoundParams { count: 1, ..*params };
            recording.dispatch(label, Kernel::WorstBooks, 1, &params, &buffers);
        }
    }

    /// Records that nodes get other children, without their boxes.
    pub(super) fn record_graft(&self, recording: &mut Recording, grafts: &Buffer) {
        let params = GraftParams { count: grafts.length as u32 };
        recording.dispatch("graft", Kernel::KeptGraft, params.count, &params, &[grafts, &self.nodes]);
    }

    /// Records that the best tree comes back, without its boxes.
    pub(super) fn record_restore(&self, recording: &mut Recording, internal: u32, epoch: u32) {
        let params = RestoreParams { count: internal, epoch };
        recording.dispatch("keep best", Kernel::KeptRestore, internal, &params, &[&self.kept, &self.nodes]);
    }
}

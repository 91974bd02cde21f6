//! Which reinsertions an iteration makes: search, lock, check, by either strategy.

use super::searching::Searching;
use crate::build::Scratch;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::{PrbvhParams, Reinsertion};
use serde::Serialize;
use std::fmt;

/// When a reinsertion may run beside others (Meister & Bittner 2018, §4.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
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
pub(super) enum Locks {
    Word(Buffer),
    Words { decreases: Buffer, inputs: Buffer },
}

/// Buffers of search, lock and check.
#[derive(Debug)]
pub(super) struct Moves {
    searching: Searching,
    /// After the check: what moves.
    pub(super) found: Buffer,
    pub(super) locks: Locks,
    /// Of the conservative strategy.
    tops: Option<Buffer>,
}

impl Moves {
    pub(super) fn new(
        device: &mut dyn Device,
        scratch: &mut Scratch,
        strategy: Strategy,
        nodes: usize,
    ) -> Result<Self, DeviceError> {
        let atomics_64 = device.info().atomics_64;
        let searching = Searching::new(device, scratch)?;
        let mut buffer = |label, length, bytes| scratch.allocate(device, label, length, bytes);
        let found = buffer("found", nodes, size_of::<Reinsertion>())?;
        let tops = match strategy {
            Strategy::Aggressive => None,
            Strategy::Conservative => Some(buffer("tops", nodes, 4)?),
        };
        let locks = if atomics_64 {
            Locks::Word(buffer("locks", nodes, 8)?)
        } else {
            Locks::Words {
                decreases: buffer("locked decreases", nodes, 4)?,
                inputs: buffer("locked inputs", nodes, 4)?,
            }
        };
        Ok(Self { searching, found, locks, tops })
    }

    /// Records that all nodes are free.
    pub(super) fn clear_locks(&self, recording: &mut Recording, label: &'static str) {
        match &self.locks {
            Locks::Word(locks) => recording.clear(label, locks),
            Locks::Words { decreases, inputs } => {
                recording.clear(label, decreases);
                recording.clear(label, inputs);
            }
        }
    }

    /// Records search, lock and check over the tree `nodes`, of every node or of those on a list. Whoever finds nothing is struck off the list.
    pub(super) fn record(
        &self,
        recording: &mut Recording,
        params: &PrbvhParams,
        candidates: Option<&Buffer>,
        nodes: &Buffer,
        report: &Buffer,
    ) {
        let Self { searching, found, locks, tops } = self;
        self.clear_locks(recording, "lock");
        searching.record(recording, params, candidates, nodes, found, tops.as_ref(), report);
        let mut dispatch = |label, kernel, buffers: &[&Buffer]| {
            recording.dispatch(label, kernel, params.count, params, buffers);
        };
        if let Some(list) = candidates {
            dispatch("search", Kernel::PrbvhStrike, &[found, list]);
        }
        match (locks, tops) {
            (Locks::Word(locks), None) => {
                dispatch("lock", Kernel::PrbvhLock, &[nodes, found, locks]);
                dispatch("check", Kernel::PrbvhCheck, &[nodes, locks, found, report]);
            }
            (Locks::Word(locks), Some(tops)) => {
                dispatch("lock", Kernel::ConservativeLock, &[nodes, found, tops, locks]);
                dispatch("check", Kernel::ConservativeCheck, &[nodes, tops, locks, found, report]);
            }
            (Locks::Words { decreases, inputs }, None) => {
                dispatch("lock", Kernel::PrbvhLockDecrease, &[nodes, found, decreases]);
                dispatch("lock", Kernel::PrbvhLockInput, &[nodes, found, decreases, inputs]);
                dispatch("check", Kernel::PrbvhCheckWords, &[nodes, decreases, inputs, found, report]);
            }
            (Locks::Words { decreases, inputs }, Some(tops)) => {
                dispatch("lock", Kernel::ConservativeLockDecrease, &[nodes, found, tops, decreases]);
                dispatch("lock", Kernel::ConservativeLockInput, &[nodes, found, tops, decreases, inputs]);
                dispatch("check", Kernel::ConservativeCheckWords, &[nodes, tops, decreases, inputs, found, report]);
            }
        }
    }
}

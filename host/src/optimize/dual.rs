//! Passes of dual reinsertions, which follow the single ones of an iteration.

use super::moves::{Locks, Moves};
use crate::build::Scratch;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::PrbvhParams;
use serde::Serialize;
use std::fmt;

/// What an iteration moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MoveKind {
    /// Single subtrees, as published.
    #[default]
    Single,
    /// First single subtrees, then both children of internal nodes at once ([`prbvh_kernel::prbvh::dual`]): leads out of trees that no single
    /// move makes better. The dual moves lock their links whatever the [`Strategy`](super::Strategy).
    Dual,
}

/// As on the command line.
impl fmt::Display for MoveKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Single => "single",
            Self::Dual => "dual",
        })
    }
}

/// What dual moves need beside the buffers of the single ones.
#[derive(Debug)]
pub(super) struct DualMoves {
    /// The second outputs.
    seconds: Buffer,
}

impl DualMoves {
    pub(super) fn new(device: &mut dyn Device, scratch: &mut Scratch, internal: u32) -> Result<Self, DeviceError> {
        // No buffer may be empty.
        Ok(Self { seconds: scratch.allocate(device, "second outputs", internal.max(1) as usize, 4)? })
    }

    /// Records search, lock and check of dual moves over the tree `nodes`.
    pub(super) fn record(
        &self,
        recording: &mut Recording,
        params: &PrbvhParams,
        moves: &Moves,
        nodes: &Buffer,
        report: &Buffer,
    ) {
        let seconds = &self.seconds;
        let found = &moves.found;
        moves.clear_locks(recording, "dual lock");
        let mut dispatch = |label, kernel, buffers: &[&Buffer]| {
            recording.dispatch(label, kernel, params.count, params, buffers);
        };
        dispatch("dual search", Kernel::DualSearch, &[nodes, found, seconds, report]);
        match &moves.locks {
            Locks::Word(locks) => {
                dispatch("dual lock", Kernel::DualLock, &[nodes, found, seconds, locks]);
                dispatch("dual check", Kernel::DualCheck, &[nodes, seconds, locks, found, report]);
            }
            Locks::Words { decreases, inputs } => {
                dispatch("dual lock", Kernel::DualLockDecrease, &[nodes, found, seconds, decreases]);
                dispatch("dual lock", Kernel::DualLockInput, &[nodes, found, seconds, decreases, inputs]);
                let buffers = [nodes, seconds, decreases, inputs, found, report];
                dispatch("dual check", Kernel::DualCheckWords, &buffers);
            }
        }
    }

    /// Records the moves that the check left.
    pub(super) fn record_reinsert(
        &self,
        recording: &mut Recording,
        params: &PrbvhParams,
        moves: &Moves,
        nodes: &Buffer,
        report: &Buffer,
    ) {
        let buffers = [&moves.found, &self.seconds, nodes, report];
        recording.dispatch("dual reinsert", Kernel::DualReinsert, params.count, params, &buffers);
    }
}

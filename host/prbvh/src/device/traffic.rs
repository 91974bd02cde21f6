//! How often host and device speak with each other.

use super::{Command, Recording};

/// What a device was asked for since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Traffic {
    /// Times that the host handed work to the device and waited for its end; on a CPU device, recordings.
    pub submissions: u64,
    /// Times that it handed work over and went on: pieces of long uploads.
    pub ahead: u64,
    /// Dispatches of kernels, whether or not a list that they run over was empty.
    pub dispatches: u64,
    /// Buffers allocated.
    pub allocations: u64,
    /// Bytes from the host.
    pub bytes_in: u64,
    /// Bytes to the host.
    pub bytes_out: u64,
}

impl Traffic {
    /// Takes note of a recording that a submission runs.
    pub(super) fn note(&mut self, recording: &Recording) {
        let is_dispatch = |(_, command): &&(_, Command)| matches!(command, Command::Dispatch(_));
        self.submissions += 1;
        self.dispatches += recording.commands().iter().filter(is_dispatch).count() as u64;
    }

    /// What came after `earlier`.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            submissions: self.submissions - earlier.submissions,
            ahead: self.ahead - earlier.ahead,
            dispatches: self.dispatches - earlier.dispatches,
            allocations: self.allocations - earlier.allocations,
            bytes_in: self.bytes_in - earlier.bytes_in,
            bytes_out: self.bytes_out - earlier.bytes_out,
        }
    }
}

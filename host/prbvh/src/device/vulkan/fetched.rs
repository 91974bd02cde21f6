//! Bytes that come along with a run, so that the host need not ask for them in a submission of their own.

use super::buffers::Buffers;
use super::logical::LogicalDevice;
use super::memory::{Allocation, Range};
use crate::device::{Command, DeviceError};
use ash::vk;
use std::sync::Arc;

const WHAT: &str = "the buffer of fetched bytes";
const FIRST_BYTES: u64 = 16 << 10;

/// A buffer that the host can read, and what the last run left there.
pub(super) struct Fetched {
    device: Arc<LogicalDevice>,
    window: Allocation,
    parts: Vec<Part>,
}

/// The start of a buffer, from a byte of the window on.
struct Part {
    from: Range,
    at: usize,
    bytes: usize,
}

impl Fetched {
    /// Nothing fetched.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        Ok(Self {
            device: Arc::clone(device),
            window: Allocation::window(device, WHAT, FIRST_BYTES)?,
            parts: Vec::new(),
        })
    }

    /// Forgets what was fetched and makes room for what a recording fetches.
    pub(super) fn reserve(
        &mut self,
        buffers: &Buffers,
        commands: &[(&'static str, Command)],
    ) -> Result<(), DeviceError> {
        self.forget();
        let mut wanted = 0;
        for (_, command) in commands {
            if let Command::Fetch { from, bytes } = command
                && !buffers.find(from)?.is_mapped()
            {
                wanted += *bytes as u64;
            }
        }
        if wanted > self.window.bytes() {
            self.window = Allocation::window(&self.device, WHAT, wanted.next_power_of_two())?;
        }
        Ok(())
    }

    /// Where the first bytes of a buffer go; nowhere if the host reads the buffer itself.
    pub(super) fn place(&mut self, from: &Allocation, bytes: usize) -> Option<(vk::Buffer, vk::BufferCopy)> {
        if from.is_mapped() || bytes == 0 {
            return None;
        }
        let at = self.parts.last().map_or(0, |last| last.at + last.bytes);
        let from = from.range();
        self.parts.push(Part { from, at, bytes });
        let region = vk::BufferCopy { src_offset: from.offset, dst_offset: at as u64, size: bytes as u64 };
        Some((self.window.buffer(), region))
    }

    /// `bytes` bytes of a buffer from `first` on, if they were fetched.
    pub(super) fn get(&mut self, from: Range, first: usize, bytes: usize) -> Option<&[u8]> {
        let holds = |part: &&Part| part.from == from && first.checked_add(bytes).is_some_and(|end| end <= part.bytes);
        let start = self.parts.iter().rev().find(holds)?.at + first;
        self.window.mapped()?.get(start..start + bytes)
    }

    /// Says that what was fetched may be no longer so.
    pub(super) fn forget(&mut self) {
        self.parts.clear();
    }
}

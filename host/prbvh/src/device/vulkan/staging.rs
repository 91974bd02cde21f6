//! Bytes between the host and memory that only the device reaches.

use super::error::failed;
use super::logical::LogicalDevice;
use super::memory::Allocation;
use super::ring::{PIECE_BYTES, Ring};
use super::submit::Submitter;
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;

const WHAT: &str = "the staging buffer";
const FIRST_BYTES: u64 = 64 << 10;
/// Longer downloads go in several pieces.
const MAX_BYTES: u64 = 16 << 20;

/// A buffer through which bytes pass; it grows with the transfers and is kept.
pub(super) struct Staging {
    device: Arc<LogicalDevice>,
    window: Allocation,
    /// Bytes at the start that wait for a submission, unless there was one since.
    used: usize,
    /// Submissions before the first of these bytes came.
    since: [u64; 2],
    /// Where long uploads pass, once there was one.
    ring: Option<Ring>,
}

impl Staging {
    /// A small staging buffer.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        Ok(Self {
            device: Arc::clone(device),
            window: Allocation::window(device, WHAT, FIRST_BYTES)?,
            used: 0,
            since: [0; 2],
            ring: None,
        })
    }

    /// Copies what `fill` writes to some byte of a buffer on, which reaches at least as far, before the next submission's work. Where that takes several pieces, all
    /// but the last are whole elements.
    pub(super) fn upload(
        &mut self,
        submitter: &mut Submitter,
        (to, first): (vk::Buffer, u64),
        (bytes, element): (usize, usize),
        fill: &mut dyn FnMut(usize, &mut [u8]),
    ) -> Result<(), DeviceError> {
        if bytes > PIECE_BYTES && element <= PIECE_BYTES {
            let ring = match &mut self.ring {
                Some(ring) => ring,
                None => self.ring.insert(Ring::new(&self.device)?),
            };
            return ring.upload(submitter, (to, first), (bytes, element), fill);
        }
        let at = self.reserve(submitter, bytes, u64::MAX)?;
        fill(0, &mut self.window()?[at..][..bytes]);
        let region = vk::BufferCopy { src_offset: at as u64, dst_offset: first, size: bytes as u64 };
        submitter.copy_first(self.window.buffer(), to, region)?;
        // What comes next is aligned to words, too.
        self.used = (at + bytes).next_multiple_of(4);
        Ok(())
    }

    /// Fills `bytes` from some byte of a buffer on, which reaches at least as far.
    pub(super) fn download(
        &mut self,
        submitter: &mut Submitter,
        (from, first): (vk::Buffer, u64),
        bytes: &mut [u8],
    ) -> Result<(), DeviceError> {
        let mut done = 0;
        while done < bytes.len() {
            let at = self.reserve(submitter, bytes.len() - done, MAX_BYTES)?;
            let size = (self.window()?.len() - at).min(bytes.len() - done);
            let region = vk::BufferCopy { src_offset: first + done as u64, dst_offset: at as u64, size: size as u64 };
            let to = self.window.buffer();
            submitter.submit(|device, commands| {
                // SAFETY: the region lies in both buffers, which are alive and of this device.
                unsafe { device.cmd_copy_buffer(commands, from, to, &[region]) };
            })?;
            bytes[done..][..size].copy_from_slice(&self.window()?[at..][..size]);
            done += size;
        }
        Ok(())
    }

    /// Bytes that are held for bytes on their way.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> u64 {
        self.window.bytes() + self.ring.as_ref().map_or(0, Ring::bytes)
    }

    /// Makes room for `bytes` bytes, or for `most`; returns where it begins.
    fn reserve(&mut self, submitter: &mut Submitter, bytes: usize, most: u64) -> Result<usize, DeviceError> {
        if self.since != submitter.submissions() {
            self.used = 0;
        }
        let wanted = (bytes as u64).next_power_of_two().min(most);
        let grows = wanted > self.window.bytes();
        if grows || self.used as u64 + wanted.min(bytes as u64) > self.window.bytes() {
            submitter.flush()?;
            self.used = 0;
        }
        if grows {
            self.window = Allocation::window(&self.device, WHAT, wanted)?;
        }
        self.since = submitter.submissions();
        Ok(self.used)
    }

    fn window(&mut self) -> Result<&mut [u8], DeviceError> {
        self.window.mapped().ok_or_else(|| failed("vkMapMemory", vk::Result::ERROR_MEMORY_MAP_FAILED))
    }
}

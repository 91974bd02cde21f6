//! Bytes between the host and memory that only the device reaches.

use super::error::failed;
use super::logical::LogicalDevice;
use super::memory::{Allocation, Purpose};
use super::submit::Submitter;
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;

const FIRST_BYTES: u64 = 64 << 10;
/// Longer transfers go in several pieces.
const MAX_BYTES: u64 = 64 << 20;

/// A buffer through which bytes pass; it grows with the transfers and is kept.
pub(super) struct Staging {
    device: Arc<LogicalDevice>,
    window: Allocation,
    /// Bytes at the start that wait for a submission, unless there was one since.
    used: usize,
    /// Submissions before the first of these bytes came.
    since: u64,
}

impl Staging {
    /// A small staging buffer.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        Ok(Self { device: Arc::clone(device), window: window(device, FIRST_BYTES)?, used: 0, since: 0 })
    }

    /// Copies `bytes` to some byte of a buffer on, which reaches at least as far, before the next submission's work.
    pub(super) fn upload(
        &mut self,
        submitter: &mut Submitter,
        (to, first): (vk::Buffer, u64),
        bytes: &[u8],
    ) -> Result<(), DeviceError> {
        let mut done = 0;
        while done < bytes.len() {
            let at = self.reserve(submitter, bytes.len() - done)?;
            let window = self.window()?;
            let size = (window.len() - at).min(bytes.len() - done);
            window[at..][..size].copy_from_slice(&bytes[done..][..size]);
            let region = vk::BufferCopy { src_offset: at as u64, dst_offset: first + done as u64, size: size as u64 };
            submitter.copy_first(self.window.buffer(), to, region)?;
            self.used = at + size;
            done += size;
        }
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
            let at = self.reserve(submitter, bytes.len() - done)?;
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

    /// Makes room for `bytes` bytes, or for as many as there may be; returns where it begins.
    fn reserve(&mut self, submitter: &mut Submitter, bytes: usize) -> Result<usize, DeviceError> {
        if self.since != submitter.submissions() {
            self.used = 0;
        }
        let wanted = (bytes as u64).next_power_of_two().min(MAX_BYTES);
        let grows = wanted > self.window.bytes();
        if grows || self.used as u64 + wanted.min(bytes as u64) > self.window.bytes() {
            submitter.flush()?;
            self.used = 0;
        }
        if grows {
            self.window = window(&self.device, wanted)?;
        }
        self.since = submitter.submissions();
        Ok(self.used)
    }

    fn window(&mut self) -> Result<&mut [u8], DeviceError> {
        self.window.mapped().ok_or_else(|| failed("vkMapMemory", vk::Result::ERROR_MEMORY_MAP_FAILED))
    }
}

fn window(device: &Arc<LogicalDevice>, bytes: u64) -> Result<Allocation, DeviceError> {
    let mut window = Allocation::new(device, "the staging buffer", bytes, Purpose::Staging)?;
    window.zero();
    Ok(window)
}

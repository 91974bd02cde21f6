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
}

impl Staging {
    /// A small staging buffer.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        Ok(Self { device: Arc::clone(device), window: window(device, FIRST_BYTES)? })
    }

    /// Copies `bytes` to some byte of a buffer on, which reaches at least as far.
    pub(super) fn upload(
        &mut self,
        submitter: &mut Submitter,
        (to, mut offset): (vk::Buffer, u64),
        bytes: &[u8],
    ) -> Result<(), DeviceError> {
        let size = self.reserve(bytes.len())?;
        for piece in bytes.chunks(size) {
            self.window()?[..piece.len()].copy_from_slice(piece);
            let region = vk::BufferCopy { src_offset: 0, dst_offset: offset, size: piece.len() as u64 };
            copy(submitter, self.window.buffer(), to, region)?;
            offset += piece.len() as u64;
        }
        Ok(())
    }

    /// Fills `bytes` from some byte of a buffer on, which reaches at least as far.
    pub(super) fn download(
        &mut self,
        submitter: &mut Submitter,
        (from, mut offset): (vk::Buffer, u64),
        bytes: &mut [u8],
    ) -> Result<(), DeviceError> {
        let size = self.reserve(bytes.len())?;
        for piece in bytes.chunks_mut(size) {
            let region = vk::BufferCopy { src_offset: offset, dst_offset: 0, size: piece.len() as u64 };
            copy(submitter, from, self.window.buffer(), region)?;
            piece.copy_from_slice(&self.window()?[..piece.len()]);
            offset += piece.len() as u64;
        }
        Ok(())
    }

    /// Makes room for `bytes` bytes or for as many as there may be; returns how many go at a time.
    fn reserve(&mut self, bytes: usize) -> Result<usize, DeviceError> {
        let wanted = (bytes as u64).next_power_of_two().min(MAX_BYTES);
        if wanted > self.window.bytes() {
            self.window = window(&self.device, wanted)?;
        }
        Ok(self.window()?.len())
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

fn copy(
    submitter: &mut Submitter,
    from: vk::Buffer,
    to: vk::Buffer,
    region: vk::BufferCopy,
) -> Result<(), DeviceError> {
    submitter.submit(|device, commands| {
        // SAFETY: the region lies in both buffers, which are alive and of this device.
        unsafe { device.cmd_copy_buffer(commands, from, to, &[region]) };
    })
}

//! Long uploads in pieces: the device takes one while the host writes the next.

use super::commands::Commands;
use super::error::failed;
use super::logical::LogicalDevice;
use super::memory::Allocation;
use super::submit::Submitter;
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;

/// Bytes of a piece. So many take a GPU some 0.2 ms behind a bus of 25 GB/s, ten times as long as a submission.
pub(super) const PIECE_BYTES: usize = 4 << 20;
const SLOTS: usize = 2;

/// Where pieces pass.
pub(super) struct Ring {
    slots: [Slot; SLOTS],
    /// Submissions before the last piece of the last upload came, which waits for the next one.
    since: [u64; 2],
}

struct Slot {
    window: Allocation,
    commands: Commands,
    /// Whether the device may still read the window.
    is_under_way: bool,
}

impl Ring {
    /// Nothing is under way.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        let slot = || -> Result<Slot, DeviceError> {
            let window = Allocation::window(device, "a piece of an upload", PIECE_BYTES as u64)?;
            Ok(Slot { window, commands: Commands::new(device)?, is_under_way: false })
        };
        Ok(Self { slots: [slot()?, slot()?], since: [u64::MAX; 2] })
    }

    /// Bytes of all slots.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> u64 {
        self.slots.iter().map(|slot| slot.window.bytes()).sum()
    }

    /// Copies what `fill` writes to some byte of a buffer on, which reaches at least as far, before the next submission's work. Pieces are a multiple of `element`
    /// bytes. The last one goes with that work, and the others have arrived when this returns: between two calls the device is at rest.
    pub(super) fn upload(
        &mut self,
        submitter: &mut Submitter,
        (to, first): (vk::Buffer, u64),
        (bytes, element): (usize, usize),
        fill: &mut dyn FnMut(usize, &mut [u8]),
    ) -> Result<(), DeviceError> {
        if self.since == submitter.submissions() {
            submitter.flush()?;
        }
        let piece = PIECE_BYTES / element * element;
        let mut flight = Flight { submitter, slots: &mut self.slots };
        for (turn, at) in (0..bytes).step_by(piece).enumerate() {
            let size = piece.min(bytes - at);
            let slot = turn % SLOTS;
            flight.land(slot)?;
            let Slot { window, .. } = &mut flight.slots[slot];
            let mapped = window.mapped().ok_or_else(|| failed("vkMapMemory", vk::Result::ERROR_MEMORY_MAP_FAILED))?;
            fill(at, &mut mapped[..size]);
            let region = vk::BufferCopy { src_offset: 0, dst_offset: first + at as u64, size: size as u64 };
            if at + size < bytes {
                flight.take_off(slot, to, region)?;
            } else {
                flight.submitter.copy_first(window.buffer(), to, region)?;
            }
        }
        self.since = flight.submitter.submissions();
        (0..SLOTS).try_for_each(|slot| flight.land(slot))
    }
}

/// Pieces under way, which have arrived when it is dropped, whatever happens in between.
struct Flight<'a> {
    submitter: &'a mut Submitter,
    slots: &'a mut [Slot; SLOTS],
}

impl Flight<'_> {
    /// Hands the copy of what is in a slot to the device.
    fn take_off(&mut self, slot: usize, to: vk::Buffer, region: vk::BufferCopy) -> Result<(), DeviceError> {
        let Slot { window, commands, is_under_way } = &mut self.slots[slot];
        let from = window.buffer();
        let copy = |device: &ash::Device, commands| {
            // SAFETY: the region lies in both buffers, which are alive and of this device.
            unsafe { device.cmd_copy_buffer(commands, from, to, &[region]) };
        };
        // SAFETY: the slot has landed; until it has again, its window is not touched, and whoever frees a buffer comes after the flight.
        unsafe { self.submitter.submit_ahead(commands, copy) }?;
        *is_under_way = true;
        Ok(())
    }

    /// Waits until the device has read a slot.
    fn land(&mut self, slot: usize) -> Result<(), DeviceError> {
        let Slot { commands, is_under_way, .. } = &mut self.slots[slot];
        if std::mem::take(is_under_way) { self.submitter.wait(commands) } else { Ok(()) }
    }
}

impl Drop for Flight<'_> {
    fn drop(&mut self) {
        for slot in 0..SLOTS {
            // What it would report ended the upload, or ends what comes next.
            let _ = self.land(slot);
        }
    }
}

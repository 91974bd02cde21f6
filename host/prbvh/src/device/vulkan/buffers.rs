//! The buffers of a device, by the number in their handle.

use super::logical::LogicalDevice;
use super::memory::{Access, Allocation, Purpose};
use crate::device::{Buffer, DeviceError, MemoryUse};
use ash::vk;
use std::collections::HashMap;
use std::sync::Arc;

/// The buffers of a device.
pub(super) struct Buffers {
    device: Arc<LogicalDevice>,
    access: Access,
    live: HashMap<u64, (Buffer, Allocation)>,
    memory: MemoryUse,
}

impl Buffers {
    /// No buffers yet.
    pub(super) fn new(device: &Arc<LogicalDevice>, access: Access) -> Self {
        Self { device: Arc::clone(device), access, live: HashMap::new(), memory: MemoryUse::default() }
    }

    /// A buffer whose content is not defined yet, and its handle.
    pub(super) fn allocate(
        &mut self,
        label: &'static str,
        length: usize,
        element_bytes: usize,
    ) -> Result<(Buffer, &mut Allocation), DeviceError> {
        let what = format!("buffer {label}");
        let bytes = (length as u64).saturating_mul(element_bytes as u64);
        self.check_limits(&what, bytes)?;
        let allocation = Allocation::new(&self.device, &what, bytes, Purpose::Storage(self.access))?;

        let buffer = Buffer::new(label, length, element_bytes);
        self.memory.bytes += bytes;
        self.memory.peak_bytes = self.memory.peak_bytes.max(self.memory.bytes);
        let (_, allocation) = self.live.entry(buffer.id).insert_entry((buffer.clone(), allocation)).into_mut();
        Ok((buffer, allocation))
    }

    /// A handle of a buffer of the caller's, whose memory does not count.
    pub(super) fn adopt(
        &mut self,
        label: &'static str,
        (raw, offset): (vk::Buffer, u64),
        length: usize,
        element_bytes: usize,
    ) -> Result<Buffer, DeviceError> {
        let bytes = (length as u64).saturating_mul(element_bytes as u64);
        let alignment = self.device.physical().properties.limits.min_storage_buffer_offset_alignment.max(4);
        if !offset.is_multiple_of(alignment) || bytes == 0 || !bytes.is_multiple_of(4) {
            let problem = format!(
                "{bytes} bytes from byte {offset} on, but the offset must be a multiple of {alignment} \
                 (minStorageBufferOffsetAlignment), and the size one of 4 above 0"
            );
            return Err(DeviceError::Buffer { label, problem });
        }
        self.check_limits(&format!("buffer {label}"), bytes)?;
        let buffer = Buffer::new(label, length, element_bytes);
        self.live.insert(buffer.id, (buffer.clone(), Allocation::of_caller(raw, offset, bytes)));
        Ok(buffer)
    }

    fn check_limits(&self, what: &str, bytes: u64) -> Result<(), DeviceError> {
        let summary = &self.device.physical().summary;
        [
            ("maxStorageBufferRange", bytes, summary.max_storage_buffer_range),
            ("maxMemoryAllocationSize", bytes, summary.max_memory_allocation_size),
        ]
        .into_iter()
        .find(|&(_, need, have)| have < need)
        .map_or(Ok(()), |(name, need, have)| {
            Err(DeviceError::Limit { what: what.to_owned(), name, need, have, device: summary.name.clone() })
        })
    }

    /// Gives the memory back; does nothing for a buffer that is not of this device.
    pub(super) fn free(&mut self, buffer: &Buffer) {
        if self.find(buffer).is_ok()
            && let Some((_, allocation)) = self.live.remove(&buffer.id)
            && allocation.is_own()
        {
            self.memory.bytes -= allocation.bytes();
        }
    }

    /// The memory behind a handle.
    pub(super) fn find(&self, buffer: &Buffer) -> Result<&Allocation, DeviceError> {
        match self.live.get(&buffer.id) {
            Some((own, allocation)) if own.is_same(buffer) => Ok(allocation),
            _ => Err(buffer.not_here()),
        }
    }

    /// The memory behind a handle, of which the first `bytes` bytes are wanted.
    pub(super) fn find_mut(&mut self, buffer: &Buffer, bytes: usize) -> Result<&mut Allocation, DeviceError> {
        match self.live.get_mut(&buffer.id) {
            Some((own, allocation)) if own.is_same(buffer) => {
                if bytes as u64 <= allocation.bytes() {
                    Ok(allocation)
                } else {
                    Err(buffer.too_short(bytes))
                }
            }
            _ => Err(buffer.not_here()),
        }
    }

    /// Bytes in buffers, as they were asked for.
    pub(super) fn memory(&self) -> MemoryUse {
        self.memory
    }
}

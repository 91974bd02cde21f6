//! Parts of large blocks of memory, which stay while the device is open: to allocate from a driver takes longer than most dispatches.

use super::limits::PhysicalDevice;
use super::logical::LogicalDevice;
use crate::device::DeviceError;
use ash::vk;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings, MemoryLocation};
use std::ptr::NonNull;
use std::sync::{Arc, Mutex, PoisonError};

const MIB: u64 = 1 << 20;

/// Where the memory of a device comes from. The last block stays when all of it is free; what is larger than a block has memory of its own.
pub(super) struct Heap(Mutex<Allocator>);

impl Heap {
    /// Nothing allocated yet.
    pub(super) fn new(
        instance: &ash::Instance,
        device: &ash::Device,
        physical: &PhysicalDevice,
    ) -> Result<Self, DeviceError> {
        let sizes = AllocationSizes::new(8 * MIB, 8 * MIB);
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: physical.raw,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: sizes.with_max_device_memblock_size(128 * MIB).with_max_host_memblock_size(128 * MIB),
        });
        let refused = |error| DeviceError::OutOfMemory {
            what: format!("memory ({error})"),
            bytes: 0,
            device: physical.summary.name.clone(),
        };
        Ok(Self(Mutex::new(allocator.map_err(refused)?)))
    }

    /// Bytes of all blocks.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> u64 {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).capacity()
    }
}

/// A part of a block.
pub(super) struct Memory {
    /// There until it is dropped.
    part: Option<Allocation>,
    device: Arc<LogicalDevice>,
}

impl Memory {
    /// Memory that fits `requirements`; `None` if there is none.
    pub(super) fn new(device: &Arc<LogicalDevice>, what: &str, requirements: vk::MemoryRequirements) -> Option<Self> {
        let mut allocator = device.heap().0.lock().unwrap_or_else(PoisonError::into_inner);
        let part = allocator.allocate(&AllocationCreateDesc {
            name: what,
            requirements,
            // The requirements name one type.
            location: MemoryLocation::Unknown,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        let part = part.inspect_err(|error| tracing::debug!("no memory for {what}: {error}")).ok()?;
        Some(Self { part: Some(part), device: Arc::clone(device) })
    }

    /// The block, and from which byte on; valid as long as `self` lives.
    pub(super) fn place(&self) -> (vk::DeviceMemory, u64) {
        // SAFETY: the block is neither freed nor mapped through this handle.
        self.part.as_ref().map_or((vk::DeviceMemory::null(), 0), |part| (unsafe { part.memory() }, part.offset()))
    }

    /// Where the host reaches it, if it does; valid as long as `self` lives.
    pub(super) fn mapping(&self) -> Option<NonNull<u8>> {
        Some(self.part.as_ref()?.mapped_ptr()?.cast())
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if let Some(part) = self.part.take()
            && !self.device.is_abandoned()
        {
            let freed = self.device.heap().0.lock().unwrap_or_else(PoisonError::into_inner).free(part);
            if let Err(error) = freed {
                tracing::debug!("memory was not given back: {error}");
            }
        }
    }
}

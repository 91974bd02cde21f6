//! Parts of large blocks of memory, which stay while the device is open: to allocate from a driver takes longer than most dispatches.

use super::limits::PhysicalDevice;
use crate::device::DeviceError;
use ash::vk;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings, MemoryLocation};
use std::ptr::NonNull;
use std::sync::{Mutex, MutexGuard, PoisonError};

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
        self.lock().capacity()
    }

    /// A part of a block that fits `requirements`; `None` if there is none.
    pub(super) fn allocate(&self, what: &str, requirements: vk::MemoryRequirements) -> Option<Part> {
        let part = self.lock().allocate(&AllocationCreateDesc {
            name: what,
            requirements,
            // The requirements name one type.
            location: MemoryLocation::Unknown,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        part.inspect_err(|error| tracing::debug!("no memory for {what}: {error}")).ok().map(Part)
    }

    /// Takes a part back.
    pub(super) fn free(&self, part: Part) {
        if let Err(error) = self.lock().free(part.0) {
            tracing::debug!("memory was not given back: {error}");
        }
    }

    fn lock(&self) -> MutexGuard<'_, Allocator> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A part of a block, until [`Heap::free`].
pub(super) struct Part(Allocation);

impl Part {
    /// The block, and from which byte on.
    pub(super) fn place(&self) -> (vk::DeviceMemory, u64) {
        // SAFETY: the block is neither freed nor mapped through this handle.
        (unsafe { self.0.memory() }, self.0.offset())
    }

    /// Where the host reaches it, if it does.
    pub(super) fn mapping(&self) -> Option<NonNull<u8>> {
        Some(self.0.mapped_ptr()?.cast())
    }
}

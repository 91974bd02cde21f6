//! The Vulkan of the caller: its device, its buffers, its semaphores.

use super::instance::Instance;
use super::limits::PhysicalDevice;
use super::logical::LogicalDevice;
use super::{Access, VulkanDevice};
use crate::device::{Buffer, DeviceError};
use ash::vk;
use std::path::PathBuf;

/// A device that somebody else created, and a queue of it.
///
/// Who does not use ash loads its types from handles: `ash::Entry::from_static_fn`, `ash::Instance::load`, `ash::Device::load`.
#[derive(Clone)]
pub struct RawVulkan {
    /// An instance of Vulkan 1.2 or later.
    pub instance: ash::Instance,
    /// A device of it.
    pub physical_device: vk::PhysicalDevice,
    /// The opened device, with the features of [`KernelFeatures`](super::KernelFeatures).
    pub device: ash::Device,
    /// A queue of it.
    pub queue: vk::Queue,
    /// The queue's family, which computes.
    pub queue_family: u32,
    /// Whether the device was created with `shaderInt64` and `shaderBufferInt64Atomics`.
    pub atomics_64: bool,
    /// Where compiled pipelines are kept from run to run; none: nowhere.
    pub cache_folder: Option<PathBuf>,
}

impl std::fmt::Debug for RawVulkan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RawVulkan")
            .field("device", &self.device.handle())
            .field("queue", &self.queue)
            .field("queue_family", &self.queue_family)
            .finish_non_exhaustive()
    }
}

impl VulkanDevice {
    /// A device of the caller's. What is allocated here ends with it; instance, device and queue stay the caller's.
    ///
    /// Every method returns after the end of its work on the queue: an optimiser reads counts back between its rounds. So there is nothing
    /// to record into a command buffer of the caller's; [`wait_for`](Self::wait_for) and [`signal`](Self::signal) put the work between others.
    ///
    /// # Errors
    /// [`DeviceError::Feature`] or [`DeviceError::Limit`] with the name of what the device lacks, [`DeviceError::Vulkan`] if a call fails.
    ///
    /// # Safety
    /// - The handles are what their fields say, and outlive the `VulkanDevice`.
    /// - The device was created with the required features ([`KernelFeatures`](super::KernelFeatures)), and with 64-bit atomics if the
    ///   field says so.
    /// - Nobody else uses the queue while a method of the `VulkanDevice` runs.
    pub unsafe fn from_raw(raw: RawVulkan) -> Result<Self, DeviceError> {
        let RawVulkan { instance, physical_device, device, queue, queue_family, atomics_64, cache_folder } = raw;
        let instance = Instance::of_caller(instance);
        let physical = PhysicalDevice::of_caller(&instance, physical_device, queue_family);
        let device = LogicalDevice::of_caller(instance.raw(), physical, device, queue, atomics_64)?;
        Self::over(device, Access::WherePossible, true, cache_folder.as_deref())
    }

    /// A buffer of the caller's, from byte `offset` on, as one of `length` elements of `element_bytes` bytes: for uploads, downloads,
    /// recordings, or as the nodes of a [`DeviceTree`](crate::build::DeviceTree). [`Device::free`](crate::device::Device::free) forgets it.
    ///
    /// # Errors
    /// [`DeviceError::Buffer`] if offset or size are no multiples of what they must be, [`DeviceError::Limit`] if it is too long.
    ///
    /// # Safety
    /// - The buffer is of this device, holds so many bytes, and has memory. Its usage has `STORAGE_BUFFER`, `TRANSFER_SRC` and `TRANSFER_DST`.
    /// - It is shared, or belongs to the family of the queue.
    /// - It lives until it is freed here. Its bytes are no other's while a method of the `VulkanDevice` runs, and
    ///   writes of others have ended or are waited for ([`wait_for`](Self::wait_for)).
    pub unsafe fn adopt(
        &mut self,
        label: &'static str,
        (buffer, offset): (vk::Buffer, u64),
        length: usize,
        element_bytes: usize,
    ) -> Result<Buffer, DeviceError> {
        self.buffers.adopt(label, (buffer, offset), length, element_bytes)
    }

    /// The next work on the queue starts after a semaphore: a binary one with value 0, or a timeline semaphore that has reached `value`. An upload of more than 4 MiB
    /// is work as well, and waits for its end: what is to be signalled after it must be so from another thread.
    ///
    /// # Safety
    /// The semaphore is of this device and lives until the next work has ended; somebody signals it.
    pub unsafe fn wait_for(&mut self, semaphore: vk::Semaphore, value: u64) {
        self.submitter.wait_for(semaphore, value);
    }

    /// Signals a semaphore after all work so far: a binary one with value 0, or a timeline semaphore to `value`.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Safety
    /// The semaphore is of this device, lives, and can be signalled so.
    pub unsafe fn signal(&mut self, semaphore: vk::Semaphore, value: u64) -> Result<(), DeviceError> {
        let done = self.submitter.signal(semaphore, value);
        self.validated(done)
    }
}

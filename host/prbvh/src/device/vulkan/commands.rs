//! A command buffer that is recorded again and again.

use super::error::Call;
use super::logical::LogicalDevice;
use super::objects::{CommandPool, Fence};
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;

/// A command buffer, and the fence of its submissions. One at a time may be under way.
pub(super) struct Commands {
    pool: CommandPool,
    buffer: vk::CommandBuffer,
    fence: Fence,
}

impl Commands {
    /// Commands for the queue of the device.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.physical().queue_family);
        // SAFETY: the device has a queue of this family.
        let pool = unsafe { CommandPool::new(device, &info) }?;
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool.raw())
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool is alive; it frees the command buffer at its end.
        let buffer = unsafe { device.raw().allocate_command_buffers(&info) }.call("vkAllocateCommandBuffers")?[0];
        // SAFETY: a fence takes no parameters.
        let fence = unsafe { Fence::new(device, &vk::FenceCreateInfo::default()) }?;
        Ok(Self { pool, buffer, fence })
    }

    /// What commands are recorded into.
    pub(super) fn buffer(&self) -> vk::CommandBuffer {
        self.buffer
    }

    /// Signalled when a submission has ended.
    pub(super) fn fence(&self) -> vk::Fence {
        self.fence.raw()
    }

    /// Records anew.
    ///
    /// # Safety
    /// The last submission has ended.
    pub(super) unsafe fn record(
        &self,
        device: &ash::Device,
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), DeviceError> {
        // SAFETY: the caller's duty.
        unsafe { device.reset_command_pool(self.pool.raw(), vk::CommandPoolResetFlags::empty()) }
            .call("vkResetCommandPool")?;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer was just reset.
        unsafe { device.begin_command_buffer(self.buffer, &info) }.call("vkBeginCommandBuffer")?;
        record(self.buffer);
        // SAFETY: the command buffer is being recorded.
        unsafe { device.end_command_buffer(self.buffer) }.call("vkEndCommandBuffer")?;
        // SAFETY: the fence is not in use, as the caller sees to.
        unsafe { device.reset_fences(&[self.fence.raw()]) }.call("vkResetFences")
    }
}

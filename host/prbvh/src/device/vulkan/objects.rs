//! Vulkan objects that destroy themselves. Each holds the device that it was made from.

use super::error::Call;
use super::logical::LogicalDevice;
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;

macro_rules! object {
    ($(#[$doc:meta])* $name:ident: $info:ty, $create:ident = $call:literal, $destroy:ident) => {
        $(#[$doc])*
        pub(super) struct $name {
            raw: vk::$name,
            device: Arc<LogicalDevice>,
        }

        impl $name {
            /// # Safety
            /// `info` must be valid for this device; the objects that it names must live as long as Vulkan demands.
            pub(super) unsafe fn new(device: &Arc<LogicalDevice>, info: &$info) -> Result<Self, DeviceError> {
                // SAFETY: the caller's duty.
                let raw = unsafe { device.raw().$create(info, None) }.call($call)?;
                Ok(Self { raw, device: Arc::clone(device) })
            }

            /// The handle, valid as long as `self` lives.
            pub(super) fn raw(&self) -> vk::$name {
                self.raw
            }
        }

        impl Drop for $name {
            fn drop(&mut self) {
                // SAFETY: made from this device, nobody else owns it, and the device does no work between two calls.
                self.device.release(|device| unsafe { device.$destroy(self.raw, None) });
            }
        }
    };
}

object!(
    /// Says when work on the queue has ended.
    Fence: vk::FenceCreateInfo<'_>, create_fence = "vkCreateFence", destroy_fence
);
object!(
    /// Memory of command buffers.
    CommandPool: vk::CommandPoolCreateInfo<'_>, create_command_pool = "vkCreateCommandPool", destroy_command_pool
);
object!(
    /// Timestamps.
    QueryPool: vk::QueryPoolCreateInfo<'_>, create_query_pool = "vkCreateQueryPool", destroy_query_pool
);
object!(
    /// Memory of descriptor sets.
    DescriptorPool: vk::DescriptorPoolCreateInfo<'_>,
    create_descriptor_pool = "vkCreateDescriptorPool", destroy_descriptor_pool
);
object!(
    /// What a descriptor set holds.
    DescriptorSetLayout: vk::DescriptorSetLayoutCreateInfo<'_>,
    create_descriptor_set_layout = "vkCreateDescriptorSetLayout", destroy_descriptor_set_layout
);
object!(
    /// Descriptor sets and push constants of a pipeline.
    PipelineLayout: vk::PipelineLayoutCreateInfo<'_>,
    create_pipeline_layout = "vkCreatePipelineLayout", destroy_pipeline_layout
);
object!(
    /// Compiled pipelines.
    PipelineCache: vk::PipelineCacheCreateInfo<'_>,
    create_pipeline_cache = "vkCreatePipelineCache", destroy_pipeline_cache
);
object!(
    /// SPIR-V.
    ShaderModule: vk::ShaderModuleCreateInfo<'_>, create_shader_module = "vkCreateShaderModule", destroy_shader_module
);
object!(
    /// A buffer without its memory.
    Buffer: vk::BufferCreateInfo<'_>, create_buffer = "vkCreateBuffer", destroy_buffer
);

/// A compute pipeline.
pub(super) struct Pipeline {
    raw: vk::Pipeline,
    device: Arc<LogicalDevice>,
}

impl Pipeline {
    /// # Safety
    /// `info` and `cache` must be valid for this device.
    pub(super) unsafe fn new(
        device: &Arc<LogicalDevice>,
        cache: &PipelineCache,
        info: vk::ComputePipelineCreateInfo<'_>,
    ) -> Result<Self, DeviceError> {
        // SAFETY: the caller's duty.
        let pipelines = unsafe { device.raw().create_compute_pipelines(cache.raw(), &[info], None) };
        // A pipeline of a failed call is null and needs no end.
        let pipelines = pipelines.map_err(|(_, result)| result).call("vkCreateComputePipelines")?;
        Ok(Self { raw: pipelines[0], device: Arc::clone(device) })
    }

    /// The handle, valid as long as `self` lives.
    pub(super) fn raw(&self) -> vk::Pipeline {
        self.raw
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: made from this device, nobody else owns it, and the device does no work between two calls.
        self.device.release(|device| unsafe { device.destroy_pipeline(self.raw, None) });
    }
}

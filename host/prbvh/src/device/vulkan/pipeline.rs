//! Pipelines of the kernels, made when they are first used: those of a recording side by side.

use super::cache::StoredCache;
use super::logical::LogicalDevice;
use super::messages;
use super::objects::{DescriptorSetLayout, Pipeline, PipelineCache, PipelineLayout, ShaderModule};
use super::shaders;
use crate::device::DeviceError;
use ash::vk;
use prbvh_kernel::{Kernel, KernelInfo};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::ffi::CString;
use std::sync::Arc;

/// The pipelines made so far.
pub(super) struct Pipelines {
    device: Arc<LogicalDevice>,
    cache: StoredCache,
    made: HashMap<Kernel, KernelPipeline>,
}

/// What a dispatch binds, valid as long as the [`Pipelines`] live.
#[derive(Clone, Copy)]
pub(super) struct Handles {
    pub(super) pipeline: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) set_layout: vk::DescriptorSetLayout,
}

impl Pipelines {
    /// None made yet.
    pub(super) fn new(device: &Arc<LogicalDevice>, cache: StoredCache) -> Self {
        Self { device: Arc::clone(device), cache, made: HashMap::new() }
    }

    /// Makes the pipelines of these kernels that there are not yet, on all threads.
    pub(super) fn make(&mut self, kernels: impl Iterator<Item = Kernel>) -> Result<(), DeviceError> {
        let missing: BTreeSet<Kernel> = kernels.filter(|kernel| !self.made.contains_key(kernel)).collect();
        if missing.is_empty() {
            return Ok(());
        }
        // Vulkan lets many threads use a cache that it synchronises itself.
        let (device, cache) = (&self.device, self.cache.for_new_pipelines());
        let make = |kernel| {
            let made = KernelPipeline::new(device, cache, kernel, vk::PipelineCreateFlags::empty());
            // The validation layer spoke to the thread that made it.
            messages::check()?;
            Ok((kernel, made?))
        };
        let made = missing.into_par_iter().map(make).collect::<Result<Vec<_>, DeviceError>>()?;
        self.made.extend(made);
        Ok(())
    }

    /// The pipeline of a kernel.
    pub(super) fn get(&mut self, kernel: Kernel) -> Result<Handles, DeviceError> {
        self.make(std::iter::once(kernel))?;
        Ok(self.made[&kernel].handles())
    }

    /// The kernels whose pipelines were made.
    #[cfg(test)]
    pub(super) fn made(&self) -> BTreeSet<Kernel> {
        self.made.keys().copied().collect()
    }
}

/// The pipeline of a kernel, and what it was made with.
pub(super) struct KernelPipeline {
    pipeline: Pipeline,
    layout: PipelineLayout,
    set_layout: DescriptorSetLayout,
}

impl KernelPipeline {
    /// A new pipeline.
    pub(super) fn new(
        device: &Arc<LogicalDevice>,
        cache: &PipelineCache,
        kernel: Kernel,
        flags: vk::PipelineCreateFlags,
    ) -> Result<Self, DeviceError> {
        let info = kernel.info();
        let words = shaders::words(kernel);
        if shaders::is_of_wide_words(&words) && !device.atomics_64() {
            return Err(DeviceError::Feature {
                what: format!("kernel {}", info.name),
                name: "shaderInt64 with shaderBufferInt64Atomics",
                device: device.physical().summary.name.clone(),
            });
        }

        let set_layout = set_layout(device, info)?;
        let layout = layout(device, info, &set_layout)?;
        // SAFETY: the module was checked by spirv-val when it was made, and the device has its capabilities.
        let module = unsafe { ShaderModule::new(device, &vk::ShaderModuleCreateInfo::default().code(&words)) }?;
        let entry_point = CString::from_vec_with_nul(format!("{}\0", info.name).into_bytes()).unwrap_or_default();
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module.raw())
            .name(&entry_point);
        let create_info = vk::ComputePipelineCreateInfo::default().flags(flags).stage(stage).layout(layout.raw());
        // SAFETY: the entry point is in the module, whose bindings and push constants are those of the layout.
        let pipeline = unsafe { Pipeline::new(device, cache, create_info) }?;
        tracing::debug!("made the pipeline of {}", info.name);
        Ok(Self { pipeline, layout, set_layout })
    }

    /// Valid as long as `self` lives.
    pub(super) fn handles(&self) -> Handles {
        Handles { pipeline: self.pipeline.raw(), layout: self.layout.raw(), set_layout: self.set_layout.raw() }
    }
}

fn set_layout(device: &Arc<LogicalDevice>, info: &KernelInfo) -> Result<DescriptorSetLayout, DeviceError> {
    let bindings: Vec<_> = (0u32..)
        .zip(info.bindings)
        .map(|(binding, _)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: each binding once, and no more of them than the limits allow, which `open` checked.
    unsafe { DescriptorSetLayout::new(device, &info) }
}

fn layout(
    device: &Arc<LogicalDevice>,
    info: &KernelInfo,
    set_layout: &DescriptorSetLayout,
) -> Result<PipelineLayout, DeviceError> {
    let set_layouts = [set_layout.raw()];
    let push =
        [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(info.push_bytes as u32)];
    let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts).push_constant_ranges(&push);
    // SAFETY: the set layout is alive, and the push constants fit the limits, which `open` checked.
    unsafe { PipelineLayout::new(device, &info) }
}

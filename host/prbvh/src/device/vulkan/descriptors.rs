//! The buffers that dispatches see.

use super::error::Call;
use super::logical::LogicalDevice;
use super::memory::Range;
use super::objects::DescriptorPool;
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;

/// Buffers of a dispatch: its set layout, and the buffers in the order of the bindings.
#[derive(PartialEq)]
pub(super) struct Bindings {
    pub(super) layout: vk::DescriptorSetLayout,
    pub(super) buffers: Vec<Range>,
}

/// Memory of the descriptor sets of one run, used again by the next.
pub(super) struct DescriptorSets {
    device: Arc<LogicalDevice>,
    pool: DescriptorPool,
    capacity: Capacity,
}

#[derive(Clone, Copy)]
struct Capacity {
    sets: u32,
    descriptors: u32,
}

impl DescriptorSets {
    /// Room for a short run.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        let capacity = Capacity { sets: 64, descriptors: 256 };
        Ok(Self { device: Arc::clone(device), pool: pool(device, capacity)?, capacity })
    }

    /// A set for each of the bindings, valid until the next call. The layouts and buffers must be alive, the device at rest.
    pub(super) fn make(&mut self, dispatches: &[Bindings]) -> Result<Vec<vk::DescriptorSet>, DeviceError> {
        if dispatches.is_empty() {
            return Ok(Vec::new());
        }
        let descriptors: usize = dispatches.iter().map(|dispatch| dispatch.buffers.len()).sum();
        self.reset(Capacity { sets: dispatches.len() as u32, descriptors: descriptors as u32 })?;

        let layouts: Vec<_> = dispatches.iter().map(|dispatch| dispatch.layout).collect();
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.pool.raw()).set_layouts(&layouts);
        // SAFETY: the layouts are alive, and the pool was just reset with room for all.
        let sets = unsafe { self.device.raw().allocate_descriptor_sets(&info) }.call("vkAllocateDescriptorSets")?;
        for (&set, dispatch) in sets.iter().zip(dispatches) {
            self.write(set, &dispatch.buffers);
        }
        Ok(sets)
    }

    fn reset(&mut self, need: Capacity) -> Result<(), DeviceError> {
        if need.sets > self.capacity.sets || need.descriptors > self.capacity.descriptors {
            let grown = |need: u32, have: u32| need.max(have).checked_next_power_of_two().unwrap_or(need);
            let capacity = Capacity {
                sets: grown(need.sets, self.capacity.sets),
                descriptors: grown(need.descriptors, self.capacity.descriptors),
            };
            self.pool = pool(&self.device, capacity)?;
            self.capacity = capacity;
            return Ok(());
        }
        // SAFETY: the run that used the sets has ended.
        unsafe { self.device.raw().reset_descriptor_pool(self.pool.raw(), vk::DescriptorPoolResetFlags::empty()) }
            .call("vkResetDescriptorPool")
    }

    fn write(&self, set: vk::DescriptorSet, buffers: &[Range]) {
        let infos: Vec<_> = buffers
            .iter()
            // A kernel sees as many elements as the range holds. A range is never empty.
            .map(|&Range { buffer, offset, bytes }| vk::DescriptorBufferInfo { buffer, offset, range: bytes.max(1) })
            .collect();
        // The bindings are numbered from 0, so one write runs through all of them.
        let writes = [vk::WriteDescriptorSet::default()
            .dst_set(set)
            .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
            .buffer_info(&infos)];
        // SAFETY: set and buffers are alive, no work uses the set yet, and each range lies in its buffer.
        unsafe { self.device.raw().update_descriptor_sets(&writes, &[]) };
    }
}

fn pool(device: &Arc<LogicalDevice>, capacity: Capacity) -> Result<DescriptorPool, DeviceError> {
    let sizes = [vk::DescriptorPoolSize::default()
        .ty(vk::DescriptorType::STORAGE_BUFFER)
        .descriptor_count(capacity.descriptors)];
    let info = vk::DescriptorPoolCreateInfo::default().max_sets(capacity.sets).pool_sizes(&sizes);
    // SAFETY: counts above 0 of a type that every device has.
    unsafe { DescriptorPool::new(device, &info) }
}

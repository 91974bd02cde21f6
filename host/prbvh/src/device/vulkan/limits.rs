//! What a Vulkan device is, and whether the kernels can run on it.

use super::instance::{API_VERSION, Instance};
use crate::device::{DeviceError, DeviceInfo, DeviceKind};
use ash::vk;
use prbvh_kernel::{Kernel, grid};
use std::fmt;

/// A Vulkan device as `prbvh devices` shows it.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct DeviceSummary {
    /// Number by which it can be chosen.
    pub index: usize,
    /// Name as the driver gives it.
    pub name: String,
    /// `discrete-gpu`, `integrated-gpu`, `virtual-gpu`, `cpu` or `other`.
    pub device_type: &'static str,
    /// Driver and its version.
    pub driver: String,
    /// Vulkan version, as in `1.3.230`.
    pub api_version: String,
    /// Largest part of a buffer that a kernel sees, bytes.
    pub max_storage_buffer_range: u64,
    /// Largest allocation, bytes; 0 where it is not known.
    pub max_memory_allocation_size: u64,
    /// Allocations at a time.
    pub max_memory_allocation_count: u32,
    /// Largest heap of the device's own memory, bytes.
    pub heap_bytes: u64,
    /// Workgroups of a dispatch along x, y, z.
    pub max_compute_work_group_count: [u32; 3],
    /// Bytes of push constants.
    pub max_push_constants_size: u32,
    /// Storage buffers of a kernel.
    pub max_per_stage_descriptor_storage_buffers: u32,
    /// Whether locks can be 64-bit words: `shaderBufferInt64Atomics` and `shaderInt64`.
    pub shader_buffer_int64_atomics: bool,
    /// Invocations that run in lockstep; 0 where it is not known.
    pub subgroup_size: u32,
    /// What the kernels need and the device lacks; empty where they run.
    pub missing: Vec<Missing>,
}

/// Something that the kernels need and a device lacks.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Missing {
    /// A feature, by its name.
    Feature(&'static str),
    /// A limit that is too small.
    Limit {
        /// Name of the limit.
        name: &'static str,
        /// What is needed.
        need: u64,
        /// What the device has.
        have: u64,
    },
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Feature(name) => write!(f, "{name}"),
            Self::Limit { name, need, have } => write!(f, "{name} of at least {need} (it is {have})"),
        }
    }
}

impl DeviceSummary {
    /// Whether prbvh can run on it.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.missing.is_empty()
    }

    /// Fails with the first thing that is missing.
    pub(super) fn require_usable(&self) -> Result<(), DeviceError> {
        let (what, device) = ("prbvh".to_owned(), self.name.clone());
        match self.missing.first() {
            None => Ok(()),
            Some(&Missing::Feature(name)) => Err(DeviceError::Feature { what, name, device }),
            Some(&Missing::Limit { name, need, have }) => Err(DeviceError::Limit { what, name, need, have, device }),
        }
    }
}

/// A device that has not been opened.
pub(super) struct PhysicalDevice {
    pub(super) raw: vk::PhysicalDevice,
    pub(super) summary: DeviceSummary,
    pub(super) properties: vk::PhysicalDeviceProperties,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    /// Family of the queue that runs the kernels; 0 where [`DeviceSummary::missing`] names the lack of one.
    pub(super) queue_family: u32,
    /// Bits of that queue's timestamps; 0 where it has none.
    pub(super) timestamp_bits: u32,
}

impl PhysicalDevice {
    /// Every device, in the order of the drivers.
    pub(super) fn all(instance: &Instance) -> Result<Vec<Self>, DeviceError> {
        let devices = instance.physical_devices()?;
        Ok(devices.into_iter().enumerate().map(|(index, raw)| Self::survey(instance, index, raw)).collect())
    }

    /// The device of a caller whose queue is of `family`.
    pub(super) fn of_caller(instance: &Instance, raw: vk::PhysicalDevice, family: u32) -> Self {
        let mut device = Self::survey(instance, 0, raw);
        // SAFETY: `raw` comes from this instance.
        let families = unsafe { instance.raw().get_physical_device_queue_family_properties(raw) };
        match families.get(family as usize) {
            Some(its) if its.queue_flags.contains(vk::QueueFlags::COMPUTE) => {
                device.queue_family = family;
                device.timestamp_bits = its.timestamp_valid_bits;
            }
            _ => device.summary.missing.push(Missing::Feature("compute in the family of the queue")),
        }
        device
    }

    /// What a device of the instance is.
    pub(super) fn survey(instance: &Instance, index: usize, raw: vk::PhysicalDevice) -> Self {
        // SAFETY: `raw` comes from this instance.
        let properties = unsafe { instance.raw().get_physical_device_properties(raw) };
        // SAFETY: as above.
        let memory = unsafe { instance.raw().get_physical_device_memory_properties(raw) };
        // SAFETY: as above.
        let families = unsafe { instance.raw().get_physical_device_queue_family_properties(raw) };
        let details = Details::of(instance, raw, &properties);
        let queue = compute_queue(&families);

        let limits = &properties.limits;
        let mut summary = DeviceSummary {
            index,
            name: text(properties.device_name_as_c_str()),
            device_type: type_name(properties.device_type),
            driver: details.driver,
            api_version: version(properties.api_version),
            max_storage_buffer_range: limits.max_storage_buffer_range.into(),
            max_memory_allocation_size: details.max_memory_allocation_size,
            max_memory_allocation_count: limits.max_memory_allocation_count,
            heap_bytes: largest_heap(&memory),
            max_compute_work_group_count: limits.max_compute_work_group_count,
            max_push_constants_size: limits.max_push_constants_size,
            max_per_stage_descriptor_storage_buffers: limits.max_per_stage_descriptor_storage_buffers,
            shader_buffer_int64_atomics: details.int64_atomics,
            subgroup_size: details.subgroup_size,
            missing: Vec::new(),
        };
        let features = [
            ("Vulkan 1.2", properties.api_version >= API_VERSION),
            ("a compute queue", queue.is_some()),
            ("vulkanMemoryModel", details.vulkan_memory_model),
        ];
        summary.missing.extend(features.iter().filter(|(_, has)| !has).map(|&(name, _)| Missing::Feature(name)));
        summary.missing.extend(missing_limits(limits));
        let (queue_family, timestamp_bits) = queue.unwrap_or_default();
        Self { raw, summary, properties, memory, queue_family, timestamp_bits }
    }

    /// Smaller is better: discrete, integrated, virtual, CPU.
    pub(super) fn rank(&self) -> u32 {
        match self.properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => 0,
            vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
            vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
            vk::PhysicalDeviceType::CPU => 3,
            _ => 4,
        }
    }

    /// What algorithms need to know, where `atomics_64` of the device are in use or not.
    pub(super) fn info(&self, atomics_64: bool) -> DeviceInfo {
        let summary = &self.summary;
        let (max_buffer_bytes, max_buffer_limit) =
            if summary.max_storage_buffer_range <= summary.max_memory_allocation_size {
                (summary.max_storage_buffer_range, "maxStorageBufferRange")
            } else {
                (summary.max_memory_allocation_size, "maxMemoryAllocationSize")
            };
        let is_cpu = self.properties.device_type == vk::PhysicalDeviceType::CPU;
        DeviceInfo {
            name: summary.name.clone(),
            kind: if is_cpu { DeviceKind::VulkanCpu } else { DeviceKind::VulkanGpu },
            driver: format!("{}, Vulkan {}", summary.driver, summary.api_version),
            max_buffer_bytes,
            max_buffer_limit,
            memory_bytes: summary.heap_bytes,
            atomics_64,
            busy_invocations: busy_invocations(self.properties.device_type),
            kernel_buffers: summary
                .max_per_stage_descriptor_storage_buffers
                .min(self.properties.limits.max_descriptor_set_storage_buffers),
        }
    }
}

/// Vulkan does not tell how many cores a device has, so this is what the largest of each kind hold at a time.
fn busy_invocations(device_type: vk::PhysicalDeviceType) -> u32 {
    match device_type {
        vk::PhysicalDeviceType::INTEGRATED_GPU => 1 << 15,
        vk::PhysicalDeviceType::CPU => {
            // A thread takes a workgroup at a time; four for each even out their ends.
            let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get().min(1024) as u32);
            threads * 4 * grid::WORKGROUP_SIZE
        }
        _ => 1 << 18,
    }
}

/// What Vulkan 1.2 tells of a device beyond Vulkan 1.0.
#[derive(Default)]
struct Details {
    driver: String,
    max_memory_allocation_size: u64,
    subgroup_size: u32,
    vulkan_memory_model: bool,
    int64_atomics: bool,
}

impl Details {
    fn of(instance: &Instance, raw: vk::PhysicalDevice, properties: &vk::PhysicalDeviceProperties) -> Self {
        let driver_version = properties.driver_version;
        if properties.api_version < API_VERSION {
            return Self { driver: format!("version {driver_version:#x}"), ..Self::default() };
        }

        let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
        let mut v12 = vk::PhysicalDeviceVulkan12Properties::default();
        let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut v11).push_next(&mut v12);
        // SAFETY: a device of Vulkan 1.2 knows every structure of the chain.
        unsafe { instance.raw().get_physical_device_properties2(raw, &mut chain) };

        let mut features_12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut features_12);
        // SAFETY: as above.
        unsafe { instance.raw().get_physical_device_features2(raw, &mut features) };
        let shader_int64 = features.features.shader_int64 == vk::TRUE;

        Self {
            driver: format!("{} {}", text(v12.driver_name_as_c_str()), text(v12.driver_info_as_c_str())),
            max_memory_allocation_size: v11.max_memory_allocation_size,
            subgroup_size: v11.subgroup_size,
            vulkan_memory_model: features_12.vulkan_memory_model == vk::TRUE,
            int64_atomics: shader_int64 && features_12.shader_buffer_int64_atomics == vk::TRUE,
        }
    }
}

/// Index and timestamp bits of the first family of compute queues that keeps the time, else of the first at all.
fn compute_queue(families: &[vk::QueueFamilyProperties]) -> Option<(u32, u32)> {
    let compute = || {
        (0u32..)
            .zip(families)
            .filter(|(_, family)| family.queue_count > 0 && family.queue_flags.contains(vk::QueueFlags::COMPUTE))
            .map(|(index, family)| (index, family.timestamp_valid_bits))
    };
    compute().find(|&(_, bits)| bits > 0).or_else(|| compute().next())
}

/// Limits that the kernels of the table need, whatever the scene.
fn missing_limits(limits: &vk::PhysicalDeviceLimits) -> impl Iterator<Item = Missing> {
    let kernels = || Kernel::ALL.iter().map(|kernel| kernel.info());
    let push_bytes = kernels().map(|kernel| kernel.push_bytes).max().unwrap_or(0) as u64;
    // What this one does, others of fewer buffers do, too (`DeviceInfo::kernel_buffers`).
    let tail = Kernel::WorstTail.info().name;
    let buffers =
        kernels().filter(|kernel| kernel.name != tail).map(|kernel| kernel.bindings.len()).max().unwrap_or(0) as u64;
    let shared_bytes = kernels().map(|kernel| kernel.shared_bytes).max().unwrap_or(0) as u64;
    let [groups_x, groups_y, _] = grid::workgroups(u32::MAX);
    let [max_groups_x, max_groups_y, _] = limits.max_compute_work_group_count;
    [
        ("maxPushConstantsSize", push_bytes, limits.max_push_constants_size),
        ("maxPerStageDescriptorStorageBuffers", buffers, limits.max_per_stage_descriptor_storage_buffers),
        ("maxDescriptorSetStorageBuffers", buffers, limits.max_descriptor_set_storage_buffers),
        ("maxComputeSharedMemorySize", shared_bytes, limits.max_compute_shared_memory_size),
        ("maxComputeWorkGroupInvocations", grid::WORKGROUP_SIZE.into(), limits.max_compute_work_group_invocations),
        ("maxComputeWorkGroupSize[0]", grid::WORKGROUP_SIZE.into(), limits.max_compute_work_group_size[0]),
        ("maxComputeWorkGroupCount[0]", groups_x.into(), max_groups_x),
        ("maxComputeWorkGroupCount[1]", groups_y.into(), max_groups_y),
    ]
    .into_iter()
    .map(|(name, need, have)| (name, need, u64::from(have)))
    .filter(|&(_, need, have)| have < need)
    .map(|(name, need, have)| Missing::Limit { name, need, have })
}

fn largest_heap(memory: &vk::PhysicalDeviceMemoryProperties) -> u64 {
    memory
        .memory_heaps_as_slice()
        .iter()
        .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
        .map(|heap| heap.size)
        .max()
        .unwrap_or(0)
}

fn type_name(device_type: vk::PhysicalDeviceType) -> &'static str {
    match device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => "discrete-gpu",
        vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated-gpu",
        vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual-gpu",
        vk::PhysicalDeviceType::CPU => "cpu",
        _ => "other",
    }
}

fn version(packed: u32) -> String {
    let (major, minor) = (vk::api_version_major(packed), vk::api_version_minor(packed));
    format!("{major}.{minor}.{}", vk::api_version_patch(packed))
}

/// What a driver calls something.
pub(super) fn text(name: Result<&std::ffi::CStr, std::ffi::FromBytesUntilNulError>) -> String {
    name.map_or_else(|_| "unnamed".to_owned(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn family(queue_flags: vk::QueueFlags, timestamp_valid_bits: u32) -> vk::QueueFamilyProperties {
        vk::QueueFamilyProperties { queue_flags, timestamp_valid_bits, queue_count: 1, ..Default::default() }
    }

    #[test]
    fn the_queue_computes_and_keeps_the_time_if_it_can() {
        let (graphics, compute) = (vk::QueueFlags::GRAPHICS, vk::QueueFlags::COMPUTE);
        let families = [family(graphics, 64), family(compute, 0), family(graphics | compute, 36)];
        assert_eq!(compute_queue(&families), Some((2, 36)));
        assert_eq!(compute_queue(&families[..2]), Some((1, 0)));
        assert_eq!(compute_queue(&families[..1]), None);
    }

    #[test]
    fn missing_limits_are_named() {
        let least = vk::PhysicalDeviceLimits {
            max_push_constants_size: 128,
            // Vulkan promises 4, but no driver has less than 8.
            max_per_stage_descriptor_storage_buffers: 8,
            max_descriptor_set_storage_buffers: 24,
            max_compute_shared_memory_size: 16_384,
            max_compute_work_group_invocations: 128,
            max_compute_work_group_size: [128, 128, 64],
            max_compute_work_group_count: [65_535; 3],
            ..Default::default()
        };
        assert_eq!(
            missing_limits(&least).count(),
            0,
            "what Vulkan promises is enough for the grid, its workgroups and the push constants"
        );

        let poor = vk::PhysicalDeviceLimits { max_per_stage_descriptor_storage_buffers: 1, ..least };
        let missing: Vec<_> = missing_limits(&poor).collect();
        let [Missing::Limit { name: "maxPerStageDescriptorStorageBuffers", need, have: 1 }] = missing[..] else {
            panic!("{missing:?}")
        };
        let most = Kernel::ALL
            .iter()
            .filter(|&&kernel| kernel != Kernel::WorstTail)
            .map(|kernel| kernel.info().bindings.len());
        assert_eq!(need, most.max().unwrap() as u64);
        assert!(missing[0].to_string().ends_with(&format!("of at least {need} (it is 1)")));

        let poor = vk::PhysicalDeviceLimits { max_compute_shared_memory_size: 1024, ..least };
        let missing: Vec<_> = missing_limits(&poor).collect();
        let [Missing::Limit { name: "maxComputeSharedMemorySize", need, have: 1024 }] = missing[..] else {
            panic!("{missing:?}")
        };
        assert_eq!(need, Kernel::ALL.iter().map(|kernel| kernel.info().shared_bytes as u64).max().unwrap());
    }
}

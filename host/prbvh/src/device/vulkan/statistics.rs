//! What a driver says of the code that it made of the kernels (`VK_KHR_pipeline_executable_properties`).

use super::cache::StoredCache;
use super::error::Call;
use super::instance::Instance;
use super::limits::{PhysicalDevice, text};
use super::logical::LogicalDevice;
use super::pipeline::KernelPipeline;
use super::selection::select;
use super::{messages, needs_atomics_64};
use crate::device::{DeviceError, DeviceInfo, Selection};
use ash::{khr, vk};
use prbvh_kernel::Kernel;
use rayon::prelude::*;

/// What became of a kernel.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct KernelStatistics {
    /// Name of the kernel.
    pub kernel: &'static str,
    /// What it was compiled to, as far as the driver tells: some compile a kernel for several widths.
    pub executables: Vec<Executable>,
}

/// Code of a device.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Executable {
    /// Its name, as the driver gives it.
    pub name: String,
    /// Invocations in lockstep; 0 where the driver does not tell.
    pub subgroup_size: u32,
    /// Registers, spills, instructions and the like: each driver has others.
    pub statistics: Vec<Statistic>,
}

/// A number of an [`Executable`].
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Statistic {
    /// Its name, as the driver gives it.
    pub name: String,
    /// What it means.
    pub description: String,
    /// The number.
    pub value: StatisticValue,
}

/// A number in the form that the driver gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(untagged))]
#[allow(missing_docs, reason = "the names say it")]
pub enum StatisticValue {
    Bool(bool),
    Signed(i64),
    Unsigned(u64),
    Float(f64),
}

impl std::fmt::Display for StatisticValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Signed(value) => write!(f, "{value}"),
            Self::Unsigned(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
        }
    }
}

/// Compiles all kernels that the device can run and asks what became of them. Nothing runs, and no cache is read or written.
///
/// # Errors
/// [`DeviceError::Feature`] where the driver does not tell, else as [`VulkanDevice::open`](super::VulkanDevice::open).
pub fn kernel_statistics(selection: Selection, validate: bool) -> Result<Vec<KernelStatistics>, DeviceError> {
    let instance = Instance::shared(validate)?;
    let physical = select(PhysicalDevice::all(instance)?, selection)?;
    let device = LogicalDevice::with_statistics(instance, physical)?;
    let functions = khr::pipeline_executable_properties::Device::new(instance.raw(), device.raw());
    let mut cache = StoredCache::open(&device, None)?;
    let cache = cache.for_new_pipelines();
    let statistics = |&kernel: &Kernel| {
        let made = KernelPipeline::new(&device, cache, kernel, vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR);
        let executables = made.and_then(|made| executables(&functions, made.handles().pipeline));
        // The validation layer spoke to this thread.
        messages::check()?;
        Ok(KernelStatistics { kernel: kernel.info().name, executables: executables? })
    };
    let info = device.physical().info(device.atomics_64());
    let is_possible = |kernel: &&Kernel| is_possible(&info, **kernel);
    Kernel::ALL.par_iter().filter(is_possible).map(statistics).collect()
}

/// Whether a device can run a kernel.
fn is_possible(info: &DeviceInfo, kernel: Kernel) -> bool {
    kernel.info().bindings.len() <= info.kernel_buffers as usize && (info.atomics_64 || !needs_atomics_64(kernel))
}

/// Of a pipeline that captured its statistics.
fn executables(
    functions: &khr::pipeline_executable_properties::Device,
    pipeline: vk::Pipeline,
) -> Result<Vec<Executable>, DeviceError> {
    let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
    // SAFETY: the extension and its feature are enabled, and the pipeline is of the device.
    let properties =
        unsafe { functions.get_pipeline_executable_properties(&info) }.call("vkGetPipelineExecutablePropertiesKHR")?;
    let executable = |(index, properties): (u32, &vk::PipelineExecutablePropertiesKHR<'_>)| {
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index);
        // SAFETY: as above, and the pipeline was made to capture its statistics.
        let statistics = unsafe { functions.get_pipeline_executable_statistics(&info) }
            .call("vkGetPipelineExecutableStatisticsKHR")?;
        Ok(Executable {
            name: text(properties.name_as_c_str()),
            subgroup_size: properties.subgroup_size,
            statistics: statistics.iter().map(statistic).collect(),
        })
    };
    (0..).zip(&properties).map(executable).collect()
}

fn statistic(statistic: &vk::PipelineExecutableStatisticKHR<'_>) -> Statistic {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    let value = statistic.value;
    // SAFETY: all variants but the first fill the union, and the first is read only where the format says that it was written.
    let value = unsafe {
        match statistic.format {
            Format::BOOL32 => StatisticValue::Bool(value.b32 == vk::TRUE),
            Format::INT64 => StatisticValue::Signed(value.i64),
            Format::FLOAT64 => StatisticValue::Float(value.f64),
            _ => StatisticValue::Unsigned(value.u64),
        }
    };
    Statistic { name: text(statistic.name_as_c_str()), description: text(statistic.description_as_c_str()), value }
}

#[cfg(test)]
mod tests {
    use super::super::tests::left_out;
    use super::*;

    #[test]
    fn a_number_is_read_in_the_form_that_its_format_says() {
        use vk::{PipelineExecutableStatisticFormatKHR as Format, PipelineExecutableStatisticValueKHR as Value};
        let cases = [
            (Format::BOOL32, Value { b32: vk::TRUE }, StatisticValue::Bool(true), "true"),
            (Format::INT64, Value { i64: -3 }, StatisticValue::Signed(-3), "-3"),
            (Format::UINT64, Value { u64: 1 << 63 }, StatisticValue::Unsigned(1 << 63), "9223372036854775808"),
            (Format::FLOAT64, Value { f64: 0.75 }, StatisticValue::Float(0.75), "0.75"),
        ];
        for (format, value, expected, shown) in cases {
            let given = vk::PipelineExecutableStatisticKHR { format, value, ..Default::default() };
            let given = given.name(c"VGPRs").unwrap().description(c"vector registers").unwrap();
            let Statistic { name, description, value } = statistic(&given);
            assert_eq!((name.as_str(), description.as_str(), value), ("VGPRs", "vector registers", expected));
            assert_eq!(value.to_string(), shown);
        }
    }

    /// All kernels, or the name of the extension that the driver lacks: RADV without hardware has it (`RADV_FORCE_FAMILY=navi21`), lavapipe has not.
    #[test]
    fn a_device_tells_of_all_kernels_or_what_it_lacks() {
        if left_out("a_device_tells_of_all_kernels_or_what_it_lacks") {
            return;
        }
        for device in super::super::list_devices().unwrap() {
            match kernel_statistics(Selection::Index(device.index), true) {
                Err(DeviceError::Feature { name: "VK_KHR_pipeline_executable_properties", device: name, .. }) => {
                    assert_eq!(name, device.name);
                }
                Err(error) => assert!(!device.is_usable(), "{}: {error}", device.name),
                Ok(kernels) => {
                    let all = |kernel: &&Kernel| device.shader_buffer_int64_atomics || !needs_atomics_64(**kernel);
                    let names: Vec<_> = Kernel::ALL.iter().filter(all).map(|kernel| kernel.info().name).collect();
                    assert_eq!(kernels.iter().map(|kernel| kernel.kernel).collect::<Vec<_>>(), names);
                    let silent = |kernel: &&KernelStatistics| {
                        kernel.executables.is_empty()
                            || kernel.executables.iter().any(|code| code.statistics.is_empty())
                    };
                    assert!(kernels.iter().find(silent).is_none());
                }
            }
        }
    }
}

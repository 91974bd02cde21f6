//! Which device to run on: `auto`, `cpu`, `vulkan`, `vulkan:N`.

use super::cpu::CpuDevice;
use super::vulkan::{self, VulkanDevice};
use super::{Device, DeviceError, DeviceKind};
use std::fmt;
use std::str::FromStr;

/// A device by the name that a user gives it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The best Vulkan GPU that the kernels can run on, else the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The best Vulkan device, or one by its number.
    Vulkan(vulkan::Selection),
}

/// A text that names no device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no device: there are auto, cpu, vulkan and vulkan:N with N as `prbvh devices` lists it")]
pub struct NoSuchChoice(String);

impl FromStr for DeviceChoice {
    type Err = NoSuchChoice;

    fn from_str(text: &str) -> Result<Self, NoSuchChoice> {
        match text.split_once(':') {
            None if text == "auto" => Ok(Self::Auto),
            None if text == "cpu" => Ok(Self::Cpu),
            None if text == "vulkan" => Ok(Self::Vulkan(vulkan::Selection::Automatic)),
            Some(("vulkan", index)) if !index.starts_with('+') => {
                let index = index.parse().map_err(|_| NoSuchChoice(text.to_owned()))?;
                Ok(Self::Vulkan(vulkan::Selection::Index(index)))
            }
            _ => Err(NoSuchChoice(text.to_owned())),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Vulkan(vulkan::Selection::Automatic) => f.write_str("vulkan"),
            Self::Vulkan(vulkan::Selection::Index(index)) => write!(f, "vulkan:{index}"),
        }
    }
}

/// Opens a device. `threads` is for the CPU (0: one per core), `validate` turns Vulkan's validation layer on. Says through `tracing`
/// what `auto` chose and why.
///
/// # Errors
/// If there is no such device or it lacks something.
pub fn open(choice: DeviceChoice, threads: usize, validate: bool) -> Result<Box<dyn Device>, DeviceError> {
    match choice {
        DeviceChoice::Cpu => Ok(Box::new(CpuDevice::new(threads)?)),
        DeviceChoice::Vulkan(selection) => Ok(Box::new(VulkanDevice::open(selection, validate)?)),
        DeviceChoice::Auto => match open_gpu(validate) {
            Ok(gpu) => Ok(Box::new(gpu)),
            Err(reason) => {
                tracing::info!("on the CPU: {reason}");
                Ok(Box::new(CpuDevice::new(threads)?))
            }
        },
    }
}

/// The best Vulkan device that is not a CPU in disguise, or why there is none.
fn open_gpu(validate: bool) -> Result<VulkanDevice, String> {
    let device = VulkanDevice::open(vulkan::Selection::Automatic, validate).map_err(|error| error.to_string())?;
    match device.info().kind {
        DeviceKind::VulkanGpu => Ok(device),
        DeviceKind::VulkanCpu | DeviceKind::Cpu => {
            Err(format!("{} is no GPU, and the native kernels are faster", device.info().name))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_read_back_as_written() {
        for text in ["auto", "cpu", "vulkan", "vulkan:0", "vulkan:12"] {
            assert_eq!(text.parse::<DeviceChoice>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn other_texts_are_refused_by_name() {
        for text in ["", "gpu", "vulkan:", "vulkan:x", "vulkan:-1", "vulkan:+1", "cpu:0", "VULKAN"] {
            let error = text.parse::<DeviceChoice>().unwrap_err().to_string();
            assert!(error.contains(&format!("`{text}`")), "{error}");
        }
    }
}

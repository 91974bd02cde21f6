//! Opens a device.

use super::cpu::CpuDevice;
use super::{Device, DeviceChoice, DeviceError, DeviceKind, Selection};

/// Opens a device. `threads` is for the CPU (0: one per core), `validate` turns Vulkan's validation layer on. Says through `tracing`
/// what `auto` chose and why.
///
/// # Errors
/// If there is no such device or it lacks something.
pub fn open(choice: DeviceChoice, threads: usize, validate: bool) -> Result<Box<dyn Device + Send>, DeviceError> {
    match choice {
        DeviceChoice::Cpu => Ok(Box::new(CpuDevice::new(threads)?)),
        DeviceChoice::Vulkan(selection) => vulkan(selection, validate),
        DeviceChoice::Auto => match gpu(validate) {
            Ok(gpu) => Ok(gpu),
            Err(reason) => {
                tracing::info!("on the CPU: {reason}");
                Ok(Box::new(CpuDevice::new(threads)?))
            }
        },
    }
}

#[cfg(feature = "vulkan")]
fn vulkan(selection: Selection, validate: bool) -> Result<Box<dyn Device + Send>, DeviceError> {
    Ok(Box::new(super::vulkan::VulkanDevice::open(selection, validate)?))
}

#[cfg(not(feature = "vulkan"))]
fn vulkan(_: Selection, _: bool) -> Result<Box<dyn Device + Send>, DeviceError> {
    Err(DeviceError::NoDevice("this program was built without the cargo feature `vulkan`".to_owned()))
}

/// The best Vulkan device that is not a CPU in disguise, or why there is none.
fn gpu(validate: bool) -> Result<Box<dyn Device + Send>, String> {
    let device = vulkan(Selection::Automatic, validate).map_err(|error| error.to_string())?;
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
    fn an_opened_device_goes_to_another_thread() {
        let mut device = open(DeviceChoice::Cpu, 1, false).unwrap();
        let there = std::thread::spawn(move || device.allocate("words", 2, 4).map(|buffer| buffer.bytes()));
        assert_eq!(there.join().unwrap().unwrap(), 8);
    }
}

//! Which device to open.

use super::limits::PhysicalDevice;
use crate::device::{DeviceError, Selection};

/// The chosen device; it may lack what prbvh needs.
pub(super) fn select(mut devices: Vec<PhysicalDevice>, selection: Selection) -> Result<PhysicalDevice, DeviceError> {
    let chosen = match selection {
        // Where none is usable, the best of the others says what it lacks when it is opened.
        Selection::Automatic => {
            (0..devices.len()).min_by_key(|&k| (!devices[k].summary.is_usable(), devices[k].rank()))
        }
        Selection::Index(index) => Some(index).filter(|&index| index < devices.len()),
    };
    let list = || {
        let names = devices.iter().map(|device| format!("{}: {}", device.summary.index, device.summary.name));
        names.collect::<Vec<_>>().join(", ")
    };
    match (chosen, selection) {
        (Some(chosen), _) => Ok(devices.swap_remove(chosen)),
        (None, Selection::Index(index)) => {
            Err(DeviceError::NoDevice(format!("there is no Vulkan device {index}; there are {}", list())))
        }
        (None, Selection::Automatic) => Err(DeviceError::NoDevice("there is no Vulkan device".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::super::instance::Instance;
    use super::super::limits::Missing;
    use super::super::tests::left_out;
    use super::*;
    use ash::vk;

    #[test]
    fn the_best_usable_device_is_selected() {
        if left_out("the_best_usable_device_is_selected") {
            return;
        }
        let instance = Instance::shared(false).unwrap();
        let devices = |types: [(vk::PhysicalDeviceType, bool); 3]| -> Vec<PhysicalDevice> {
            (0..3)
                .map(|k| {
                    let mut device = PhysicalDevice::all(instance).unwrap().remove(0);
                    device.summary.index = k;
                    device.properties.device_type = types[k].0;
                    device.summary.missing =
                        if types[k].1 { vec![] } else { vec![Missing::Feature("vulkanMemoryModel")] };
                    device
                })
                .collect()
        };
        use vk::PhysicalDeviceType as T;
        let chosen = |types| select(devices(types), Selection::Automatic).unwrap().summary.index;
        assert_eq!(chosen([(T::CPU, true), (T::DISCRETE_GPU, true), (T::DISCRETE_GPU, true)]), 1);
        assert_eq!(chosen([(T::DISCRETE_GPU, false), (T::CPU, true), (T::INTEGRATED_GPU, true)]), 2);
        let all_lack = select(devices([(T::CPU, false); 3]), Selection::Automatic).unwrap();
        let error = all_lack.summary.require_usable().unwrap_err();
        assert!(matches!(error, DeviceError::Feature { name: "vulkanMemoryModel", .. }), "{error}");
    }
}

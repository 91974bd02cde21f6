//! Asks the Vulkan loader which devices and layers there are. The only file of the tasks with `unsafe`.
#![allow(unsafe_code, reason = "calls of the Vulkan loader; each block states its reason")]

use ash::vk;
use std::ffi::CStr;

/// Names of the devices of all installed drivers.
///
/// # Errors
/// What is missing: the loader, or a driver that it can start.
pub(crate) fn devices() -> Result<Vec<String>, String> {
    // SAFETY: loading runs the initialisers of the system's Vulkan loader, which has none that matter.
    let entry = unsafe { ash::Entry::load() }.map_err(|error| format!("no Vulkan loader: {error}"))?;
    let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_1);
    // SAFETY: `entry` is loaded and no layer is named.
    let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
    let portability = vk::KHR_PORTABILITY_ENUMERATION_NAME;
    let mut names = Vec::new();
    let mut flags = vk::InstanceCreateFlags::empty();
    if extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(portability)) {
        // MoltenVK is listed only to those who ask for drivers that are not quite Vulkan.
        names.push(portability.as_ptr());
        flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
    }
    let info =
        vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(&names).flags(flags);
    // SAFETY: `info` and all that it points to live until after the call.
    let instance = unsafe { entry.create_instance(&info, None) }
        .map_err(|error| format!("a Vulkan loader, but no driver ({error})"))?;
    // SAFETY: `instance` lives.
    let devices = unsafe { instance.enumerate_physical_devices() };
    let names = devices.map(|devices| {
        let name = |&device: &vk::PhysicalDevice| {
            // SAFETY: `device` is of `instance`, which lives.
            let properties = unsafe { instance.get_physical_device_properties(device) };
            properties.device_name_as_c_str().map_or_else(|_| "?".to_owned(), text)
        };
        devices.iter().map(name).collect()
    });
    // SAFETY: nothing made from `instance` is left.
    unsafe { instance.destroy_instance(None) };
    names.map_err(|error| format!("a Vulkan driver that lists no devices ({error})"))
}

/// The name of the validation layer.
///
/// # Errors
/// What is missing: the loader, or the layer.
pub(crate) fn validation_layer() -> Result<String, String> {
    const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
    // SAFETY: loading runs the initialisers of the system's Vulkan loader, which has none that matter.
    let entry = unsafe { ash::Entry::load() }.map_err(|error| format!("no Vulkan loader: {error}"))?;
    // SAFETY: `entry` is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
    if layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(LAYER)) {
        Ok(text(LAYER))
    } else {
        Err(format!("the Vulkan loader does not know {}", text(LAYER)))
    }
}

fn text(name: &CStr) -> String {
    name.to_string_lossy().into_owned()
}

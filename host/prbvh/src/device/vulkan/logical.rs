//! An opened device and its queue.

use super::error::Call;
use super::heap::Heap;
use super::instance::Instance;
use super::limits::PhysicalDevice;
use crate::device::DeviceError;
use ash::{ext, khr, vk};
use std::ffi::{CStr, CString};
use std::mem::ManuallyDrop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// An opened device. Every object made from it holds an `Arc` of it, so it goes last.
pub(super) struct LogicalDevice {
    raw: ash::Device,
    queue: vk::Queue,
    physical: PhysicalDevice,
    atomics_64: bool,
    abandoned: AtomicBool,
    /// Else it is the caller's, who destroys it.
    is_own: bool,
    names: Option<ext::debug_utils::Device>,
    /// Its blocks end before the device does, or never if work was given up on.
    heap: ManuallyDrop<Heap>,
}

impl LogicalDevice {
    /// Opens a device that lacks nothing, with 64-bit atomics if it has them and `atomics_64` allows them.
    pub(super) fn new(
        instance: &Instance,
        physical: PhysicalDevice,
        atomics_64: bool,
    ) -> Result<Arc<Self>, DeviceError> {
        physical.summary.require_usable()?;
        let extensions = Extensions::of(instance, physical.raw)?;
        Self::open(instance, physical, &extensions, atomics_64, false)
    }

    /// Opens a device that tells what became of the kernels: `VK_KHR_pipeline_executable_properties`.
    pub(super) fn with_statistics(instance: &Instance, physical: PhysicalDevice) -> Result<Arc<Self>, DeviceError> {
        physical.summary.require_usable()?;
        let extensions = Extensions::of(instance, physical.raw)?;
        if !tells_statistics(instance, physical.raw, &extensions) {
            return Err(DeviceError::Feature {
                what: "statistics of compiled kernels".to_owned(),
                name: "VK_KHR_pipeline_executable_properties",
                device: physical.summary.name,
            });
        }
        Self::open(instance, physical, &extensions, true, true)
    }

    fn open(
        instance: &Instance,
        physical: PhysicalDevice,
        of_device: &Extensions,
        atomics_64: bool,
        statistics: bool,
    ) -> Result<Arc<Self>, DeviceError> {
        let atomics_64 = atomics_64 && physical.summary.shader_buffer_int64_atomics;
        let mut extensions = Vec::new();
        if of_device.has(khr::portability_subset::NAME) {
            // A device that has this extension must be opened with it.
            extensions.push(khr::portability_subset::NAME.as_ptr());
        }
        if statistics {
            extensions.push(khr::pipeline_executable_properties::NAME.as_ptr());
        }
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(physical.queue_family).queue_priorities(&[1.0])];
        let mut features_12 = vk::PhysicalDeviceVulkan12Features::default()
            .vulkan_memory_model(true)
            .shader_buffer_int64_atomics(atomics_64);
        let mut features = vk::PhysicalDeviceFeatures2::default()
            .features(vk::PhysicalDeviceFeatures::default().shader_int64(atomics_64))
            .push_next(&mut features_12);
        let mut of_statistics =
            vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut features);
        if statistics {
            info = info.push_next(&mut of_statistics);
        }

        // SAFETY: family, features and extensions are those that the device has, and live through the call.
        let raw = unsafe { instance.raw().create_device(physical.raw, &info, None) }.call("vkCreateDevice")?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { raw.get_device_queue(physical.queue_family, 0) };
        let names = instance.is_validated().then(|| ext::debug_utils::Device::new(instance.raw(), &raw));
        let abandoned = AtomicBool::new(false);
        let heap = Heap::new(instance.raw(), &raw, &physical).inspect_err(|_| {
            // SAFETY: new, and nothing was made from it.
            unsafe { raw.destroy_device(None) };
        });
        let heap = ManuallyDrop::new(heap?);
        Ok(Arc::new(Self { raw, queue, physical, atomics_64, abandoned, is_own: true, names, heap }))
    }

    /// A device that the caller opened, if it lacks nothing; with 64-bit atomics if the caller says so.
    pub(super) fn of_caller(
        instance: &ash::Instance,
        physical: PhysicalDevice,
        raw: ash::Device,
        queue: vk::Queue,
        atomics_64: bool,
    ) -> Result<Arc<Self>, DeviceError> {
        physical.summary.require_usable()?;
        let abandoned = AtomicBool::new(false);
        let heap = ManuallyDrop::new(Heap::new(instance, &raw, &physical)?);
        Ok(Arc::new(Self { raw, queue, physical, atomics_64, abandoned, is_own: false, names: None, heap }))
    }

    /// The functions of the device.
    pub(super) fn raw(&self) -> &ash::Device {
        &self.raw
    }

    /// The queue. Only one thread at a time may use it: the `&mut` of the submitter sees to that.
    pub(super) fn queue(&self) -> vk::Queue {
        self.queue
    }

    /// Where memory comes from.
    pub(super) fn heap(&self) -> &Heap {
        &self.heap
    }

    /// What the device is.
    pub(super) fn physical(&self) -> &PhysicalDevice {
        &self.physical
    }

    /// Whether 64-bit integers and atomics are in use.
    pub(super) fn atomics_64(&self) -> bool {
        self.atomics_64
    }

    /// Names an object of this device in the messages of the validation layer.
    pub(super) fn set_name(&self, object: impl vk::Handle, name: &str) -> Result<(), DeviceError> {
        let (Some(names), Ok(name)) = (&self.names, CString::new(name)) else { return Ok(()) };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the extension is enabled, and the object is of this device.
        unsafe { names.set_debug_utils_object_name(&info) }.call("vkSetDebugUtilsObjectNameEXT")
    }

    /// Gives up on work that does not end. The device may use its objects for ever, so none is destroyed any more.
    pub(super) fn abandon(&self) {
        self.abandoned.store(true, Ordering::Relaxed);
    }

    /// Whether work was given up on.
    pub(super) fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Relaxed)
    }

    /// Destroys an object, unless work that may use it was given up on.
    pub(super) fn release(&self, destroy: impl FnOnce(&ash::Device)) {
        if !self.is_abandoned() {
            destroy(&self.raw);
        }
    }
}

impl Drop for LogicalDevice {
    fn drop(&mut self) {
        if self.is_abandoned() {
            return;
        }
        // SAFETY: nobody uses it after this, and every part of its blocks held an `Arc` of the device.
        unsafe { ManuallyDrop::drop(&mut self.heap) };
        if self.is_own {
            // SAFETY: every object of the device held an `Arc` of it and is gone, and no work is left on its queue.
            unsafe { self.raw.destroy_device(None) };
        }
    }
}

/// Extensions of a device.
struct Extensions(Vec<vk::ExtensionProperties>);

impl Extensions {
    fn of(instance: &Instance, device: vk::PhysicalDevice) -> Result<Self, DeviceError> {
        // SAFETY: the device comes from this instance.
        let all = unsafe { instance.raw().enumerate_device_extension_properties(device) };
        all.call("vkEnumerateDeviceExtensionProperties").map(Self)
    }

    fn has(&self, name: &CStr) -> bool {
        self.0.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name))
    }
}

fn tells_statistics(instance: &Instance, device: vk::PhysicalDevice, extensions: &Extensions) -> bool {
    let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
    if extensions.has(khr::pipeline_executable_properties::NAME) {
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut statistics);
        // SAFETY: the device comes from this instance, and knows the structure of its extension.
        unsafe { instance.raw().get_physical_device_features2(device, &mut features) };
    }
    statistics.pipeline_executable_info == vk::TRUE
}

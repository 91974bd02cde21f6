//! What a device must be created with, for who creates it.

use super::instance::Instance;
use super::limits::PhysicalDevice;
use crate::device::DeviceError;
use ash::vk;

/// Features of the kernels on a device that somebody else creates.
///
/// | feature | where it is | for what |
/// |---|---|---|
/// | `vulkanMemoryModel` | Vulkan 1.2 | every kernel |
/// | `shaderInt64` | Vulkan 1.0 | [`Kernel`](prbvh_kernel::Kernel)s that lock with 64-bit words, where the device has both |
/// | `shaderBufferInt64Atomics` | Vulkan 1.2 | the same |
///
/// No extension is needed, but that a device with `VK_KHR_portability_subset` must be created with it.
#[derive(Debug)]
pub struct KernelFeatures {
    atomics_64: bool,
    v10: vk::PhysicalDeviceFeatures,
    memory_model: vk::PhysicalDeviceVulkanMemoryModelFeatures<'static>,
    atomics: vk::PhysicalDeviceShaderAtomicInt64Features<'static>,
}

impl KernelFeatures {
    /// Those that the device has.
    ///
    /// # Errors
    /// [`DeviceError::Feature`] or [`DeviceError::Limit`] with the name of what it lacks.
    ///
    /// # Safety
    /// The instance lives, is one of Vulkan 1.2 or later, and the device is one of it.
    pub unsafe fn of(instance: &ash::Instance, device: vk::PhysicalDevice) -> Result<Self, DeviceError> {
        let physical = PhysicalDevice::survey(&Instance::of_caller(instance.clone()), 0, device);
        physical.summary.require_usable()?;
        let atomics_64 = physical.summary.shader_buffer_int64_atomics;
        Ok(Self {
            atomics_64,
            v10: vk::PhysicalDeviceFeatures::default(),
            memory_model: vk::PhysicalDeviceVulkanMemoryModelFeatures::default().vulkan_memory_model(true),
            atomics: vk::PhysicalDeviceShaderAtomicInt64Features::default().shader_buffer_int64_atomics(atomics_64),
        })
    }

    /// Whether 64-bit atomics are among them: what [`RawVulkan::atomics_64`](super::RawVulkan::atomics_64) wants to know.
    #[must_use]
    pub fn atomics_64(&self) -> bool {
        self.atomics_64
    }

    /// Adds them to what a device is created with. Structures that are in the chain already get them; no second one of a kind is added.
    ///
    /// # Safety
    /// The chain of `info` is one that `push_next` made of structures that live as long as `'a` and that nobody else holds.
    pub unsafe fn add_to<'a>(&'a mut self, mut info: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        use vk::StructureType as S;
        let on = |atomics_64: bool| if atomics_64 { vk::TRUE } else { vk::FALSE };
        let (mut has_v10, mut has_model, mut has_atomics) = (false, false, false);
        let mut next = info.p_next.cast_mut().cast::<vk::BaseOutStructure<'_>>();
        // SAFETY: the caller's duty: null, or a structure of the chain.
        while let Some(structure) = unsafe { next.as_ref() } {
            let (kind, at) = (structure.s_type, next);
            next = structure.p_next;
            match kind {
                S::PHYSICAL_DEVICE_FEATURES_2 => {
                    // SAFETY: the type says what it is; the caller's duty that nobody else holds it.
                    let features = unsafe { &mut *at.cast::<vk::PhysicalDeviceFeatures2<'_>>() };
                    features.features.shader_int64 |= on(self.atomics_64);
                    has_v10 = true;
                }
                S::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES => {
                    // SAFETY: as above.
                    let features = unsafe { &mut *at.cast::<vk::PhysicalDeviceVulkan12Features<'_>>() };
                    features.vulkan_memory_model = vk::TRUE;
                    features.shader_buffer_int64_atomics |= on(self.atomics_64);
                    (has_model, has_atomics) = (true, true);
                }
                S::PHYSICAL_DEVICE_VULKAN_MEMORY_MODEL_FEATURES => {
                    // SAFETY: as above.
                    let features = unsafe { &mut *at.cast::<vk::PhysicalDeviceVulkanMemoryModelFeatures<'_>>() };
                    features.vulkan_memory_model = vk::TRUE;
                    has_model = true;
                }
                S::PHYSICAL_DEVICE_SHADER_ATOMIC_INT64_FEATURES => {
                    // SAFETY: as above.
                    let features = unsafe { &mut *at.cast::<vk::PhysicalDeviceShaderAtomicInt64Features<'_>>() };
                    features.shader_buffer_int64_atomics |= on(self.atomics_64);
                    has_atomics = true;
                }
                _ => {}
            }
        }
        if !has_v10 {
            // SAFETY: the caller's duty: null, or features that live.
            self.v10 = unsafe { info.p_enabled_features.as_ref() }.copied().unwrap_or_default();
            self.v10.shader_int64 |= on(self.atomics_64);
            info = info.enabled_features(&self.v10);
        }
        // Those of Vulkan 1.2 in one structure would not do beside others that it has in it.
        if !has_model {
            info = info.push_next(&mut self.memory_model);
        }
        if !has_atomics {
            info = info.push_next(&mut self.atomics);
        }
        info
    }
}

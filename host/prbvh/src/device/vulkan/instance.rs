//! The Vulkan library and an instance of it.

use super::error::Call;
use super::messages;
use crate::device::DeviceError;
use ash::{ext, khr, vk};
use std::ffi::{CStr, c_char};
use std::sync::{Mutex, OnceLock, PoisonError};

/// The version that the modules of the kernels are made for.
pub(super) const API_VERSION: u32 = vk::API_VERSION_1_2;

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// What to do on a machine without a driver.
const INSTALL_DRIVER: &str = "install the GPU's driver or, to run on the CPU, Mesa's lavapipe \
                              (Debian and Ubuntu: apt-get install mesa-vulkan-drivers)";

/// An instance. There is one of each kind in a process, and it is never destroyed: with the last instance the loader unloads the drivers, and
/// theirs are threads and thread-local values that end later.
pub(super) struct Instance {
    raw: ash::Instance,
    is_validated: bool,
}

impl Instance {
    /// The instance of this process that sees every driver, under the validation layer if `validate`.
    pub(super) fn shared(validate: bool) -> Result<&'static Self, DeviceError> {
        static SHARED: [Mutex<Option<&Instance>>; 2] = [const { Mutex::new(None) }; 2];
        let mut shared = SHARED[usize::from(validate)].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(instance) = *shared {
            return Ok(instance);
        }
        let instance = Box::leak(Box::new(Self::new(validate)?));
        Ok(shared.insert(instance))
    }

    /// One of the caller's.
    pub(super) fn of_caller(raw: ash::Instance) -> Self {
        Self { raw, is_validated: false }
    }

    fn new(validate: bool) -> Result<Self, DeviceError> {
        let entry = entry()?;
        let extensions = Extensions::of(entry, None)?;
        let portability = extensions.has(khr::portability_enumeration::NAME);
        let mut enabled = Vec::new();
        let mut layers = Vec::new();
        let mut synchronisation = false;
        if portability {
            enabled.push(khr::portability_enumeration::NAME.as_ptr());
        }
        if validate {
            require_validation_layer(entry)?;
            let of_layer = Extensions::of(entry, Some(VALIDATION_LAYER))?;
            layers.push(VALIDATION_LAYER.as_ptr());
            enabled.push(ext::debug_utils::NAME.as_ptr());
            synchronisation = of_layer.has(ext::validation_features::NAME);
            if synchronisation {
                enabled.push(ext::validation_features::NAME.as_ptr());
            }
        }

        let raw = create(entry, &enabled, &layers, portability, synchronisation, validate)?;
        if validate {
            let functions = ext::debug_utils::Instance::new(entry, &raw);
            // SAFETY: the extension is enabled. The messenger lives as long as the instance.
            unsafe { functions.create_debug_utils_messenger(&messages::create_info(), None) }
                .call("vkCreateDebugUtilsMessengerEXT")?;
        }
        Ok(Self { raw, is_validated: validate })
    }

    /// The functions of the instance.
    pub(super) fn raw(&self) -> &ash::Instance {
        &self.raw
    }

    /// Whether the validation layer watches.
    pub(super) fn is_validated(&self) -> bool {
        self.is_validated
    }

    /// Every device that the drivers offer; at least one.
    pub(super) fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>, DeviceError> {
        // SAFETY: the instance is alive.
        let devices = unsafe { self.raw.enumerate_physical_devices() }.call("vkEnumeratePhysicalDevices")?;
        if devices.is_empty() { Err(no_driver()) } else { Ok(devices) }
    }
}

/// The Vulkan library. It stays loaded to the end of the process: drivers may leave threads behind that run its code.
fn entry() -> Result<&'static ash::Entry, DeviceError> {
    static ENTRY: OnceLock<ash::Entry> = OnceLock::new();
    if let Some(entry) = ENTRY.get() {
        return Ok(entry);
    }
    // SAFETY: loads the system's Vulkan library, whose initialisation has no preconditions.
    let loaded = unsafe { ash::Entry::load() }
        .map_err(|error| DeviceError::NoDevice(format!("no Vulkan library ({error}): {INSTALL_DRIVER}")))?;
    Ok(ENTRY.get_or_init(|| loaded))
}

fn no_driver() -> DeviceError {
    DeviceError::NoDevice(format!("no Vulkan driver: {INSTALL_DRIVER}"))
}

fn require_validation_layer(entry: &ash::Entry) -> Result<(), DeviceError> {
    // SAFETY: the library is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.call("vkEnumerateInstanceLayerProperties")?;
    if layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
        return Ok(());
    }
    Err(DeviceError::Validation(format!(
        "the layer {} is not installed (Debian and Ubuntu: apt-get install vulkan-validationlayers)",
        VALIDATION_LAYER.to_string_lossy()
    )))
}

/// Extensions that the loader and the drivers, or a layer, offer.
struct Extensions(Vec<vk::ExtensionProperties>);

impl Extensions {
    fn of(entry: &ash::Entry, layer: Option<&CStr>) -> Result<Self, DeviceError> {
        // SAFETY: the library is loaded.
        unsafe { entry.enumerate_instance_extension_properties(layer) }
            .call("vkEnumerateInstanceExtensionProperties")
            .map(Self)
    }

    fn has(&self, name: &CStr) -> bool {
        self.0.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name))
    }
}

fn create(
    entry: &ash::Entry,
    extensions: &[*const c_char],
    layers: &[*const c_char],
    portability: bool,
    synchronisation: bool,
    validate: bool,
) -> Result<ash::Instance, DeviceError> {
    let application = vk::ApplicationInfo::default().application_name(c"prbvh").api_version(API_VERSION);
    let flags =
        if portability { vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR } else { vk::InstanceCreateFlags::empty() };
    let mut info = vk::InstanceCreateInfo::default()
        .flags(flags)
        .application_info(&application)
        .enabled_extension_names(extensions)
        .enabled_layer_names(layers);

    // The messenger of the chain reports on the creation of the instance itself.
    let mut messenger = validate.then(messages::create_info);
    if let Some(messenger) = &mut messenger {
        info = info.push_next(messenger);
    }
    let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
    if synchronisation {
        info = info.push_next(&mut features);
    }

    // SAFETY: names and chain live through the call.
    match unsafe { entry.create_instance(&info, None) } {
        Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) => Err(no_driver()),
        result => result.call("vkCreateInstance"),
    }
}

//! Results of Vulkan calls as errors of the device.

use crate::device::DeviceError;
use ash::vk;

/// Names the call that returned a `vk::Result`.
pub(super) trait Call<T> {
    /// The value, or [`DeviceError::Vulkan`] with the name of the call.
    fn call(self, call: &'static str) -> Result<T, DeviceError>;
}

impl<T> Call<T> for Result<T, vk::Result> {
    fn call(self, call: &'static str) -> Result<T, DeviceError> {
        self.map_err(|result| failed(call, result))
    }
}

/// The error of a call that returned `result`.
pub(super) fn failed(call: &'static str, result: vk::Result) -> DeviceError {
    DeviceError::Vulkan { call, code: result.as_raw(), meaning: format!("{result:?}, {result}") }
}

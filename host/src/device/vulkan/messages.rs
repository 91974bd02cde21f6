//! What the validation layer says.

use crate::device::DeviceError;
use ash::vk;
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

/// Messages kept for one error; the rest is only counted.
const KEPT: usize = 16;

/// Warnings and errors of the validation layer that nobody has taken yet.
#[derive(Debug, Default)]
pub(super) struct Messages {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    kept: Vec<String>,
    dropped: usize,
}

impl Messages {
    fn add(&self, text: String) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.kept.len() < KEPT {
            state.kept.push(text);
        } else {
            state.dropped += 1;
        }
    }

    /// Fails with all that was said since the last call.
    pub(super) fn check(&self) -> Result<(), DeviceError> {
        let state = std::mem::take(&mut *self.state.lock().unwrap_or_else(PoisonError::into_inner));
        if state.kept.is_empty() {
            return Ok(());
        }
        let mut text = state.kept.join("\n");
        if state.dropped > 0 {
            text.push_str(&format!("\nand {} more", state.dropped));
        }
        Err(DeviceError::Validation(text))
    }

    /// How Vulkan shall report to these messages, which must outlive whatever is created with it.
    ///
    /// General messages are left out: the loader uses them for drivers that it skips, which is no fault of ours.
    pub(super) fn create_info(self: &Arc<Self>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
        vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(on_message))
            .user_data(Arc::as_ptr(self).cast_mut().cast::<c_void>())
    }
}

/// # Safety
/// Called by Vulkan only: `data` is valid for the call, and `user_data` is the [`Messages`] of [`Messages::create_info`].
unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the instance that reports keeps its `Messages` alive.
    let messages = unsafe { user_data.cast::<Messages>().as_ref() };
    // SAFETY: Vulkan passes data that is valid during the call.
    let data = unsafe { data.as_ref() };
    if let (Some(messages), Some(data)) = (messages, data)
        && !data.p_message.is_null()
    {
        // SAFETY: a message is a string that ends in 0 and is valid during the call.
        let text = unsafe { CStr::from_ptr(data.p_message) }.to_string_lossy().into_owned();
        tracing::error!(target: "vulkan", "{text}");
        messages.add(text);
    }
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::Messages;

    #[test]
    fn messages_are_reported_once() {
        let messages = Messages::default();
        assert!(messages.check().is_ok());
        for k in 0..20 {
            messages.add(format!("message {k}"));
        }
        let text = messages.check().unwrap_err().to_string();
        assert!(text.contains("message 0") && text.contains("message 15") && text.ends_with("and 4 more"), "{text}");
        assert!(messages.check().is_ok());
    }
}

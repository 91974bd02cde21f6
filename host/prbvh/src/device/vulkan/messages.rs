//! What the validation layer says. It speaks on the thread whose call it finds fault with, so that a device hears of its own calls though it
//! shares its instance with others.

use crate::device::DeviceError;
use ash::vk;
use std::cell::RefCell;
use std::ffi::{CStr, c_void};

/// Messages kept for one error; the rest is only counted.
const KEPT: usize = 16;

thread_local! {
    /// Warnings and errors that nobody has taken yet.
    static SAID: RefCell<Said> = const { RefCell::new(Said { kept: Vec::new(), dropped: 0 }) };
}

#[derive(Debug, Default)]
struct Said {
    kept: Vec<String>,
    dropped: usize,
}

fn add(text: String) {
    // At the end of a thread there is nobody left to tell.
    let _ = SAID.try_with(|said| {
        let mut said = said.borrow_mut();
        if said.kept.len() < KEPT {
            said.kept.push(text);
        } else {
            said.dropped += 1;
        }
    });
}

/// Fails with all that was said of calls of this thread since the last check.
pub(super) fn check() -> Result<(), DeviceError> {
    let said = SAID.take();
    if said.kept.is_empty() {
        return Ok(());
    }
    let mut text = said.kept.join("\n");
    if said.dropped > 0 {
        text.push_str(&format!("\nand {} more", said.dropped));
    }
    Err(DeviceError::Validation(text))
}

/// How Vulkan shall report.
///
/// General messages are left out: the loader uses them for drivers that it skips, which is no fault of ours.
pub(super) fn create_info() -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
}

/// # Safety
/// Called by Vulkan only: `data` is valid for the call.
unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes data that is valid during the call.
    let data = unsafe { data.as_ref() };
    if let Some(data) = data
        && !data.p_message.is_null()
    {
        // SAFETY: a message is a string that ends in 0 and is valid during the call.
        let text = unsafe { CStr::from_ptr(data.p_message) }.to_string_lossy().into_owned();
        tracing::error!(target: "vulkan", "{text}");
        add(text);
    }
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::{add, check};

    #[test]
    fn messages_are_reported_once() {
        assert!(check().is_ok());
        for k in 0..20 {
            add(format!("message {k}"));
        }
        let text = check().unwrap_err().to_string();
        assert!(text.contains("message 0") && text.contains("message 15") && text.ends_with("and 4 more"), "{text}");
        assert!(check().is_ok());
    }

    #[test]
    fn messages_stay_on_their_thread() {
        add("here".to_owned());
        std::thread::spawn(|| assert!(check().is_ok())).join().unwrap();
        assert!(check().unwrap_err().to_string().contains("here"));
    }
}

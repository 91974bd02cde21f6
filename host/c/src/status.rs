//! What went wrong, as a number and as texts.

use prbvh::device::DeviceError;
use prbvh::pipeline::PipelineError;
use prbvh::scene::{Place, SceneError};
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// How a call ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum PrbvhStatus {
    /// There is a tree.
    Ok = 0,
    /// A pointer is NULL or not aligned, a size too small, an option out of range.
    InvalidArgument = 1,
    /// No primitives or too many, an index out of range, a coordinate that is not finite, a box that ends before it starts.
    InvalidGeometry = 2,
    /// There is no such device.
    NoDevice = 3,
    /// The device has not the memory.
    OutOfMemory = 4,
    /// The device refused or failed.
    DeviceFailed = 5,
    /// A mistake of the library.
    Internal = 6,
}

/// A status with its text.
#[derive(Debug)]
pub(crate) struct Failure {
    status: PrbvhStatus,
    text: String,
}

impl Failure {
    /// A mistake in the arguments.
    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self { status: PrbvhStatus::InvalidArgument, text: text.into() }
    }

    /// Primitives that are none.
    pub(crate) fn geometry(text: impl Into<String>) -> Self {
        Self { status: PrbvhStatus::InvalidGeometry, text: text.into() }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::geometry(match error {
            SceneError::Index { place: Place::Element(what, at), index, count, .. } => {
                format!("{what} {at}: vertex {index} is not among the {count} vertices")
            }
            SceneError::Inverted { place: Place::Element(what, at), min, max, .. } => {
                let axis = (0..3).find(|&axis| min[axis] > max[axis]).unwrap_or(0);
                let (axis, min, max) = (["x", "y", "z"][axis], min[axis], max[axis]);
                format!("{what} {at}: the smallest {axis} is {min}, above the largest, {max}")
            }
            error => error.to_string(),
        })
    }
}

impl From<DeviceError> for Failure {
    fn from(error: DeviceError) -> Self {
        let status = match &error {
            DeviceError::NoDevice(_) => PrbvhStatus::NoDevice,
            DeviceError::OutOfMemory { .. } => PrbvhStatus::OutOfMemory,
            _ => PrbvhStatus::DeviceFailed,
        };
        Self { status, text: error.to_string() }
    }
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Device(error) => error.into(),
            PipelineError::MaxDepth(_) | PipelineError::Collapse(_) | PipelineError::FeatureOff(_) => {
                Self::argument(error.to_string())
            }
            error => Self { status: PrbvhStatus::Internal, text: error.to_string() },
        }
    }
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs a call, keeps its text, and turns a panic into a status.
pub(crate) fn guard(call: impl FnOnce() -> Result<(), Failure>) -> PrbvhStatus {
    let ended = catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str));
        let text = format!("panic: {}", text.unwrap_or("without a text"));
        Err(Failure { status: PrbvhStatus::Internal, text })
    });
    let (status, text) = match ended {
        Ok(()) => (PrbvhStatus::Ok, String::new()),
        Err(Failure { status, text }) => (status, text),
    };
    // A text without a NUL, so that it always is one of C.
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    LAST.with(|last| *last.borrow_mut() = text);
    status
}

/// What a status means, for any number; it stays.
#[unsafe(no_mangle)]
pub extern "C" fn prbvh_error_text(status: i32) -> *const c_char {
    let text = match status {
        0 => c"there is a tree",
        1 => c"invalid argument",
        2 => c"invalid geometry",
        3 => c"no such device",
        4 => c"out of memory",
        5 => c"the device refused or failed",
        6 => c"a mistake of the library",
        _ => c"no status of prbvh",
    };
    text.as_ptr()
}

/// What went wrong in the last call of this thread, with names and numbers; empty if nothing did. Stays until the thread's next call.
#[unsafe(no_mangle)]
pub extern "C" fn prbvh_last_error() -> *const c_char {
    LAST.with(|last| last.borrow().as_ptr())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    fn last() -> String {
        // SAFETY: a text of C that stays until the next call.
        unsafe { CStr::from_ptr(prbvh_last_error()) }.to_str().unwrap().to_owned()
    }

    #[test]
    fn a_panic_is_a_status_and_a_text() {
        std::panic::set_hook(Box::new(|_| {}));
        assert_eq!(guard(|| panic!("planted {}", 7)), PrbvhStatus::Internal);
        assert_eq!(last(), "panic: planted 7");
        assert_eq!(guard(|| Ok(())), PrbvhStatus::Ok);
        assert_eq!(last(), "");
        assert_eq!(guard(|| Err(Failure::argument("a\0b"))), PrbvhStatus::InvalidArgument);
        assert_eq!(last(), "a b");
    }

    #[test]
    fn errors_have_the_status_that_a_program_can_act_on() {
        let status = |error: DeviceError| Failure::from(PipelineError::from(error)).status;
        assert_eq!(status(DeviceError::NoDevice(String::new())), PrbvhStatus::NoDevice);
        let (what, device) = ("nodes".to_owned(), "GPU".to_owned());
        assert_eq!(status(DeviceError::OutOfMemory { what, bytes: 1, device }), PrbvhStatus::OutOfMemory);
        assert_eq!(status(DeviceError::Stopped), PrbvhStatus::DeviceFailed);
    }
}

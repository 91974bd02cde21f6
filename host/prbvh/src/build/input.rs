//! What the builders on the device start from.

use crate::device::{Buffer, DeviceError};
use prbvh_kernel::setup::Triangle;
use std::borrow::Cow;

/// Triangles of the host, or some that are on the device already. From a slice, a vector, or `&Buffer`.
///
/// Those on the device are finite, which is the caller's to see to, and in the safe range, which is looked at there. They stay as they are, and the caller's.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Input<'a> {
    /// Of the host. The device gets their boxes; triangles that are handed over are freed then.
    Host(Cow<'a, [Triangle]>),
    /// A buffer of the device, one of [`Triangle`]s.
    Device(Buffer),
}

impl Input<'_> {
    /// How many triangles.
    pub(crate) fn len(&self) -> Result<usize, DeviceError> {
        let (length, element_bytes) = match self {
            Self::Host(triangles) => (triangles.len(), size_of::<Triangle>()),
            Self::Device(buffer) => (buffer.length, buffer.element_bytes),
        };
        let problem = if length == 0 {
            "a tree needs at least one".to_owned()
        } else if element_bytes != size_of::<Triangle>() {
            format!("its elements have {element_bytes} bytes, but triangles have {}", size_of::<Triangle>())
        } else {
            return Ok(length);
        };
        let label = if let Self::Device(buffer) = self { buffer.label } else { "triangles" };
        Err(DeviceError::Buffer { label, problem })
    }
}

impl<'a> From<Cow<'a, [Triangle]>> for Input<'a> {
    fn from(triangles: Cow<'a, [Triangle]>) -> Self {
        Self::Host(triangles)
    }
}

impl<'a> From<&'a [Triangle]> for Input<'a> {
    fn from(triangles: &'a [Triangle]) -> Self {
        Self::Host(triangles.into())
    }
}

impl<'a> From<&'a Vec<Triangle>> for Input<'a> {
    fn from(triangles: &'a Vec<Triangle>) -> Self {
        Self::Host(triangles.into())
    }
}

impl From<Vec<Triangle>> for Input<'_> {
    fn from(triangles: Vec<Triangle>) -> Self {
        Self::Host(triangles.into())
    }
}

impl From<&Buffer> for Input<'_> {
    fn from(buffer: &Buffer) -> Self {
        Self::Device(buffer.clone())
    }
}

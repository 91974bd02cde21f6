//! Device memory of a phase.

use crate::device::{DeviceError, DeviceInfo};

/// Device memory of a phase, what outlives the phases before it included.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct PhaseBytes {
    /// Name.
    pub phase: String,
    /// Whether it is part of the run.
    pub runs: bool,
    /// Most bytes in buffers at any time.
    pub peak_bytes: u64,
    /// Label of the largest buffer.
    pub largest_buffer: &'static str,
    /// Its bytes.
    pub largest_buffer_bytes: u64,
}

impl PhaseBytes {
    pub(super) fn check(&self, info: &DeviceInfo, triangles: usize) -> Result<(), DeviceError> {
        let limit = |what: &str, name, need, have| {
            let what = format!("{what} of {triangles} triangles");
            Err(DeviceError::Limit { what, name, need, have, device: info.name.clone() })
        };
        if self.largest_buffer_bytes > info.max_buffer_bytes && info.max_buffer_bytes > 0 {
            let what = format!("{}, {}", self.phase, self.largest_buffer);
            return limit(&what, info.max_buffer_limit, self.largest_buffer_bytes, info.max_buffer_bytes);
        }
        if self.peak_bytes > info.memory_bytes && info.memory_bytes > 0 {
            return limit(&self.phase, "device memory", self.peak_bytes, info.memory_bytes);
        }
        Ok(())
    }
}

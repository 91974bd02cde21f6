//! Device code: the kernels that a run takes, and the SPIR-V behind them.

use crate::device::{DeviceInfo, DeviceKind};
use crate::format;
use prbvh_kernel::Kernel;
use std::collections::BTreeSet;
use std::fmt;

/// Kernels, and the bytes of their SPIR-V modules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CodeSize {
    /// Kernels.
    pub kernels: usize,
    /// Bytes of their modules.
    pub spirv_bytes: u64,
}

impl CodeSize {
    /// Of some kernels.
    #[must_use]
    pub fn of<'a>(kernels: impl IntoIterator<Item = &'a Kernel>) -> Self {
        let add = |size: Self, kernel: &Kernel| Self {
            kernels: size.kernels + 1,
            spirv_bytes: size.spirv_bytes + spirv_bytes(*kernel),
        };
        kernels.into_iter().fold(Self::default(), add)
    }
}

#[cfg(feature = "vulkan")]
fn spirv_bytes(kernel: Kernel) -> u64 {
    kernel.spirv().len() as u64
}

/// A program without Vulkan has no SPIR-V.
#[cfg(not(feature = "vulkan"))]
fn spirv_bytes(_: Kernel) -> u64 {
    0
}

/// What of the program's device code a run takes.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct DeviceCode {
    /// Whether the device compiles a module when its kernel is first run; else kernels are native code of the program.
    pub compiled_at_run: bool,
    /// Kernels that the run may take.
    pub runs: CodeSize,
    /// All kernels of the program.
    pub all: CodeSize,
    /// Names of the kernels that the run may take.
    pub kernels: Vec<&'static str>,
}

impl DeviceCode {
    /// The code of a run that takes `kernels` on a device.
    #[must_use]
    pub fn of(kernels: &BTreeSet<Kernel>, info: &DeviceInfo) -> Self {
        Self {
            compiled_at_run: info.kind != DeviceKind::Cpu,
            runs: CodeSize::of(kernels),
            all: CodeSize::of(Kernel::ALL),
            kernels: kernels.iter().map(|kernel| kernel.info().name).collect(),
        }
    }

    /// What is not compiled; nothing on a device that compiles nothing.
    #[must_use]
    pub fn left_out(&self) -> CodeSize {
        if !self.compiled_at_run {
            return CodeSize::default();
        }
        CodeSize {
            kernels: self.all.kernels.saturating_sub(self.runs.kernels),
            spirv_bytes: self.all.spirv_bytes.saturating_sub(self.runs.spirv_bytes),
        }
    }
}

/// `12 of 49 kernels, 34 KiB of 210 KiB SPIR-V`.
impl fmt::Display for DeviceCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { compiled_at_run, runs, all, .. } = self;
        write!(f, "{} of {} kernels, ", runs.kernels, all.kernels)?;
        if !compiled_at_run {
            return f.write_str("native");
        }
        write!(f, "{} of {} SPIR-V", format::bytes(runs.spirv_bytes), format::bytes(all.spirv_bytes))
    }
}

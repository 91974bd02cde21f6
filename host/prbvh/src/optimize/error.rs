//! Why nothing was optimised.

use crate::build::UnfitTree;
use crate::check::SettingError;
use crate::device::DeviceError;

/// Why an optimiser gave no tree.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OptimizeError {
    /// A setting makes no sense. Nothing has run.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The tree that was given is not fit for it. Nothing has run.
    #[error(transparent)]
    Tree(#[from] UnfitTree),
    /// The device refused or failed, or a kernel reported a fault ([`DeviceError::Kernel`]).
    #[error(transparent)]
    Device(#[from] DeviceError),
}

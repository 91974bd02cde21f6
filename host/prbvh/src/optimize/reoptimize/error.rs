//! Why a tree could not follow its scene.

use super::super::OptimizeError;
use crate::build::UnfitTree;
use crate::bvh::{EncodeError, TreeFault};
use crate::device::DeviceError;
use crate::scene::{OutOfRange, SceneError};

/// Why a tree could not follow its scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReoptimizeError {
    /// The settings, the tree or the device.
    #[error(transparent)]
    Optimize(#[from] OptimizeError),
    /// A primitive is not finite, or a box is inverted.
    #[error(transparent)]
    Shape(#[from] SceneError),
    /// The tree has no form on a device.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// Other primitives than the tree has.
    #[error("{have} primitives, but the tree is over {need}")]
    Count {
        /// Those that came.
        have: usize,
        /// Those of the tree.
        need: usize,
    },
    /// A primitive that the tree does not have, or all of them, are to be removed.
    #[error("primitive {primitive} cannot be removed: the tree is over {primitives}, of which one stays")]
    Remove {
        /// The primitive.
        primitive: u32,
        /// Primitives of the tree.
        primitives: usize,
    },
}

impl From<DeviceError> for ReoptimizeError {
    fn from(error: DeviceError) -> Self {
        Self::Optimize(error.into())
    }
}

impl From<OutOfRange> for ReoptimizeError {
    fn from(error: OutOfRange) -> Self {
        Self::Optimize(UnfitTree::Range(error).into())
    }
}

impl From<Vec<TreeFault>> for ReoptimizeError {
    fn from(faults: Vec<TreeFault>) -> Self {
        Self::Optimize(UnfitTree::Broken { faults }.into())
    }
}

//! How large the treelets of ATRBVH are, and how often TRBVH goes over its own.

use std::fmt;
use std::num::NonZeroU32;

/// Passes of TRBVH where none are asked for, as published (Karras & Aila 2013).
pub const DEFAULT_PASSES: NonZeroU32 = NonZeroU32::new(3).expect("not 0");

/// Leaves of a treelet of ATRBVH (Domingues & Pedrini 2015), 4 to 32.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "u32", into = "u32"))]
pub struct TreeletSize(u32);

/// A number of leaves that no treelet has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a treelet has {min} to {max} leaves, not {leaves}", min = TreeletSize::MIN, max = TreeletSize::MAX)]
#[non_exhaustive]
pub struct TreeletSizeError {
    leaves: u32,
}

impl TreeletSize {
    /// The smallest: with three leaves there is little to choose from.
    pub const MIN: Self = Self(4);
    /// The largest that the kernel has room for.
    pub const MAX: Self = Self(32);
    /// As in HIPPIE, the framework of Meister & Bittner.
    pub const DEFAULT: Self = Self(20);

    /// A number of leaves.
    ///
    /// # Errors
    /// If it is out of range.
    pub const fn new(leaves: u32) -> Result<Self, TreeletSizeError> {
        if Self::MIN.0 <= leaves && leaves <= Self::MAX.0 { Ok(Self(leaves)) } else { Err(TreeletSizeError { leaves }) }
    }

    /// The number of leaves.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }
}

impl TryFrom<u32> for TreeletSize {
    type Error = TreeletSizeError;

    fn try_from(leaves: u32) -> Result<Self, TreeletSizeError> {
        Self::new(leaves)
    }
}

impl From<TreeletSize> for u32 {
    fn from(size: TreeletSize) -> Self {
        size.get()
    }
}

impl Default for TreeletSize {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl fmt::Display for TreeletSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_treelet_has_4_to_32_leaves() {
        for leaves in [4, 5, 20, 32] {
            assert_eq!(TreeletSize::new(leaves).map(TreeletSize::get), Ok(leaves));
        }
        for leaves in [0, 1, 3, 33, u32::MAX] {
            let text = TreeletSize::new(leaves).unwrap_err().to_string();
            assert_eq!(text, format!("a treelet has 4 to 32 leaves, not {leaves}"));
        }
        assert_eq!(TreeletSize::default(), TreeletSize::new(20).unwrap());
        #[cfg(feature = "atrbvh")]
        assert_eq!(TreeletSize::MAX.get(), prbvh_kernel::atrbvh::MAX_TREELET);
    }
}

//! Which kernel walks a tree, and with how much of a stack.

use crate::wide::{Layout, Width};
use prbvh_kernel::Kernel;
use prbvh_kernel::trace::stack::STATE_ROWS;
use prbvh_kernel::trace::wide::{ENTRY_WORDS, LOCAL_LEVELS};

/// The nodes of a tree on a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Two children.
    Binary,
    /// Several.
    Wide(Width, Layout),
}

impl Form {
    /// The kernel whose own stack holds a tree of this depth; without one, that with a stack in a buffer.
    pub(super) fn kernel(self, depth: u32) -> Kernel {
        match (self, depth) {
            (Self::Binary, 0..=32) => Kernel::Trace32,
            (Self::Binary, 33..=64) => Kernel::Trace64,
            (Self::Binary, 65..=128) => Kernel::Trace128,
            (Self::Binary, _) => Kernel::TraceDeep,
            (Self::Wide(_, Layout::Cwbvh), 0..=LOCAL_LEVELS) => Kernel::TraceCwbvh,
            (Self::Wide(Width::Four, Layout::Soa), 0..=LOCAL_LEVELS) => Kernel::TraceBvh4,
            (Self::Wide(Width::Eight, Layout::Soa), 0..=LOCAL_LEVELS) => Kernel::TraceBvh8,
            (Self::Wide(..), _) => self.deep_kernel(),
        }
    }

    /// The kernel with a stack in a buffer.
    pub(super) fn deep_kernel(self) -> Kernel {
        match self {
            Self::Binary => Kernel::TraceDeep,
            Self::Wide(_, Layout::Cwbvh) => Kernel::TraceCwbvhDeep,
            Self::Wide(Width::Four, Layout::Soa) => Kernel::TraceBvh4Deep,
            Self::Wide(Width::Eight, Layout::Soa) => Kernel::TraceBvh8Deep,
        }
    }

    /// Words of a ray in that buffer.
    pub(super) fn rows(self, depth: u32) -> usize {
        let words = match self {
            Self::Binary => depth,
            Self::Wide(..) => ENTRY_WORDS * depth,
        };
        (words.max(1) + STATE_ROWS) as usize
    }
}

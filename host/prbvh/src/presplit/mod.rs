//! References before a tree is built: triangles whose boxes are mostly empty become several, each a box around a piece ([`prbvh_kernel::presplit`]).

mod census;
mod grid;
mod run;
mod scale;

pub use census::PresplitCensus;
pub(crate) use run::{is_on_device, presplit, reserve};

use crate::check::{SettingError, must};
use std::fmt;

/// What is split before the tree is built, and how far.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct PresplitSettings {
    /// Further references, as a part of the triangles.
    pub budget: f64,
    /// Who gets them.
    pub form: PresplitForm,
}

impl Default for PresplitSettings {
    fn default() -> Self {
        Self { budget: Self::BUDGET, form: PresplitForm::default() }
    }
}

/// Which triangles are split, and where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum PresplitForm {
    /// On the device, those through which the coarse planes of the scene's grid go (Karras & Aila 2013).
    #[default]
    Level,
    /// On the device, those of large extents.
    ExtentArea,
    /// On the host: the references of an [`Initial::Sbvh`](crate::settings::Initial::Sbvh) with this budget, without its tree.
    Sbvh,
}

/// As on the command line.
impl fmt::Display for PresplitForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Level => "level",
            Self::ExtentArea => "extent-area",
            Self::Sbvh => "sbvh",
        })
    }
}

impl PresplitSettings {
    /// The budget where none is given.
    pub const BUDGET: f64 = 0.3;

    /// # Errors
    /// If the budget makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        must("presplit.budget", self.budget, self.budget > 0.0 && self.budget <= 16.0, "above 0 and at most 16")
    }

    /// Most further references of so many triangles.
    #[must_use]
    pub fn most_splits(&self, triangles: usize) -> usize {
        // At most 16 · 2^30.
        (self.budget * triangles as f64) as usize
    }
}

//! How many children a node may have.

use crate::bvh::SahModel;
use crate::check::SettingError;
use std::fmt;

/// Most children of a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(into = "u8", try_from = "u8"))]
pub enum Width {
    /// BVH4.
    Four,
    /// BVH8.
    #[default]
    Eight,
}

impl Width {
    /// The number.
    #[must_use]
    pub fn get(self) -> usize {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }

    /// Costs of a step through a node of this width and of a test against a triangle.
    ///
    /// 3 and 2 are those of a node of two (Meister & Bittner 2018). A node of twice the width costs half as much again: for eight children that is 6.75 to 2, next to
    /// the 1 to 0.3 of Ylitie, Karras & Laine 2017.
    #[must_use]
    pub fn sah(self) -> SahModel {
        let c_traversal = match self {
            Self::Four => 4.5,
            Self::Eight => 6.75,
        };
        SahModel { c_traversal, c_intersect: 2.0 }
    }
}

impl From<Width> for u8 {
    fn from(width: Width) -> Self {
        match width {
            Width::Four => 4,
            Width::Eight => 8,
        }
    }
}

impl TryFrom<u8> for Width {
    type Error = SettingError;

    fn try_from(width: u8) -> Result<Self, SettingError> {
        match width {
            4 => Ok(Self::Four),
            8 => Ok(Self::Eight),
            _ => Err(SettingError { name: "width", value: width.to_string(), need: "4 or 8" }),
        }
    }
}

impl fmt::Display for Width {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.get().fmt(f)
    }
}

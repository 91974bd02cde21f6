//! How the nodes of a wide tree lie in memory.

use super::width::Width;
use crate::check::SettingError;
use prbvh_kernel::trace::wide::{Bvh4Node, Bvh8Node, CwbvhNode};
use std::fmt;
use std::str::FromStr;

/// A layout of nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Layout {
    /// Boxes as they are, a coordinate of all children after another: 128 bytes a node of four, 256 of eight.
    #[default]
    Soa,
    /// Compressed nodes of eight children, 80 bytes (Ylitie, Karras & Laine 2017); leaves of up to three triangles.
    Cwbvh,
}

impl Layout {
    /// Most triangles of a leaf of a compressed node.
    pub const CWBVH_LEAF: u32 = 3;

    /// Bytes of a node.
    #[must_use]
    pub fn node_bytes(self, width: Width) -> usize {
        match (self, width) {
            (Self::Soa, Width::Four) => size_of::<Bvh4Node>(),
            (Self::Soa, Width::Eight) => size_of::<Bvh8Node>(),
            (Self::Cwbvh, _) => size_of::<CwbvhNode>(),
        }
    }
}

/// As on the command line.
impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Soa => "soa",
            Self::Cwbvh => "cwbvh",
        })
    }
}

impl FromStr for Layout {
    type Err = SettingError;

    fn from_str(name: &str) -> Result<Self, SettingError> {
        match name {
            "soa" => Ok(Self::Soa),
            "cwbvh" => Ok(Self::Cwbvh),
            _ => Err(SettingError { name: "layout", value: name.to_owned(), need: "soa or cwbvh" }),
        }
    }
}

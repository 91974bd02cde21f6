//! How the optimiser is written: its name, and beside it its settings, under that name.

use super::Optimizer;
use crate::optimize::{RbvhSettings, RotationSettings};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Name {
    Prbvh,
    Rbvh,
    Rotations,
    None,
}

/// Settings that are not written are the usual ones.
#[derive(Serialize, Deserialize)]
pub(super) struct Written {
    optimizer: Name,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rbvh: Option<RbvhSettings>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rotations: Option<RotationSettings>,
}

impl From<Written> for Optimizer {
    fn from(Written { optimizer, rbvh, rotations }: Written) -> Self {
        match optimizer {
            Name::Prbvh => Self::Prbvh,
            Name::Rbvh => Self::Rbvh(rbvh.unwrap_or_default()),
            Name::Rotations => Self::Rotations(rotations.unwrap_or_default()),
            Name::None => Self::None,
        }
    }
}

impl From<Optimizer> for Written {
    fn from(optimizer: Optimizer) -> Self {
        let written = |optimizer| Self { optimizer, rbvh: None, rotations: None };
        match optimizer {
            Optimizer::Prbvh => written(Name::Prbvh),
            Optimizer::Rbvh(settings) => Self { rbvh: Some(settings), ..written(Name::Rbvh) },
            Optimizer::Rotations(settings) => Self { rotations: Some(settings), ..written(Name::Rotations) },
            Optimizer::None => written(Name::None),
        }
    }
}

//! The arguments that choose the leaves of a tree.

use super::values::not_negative;
use clap::{Args, ValueEnum};
use prbvh::bvh::SahModel;
use prbvh::collapse::CollapseSettings;

/// Leaves of the tree that is written.
#[derive(Clone, Debug, Args)]
pub(super) struct LeavesArgs {
    /// One triangle per leaf, or as many as the SAH cost says [default: single, but adaptive with one of the next three].
    #[arg(long, value_enum)]
    pub(super) leaves: Option<LeavesArg>,
    /// Most triangles of an adaptive leaf [default: no limit].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) max_leaf: Option<u32>,
    /// Cost of a step of the traversal, for adaptive leaves [default: 3].
    #[arg(long, value_name = "COST", value_parser = not_negative)]
    pub(super) c_traversal: Option<f64>,
    /// Cost of a test against a triangle, for adaptive leaves [default: 2].
    #[arg(long, value_name = "COST", value_parser = not_negative)]
    pub(super) c_intersect: Option<f64>,
}

impl LeavesArgs {
    /// None for single leaves.
    pub(super) fn settings(&self) -> Option<CollapseSettings> {
        let defaults = SahModel::default();
        let sah = SahModel {
            c_traversal: self.c_traversal.unwrap_or(defaults.c_traversal),
            c_intersect: self.c_intersect.unwrap_or(defaults.c_intersect),
        };
        let is_asked_for = self.max_leaf.is_some() || self.c_traversal.is_some() || self.c_intersect.is_some();
        let is_adaptive = match self.leaves {
            None => is_asked_for,
            Some(leaves) => leaves == LeavesArg::Adaptive,
        };
        is_adaptive.then(|| {
            CollapseSettings::default().with(|settings| {
                settings.sah = sah;
                settings.max_leaf = self.max_leaf;
            })
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LeavesArg {
    Single,
    Adaptive,
}

//! Why a method has no row of numbers.

use super::peers::PeerError;
use crate::render::RenderError;
use prbvh::bvh::{self, EncodeError, TooShallow, TreeFault};
use prbvh::collapse::CollapseError;
use prbvh::device::DeviceError;
use prbvh::optimize::OptimizeError;
use prbvh::pipeline::PipelineError;
use std::error::Error;

/// Why a method failed; its text is the status of the row.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MethodError {
    /// Building or optimising failed.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The device refused or failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The optimiser gave nothing.
    #[error(transparent)]
    Optimize(#[from] OptimizeError),
    /// The adaptive leaves could not be made.
    #[error(transparent)]
    Collapse(#[from] CollapseError),
    /// The rays could not be traced.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The tree has leaves of several triangles.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The other library failed.
    #[error(transparent)]
    Peer(#[from] PeerError),
    /// What was made is no tree over the triangles.
    #[error("invalid tree: {}", bvh::summary(.0))]
    InvalidTree(Vec<TreeFault>),
    /// No tree over so many triangles is within the bound on the depth.
    #[error("max_depth: {0}")]
    MaxDepth(#[from] TooShallow),
    /// A repetition made another tree.
    #[error("not deterministic: tree {second} in a repetition, {first} before")]
    OtherTree {
        /// Hash of the first tree.
        first: String,
        /// Hash of the other one.
        second: String,
    },
    /// The rays hit something else than through the other trees.
    #[error("other hits: {0}")]
    OtherHits(String),
    /// The system refused threads.
    #[error("no threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// The error and its causes in a line.
pub(super) fn in_a_line(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.ends_with(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    text.lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

//! Optimises bounding volume hierarchies by parallel reinsertion, on any GPU and any CPU.
//!
//! Data flows one way: scene → triangles → boxes → Morton order → initial tree → reinsertion → best tree → report.

pub mod accuracy;
pub mod build;
pub mod bvh;
pub mod collapse;
pub mod compare;
pub mod device;
mod fold;
pub mod optimize;
pub mod pipeline;
pub mod plan;
pub mod presets;
pub mod reference;
pub mod render;
pub mod report;
pub mod scene;
pub mod stability;
pub mod stop;
pub mod trace;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;

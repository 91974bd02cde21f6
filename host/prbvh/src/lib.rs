//! Optimises bounding volume hierarchies by parallel reinsertion, on any GPU and any CPU.
//!
//! Data flows one way: scene → triangles → boxes → Morton order → initial tree → reinsertion → best tree.

pub mod build;
pub mod bvh;
pub mod collapse;
pub mod device;
mod fold;
#[doc(hidden)]
pub mod format;
pub mod interop;
pub mod optimize;
pub mod pipeline;
pub mod plan;
pub mod scene;
pub mod settings;
pub mod stop;
pub mod trace;
#[cfg(feature = "files")]
pub mod write;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
pub struct Readme;

//! The laboratory of [`prbvh`]: its command, and what researchers measure with it.

pub mod accuracy;
pub mod compare;
pub mod kernels;
mod machine;
pub mod page;
mod phases;
pub mod plan;
pub mod presets;
mod program;
pub mod reference;
pub mod render;
pub mod report;
pub mod stability;
mod terminal;

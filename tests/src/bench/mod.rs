//! What the benchmarks share: runs of one program, their statistics, and what is judged of them.

pub mod agree;
pub mod chase;
pub mod curve;
pub mod frames;
pub mod machine;
pub mod markdown;
pub mod obvhs;
pub mod peak;
pub mod runs;
pub mod stats;
pub mod targets;
pub mod visits;

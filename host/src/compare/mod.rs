//! The methods of the paper against each other, on any scenes: Meister & Bittner 2018, table 1 and figures 5 to 8.

mod data;

pub use data::{
    AgainstRbvh, Comparison, MethodRow, OptimizerRun, Picture, Purpose, RayRates, RaySettings, SCHEMA, SceneComparison,
};

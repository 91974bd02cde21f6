//! The methods of the paper against each other, on any scenes: Meister & Bittner 2018, table 1 and figures 5 to 8.

mod against;
mod data;
mod error;
mod errors;
mod errors_table;
mod figures;
mod fitted;
mod measure;
mod median;
mod methods;
mod on_host;
pub mod peers;
mod rays;
mod run;
mod slot;
mod table;
mod write;

pub use against::against_rbvh;
pub use data::{
    AgainstRbvh, Comparison, LEVELS, MethodRow, OptimizerRun, Picture, Purpose, RayRates, RaySettings, Reference,
    SCHEMA, SceneComparison, SceneErrors, SettingErrors, TimesToError,
};
pub use error::MethodError;
pub use errors_table::errors_table;
pub use median::median;
pub use methods::{Job, MethodSettings, NoSuchMethod, PAPER_RADIUS, jobs, method_names};
pub use peers::PeerHost;
pub use run::{CompareSettings, NOT_RUN, Step, compare};
pub use table::{Note, notes, table};

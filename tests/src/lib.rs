//! Fixtures, oracles and comparers shared by the tests.

pub mod browser;
pub mod command;
pub mod compare;
pub mod devices;
pub mod dual;
pub mod fixtures;
pub mod footprint;
pub mod made_up;
pub mod oracle;
pub mod rays;
pub mod scenes;
pub mod without_threshold;

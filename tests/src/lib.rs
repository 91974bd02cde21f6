//! Fixtures, oracles and comparers shared by the tests.

pub mod command;
pub mod compare;
pub mod devices;
pub mod fixtures;
pub mod footprint;
pub mod oracle;
pub mod rays;
pub mod scenes;

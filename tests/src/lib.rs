//! Fixtures, oracles and comparers shared by the tests.

pub mod fixtures;

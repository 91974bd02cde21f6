//! Fixtures, oracles and comparers shared by the tests.

pub mod bench;
pub mod best_tree;
pub mod browser;
pub mod command;
pub mod compare;
pub mod devices;
pub mod dual;
pub mod fixtures;
pub mod footprint;
pub mod hidden;
pub mod locks;
pub mod made_up;
pub mod moved;
pub mod numerics;
pub mod omissions;
pub mod oracle;
pub mod other_searches;
pub mod planted;
pub mod planted_peers;
pub mod rays;
pub mod scenes;
pub mod walk;
pub mod worst;

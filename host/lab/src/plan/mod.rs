//! Plans on the terminal.

mod overview;
mod table;

pub use overview::{kinds, overview};
pub(crate) use table::items;
pub use table::table;

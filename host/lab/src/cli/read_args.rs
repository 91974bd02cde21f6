//! How scene files are read.

use clap::Args;
use prbvh::scene::{Format, LoadOptions};

/// The arguments of every command that reads scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Args)]
pub(super) struct ReadArgs {
    /// Format of the scene files, whatever their names: obj, ply, stl, gltf or glb [default: by extension, or else by content].
    #[arg(long, value_name = "FORMAT")]
    format: Option<Format>,
    /// Refuse a scene file of which anything is not read, in place of a warning.
    #[arg(long)]
    strict: bool,
}

impl ReadArgs {
    pub(super) fn options(&self) -> LoadOptions {
        LoadOptions::default().with(|options| {
            options.format = self.format;
            options.strict = self.strict;
        })
    }
}

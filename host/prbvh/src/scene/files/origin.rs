//! Where bytes come from, for messages.

use crate::scene::SceneError;
use std::io;

/// What a file is packed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    Xz,
    Gzip,
    Zstd,
}

/// Where bytes come from, for messages.
#[derive(Clone, Debug)]
pub(super) struct Origin {
    pub(super) file: String,
    pub(super) packing: Option<Packing>,
}

impl Origin {
    /// The error for a read that failed.
    pub(super) fn fault(&self, source: io::Error) -> SceneError {
        let file = self.file.clone();
        let format = match self.packing {
            None => return SceneError::Io { file, source },
            Some(Packing::Xz) => "xz",
            Some(Packing::Gzip) => "gzip",
            Some(Packing::Zstd) => "zstd",
        };
        SceneError::Archive { file, format, source }
    }
}

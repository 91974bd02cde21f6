//! What can be wrong with a tree file.

use crate::write::WriteError;
use std::io;
use std::path::PathBuf;

/// Why a tree file was not written or not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TreeFileError {
    /// The tree to be written is none.
    #[error("{path}: not written, because the tree is broken:\n{faults}")]
    BrokenTree {
        /// The file.
        path: PathBuf,
        /// What is wrong with the tree.
        faults: String,
    },
    /// The scene's hash to be written is none.
    #[error("{path}: not written, because the scene hash `{hash}` is not made of 32 hexadecimal digits")]
    SceneHash {
        /// The file.
        path: PathBuf,
        /// What was given.
        hash: String,
    },
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The file could not be read.
    #[error("{path} could not be read")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The file is not what it should be.
    #[error("{path}: no tree file of the version asked for: at byte {offset}, {what} is {value}, but must be {need}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: usize,
        /// What stands there.
        what: &'static str,
        /// Its value.
        value: String,
        /// What must stand there.
        need: String,
    },
}

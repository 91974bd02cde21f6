//! Why a scene cannot be had. Each error names the file, the place in it and the value at fault.

use super::note::{Note, in_a_line};
use super::place::Place;
use std::io;

/// Most triangles of a scene. A tree over them has fewer than 2^31 nodes, so that a node and a flag fit 32 bits.
pub const MAX_TRIANGLES: u64 = 1 << 30;

/// Why a scene cannot be had. `file` is the path, or the name of a scene that came from no file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// There is no such file.
    #[error("{file}: no such file")]
    NotFound {
        /// Path.
        file: String,
    },
    /// The path is a directory.
    #[error("{file}: a directory, not a scene file")]
    Directory {
        /// Path.
        file: String,
    },
    /// The file, or what an archive unpacks to, has no bytes.
    #[error("{file}: empty file")]
    Empty {
        /// Path.
        file: String,
    },
    /// Neither the extension nor the first bytes tell a format.
    #[error("{file}: unknown extension \"{extension}\", and the content tells no format; known are {known}")]
    Extension {
        /// Path.
        file: String,
        /// The extension; empty where there is none.
        extension: String,
        /// The known ones.
        known: String,
    },
    /// The file cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Io {
        /// Path.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The compressed file is cut short or damaged.
    #[error("{file}: the {format} archive is truncated or damaged: {source}")]
    Archive {
        /// Path.
        file: String,
        /// `xz`, `gzip` or `zstd`.
        format: &'static str,
        /// What the decoder says.
        source: io::Error,
    },
    /// The file breaks the rules of its format.
    #[error("{file}{place}: {message}")]
    Format {
        /// Path.
        file: String,
        /// Where.
        place: Place,
        /// What is wrong, with the value.
        message: String,
    },
    /// A face names a vertex that does not exist.
    #[error("{file}{place}: vertex index {index} is out of range: there are {count} vertices")]
    Index {
        /// Path.
        file: String,
        /// Where.
        place: Place,
        /// The index as the file has it.
        index: String,
        /// Number of vertices (so far, for an index that counts backwards).
        count: u64,
    },
    /// A coordinate is NaN or infinite, as written or as a float32.
    #[error("{file}{place}: coordinate {value} is not a finite float32")]
    NotFinite {
        /// Path.
        file: String,
        /// Where.
        place: Place,
        /// The value as the file has it.
        value: String,
    },
    /// A box has a corner of smallest coordinates that is above the other one.
    #[error("{file}{place}: the box from {min:?} to {max:?} is inverted")]
    Inverted {
        /// Name of the scene.
        file: String,
        /// Where.
        place: Place,
        /// Smallest coordinates as given.
        min: [f32; 3],
        /// Largest coordinates as given.
        max: [f32; 3],
    },
    /// Strided vertices that overlap or are not all there.
    #[error("{count} positions of 12 bytes from byte {offset} on, one in {stride} bytes, are not in {bytes} bytes")]
    Stride {
        /// Bytes there are.
        bytes: usize,
        /// Byte of the first position.
        offset: usize,
        /// Bytes from one position to the next.
        stride: usize,
        /// Positions.
        count: usize,
    },
    /// There are no triangles.
    #[error("{file}: no triangles{}", after(.notes))]
    NoTriangles {
        /// Path.
        file: String,
        /// What there was in their place.
        notes: Vec<Note>,
    },
    /// Something of the file would be left out, and nothing may be.
    #[error("{file}: not read whole: {}", in_a_line(.notes))]
    NotWhole {
        /// Path.
        file: String,
        /// What would be left out.
        notes: Vec<Note>,
    },
    /// There are more triangles than a tree can hold.
    #[error("{file}: {count} triangles or more; at most {MAX_TRIANGLES} are possible")]
    TooMany {
        /// Path.
        file: String,
        /// How many there are at least.
        count: u64,
    },
}

/// Makes errors of one file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Blame<'a>(pub(super) &'a str);

impl Blame<'_> {
    #[cfg(feature = "files")]
    pub(super) fn format(self, place: Place, message: impl Into<String>) -> SceneError {
        SceneError::Format { file: self.0.into(), place, message: message.into() }
    }

    #[cfg(feature = "files")]
    pub(super) fn index(self, place: Place, index: impl ToString, count: u64) -> SceneError {
        SceneError::Index { file: self.0.into(), place, index: index.to_string(), count }
    }

    pub(super) fn not_finite(self, place: Place, value: impl ToString) -> SceneError {
        SceneError::NotFinite { file: self.0.into(), place, value: value.to_string() }
    }

    /// Checks that a scene of `count` triangles is possible.
    pub(super) fn limit(self, count: u64) -> Result<(), SceneError> {
        if count > MAX_TRIANGLES { Err(SceneError::TooMany { file: self.0.into(), count }) } else { Ok(()) }
    }

    /// Checks that a corner is finite.
    pub(super) fn finite(self, place: Place, corner: [f32; 3]) -> Result<(), SceneError> {
        match corner.into_iter().find(|x| !x.is_finite()) {
            Some(value) => Err(self.not_finite(place, value)),
            None => Ok(()),
        }
    }
}

fn after(notes: &[Note]) -> String {
    if notes.is_empty() { String::new() } else { format!("; {}", in_a_line(notes)) }
}

#[cfg(feature = "files")]
/// Text of a file for a message: a binary file under a wrong name can have words of megabytes.
pub(super) fn shorten(text: &[u8]) -> String {
    let short = String::from_utf8_lossy(&text[..text.len().min(40)]).into_owned();
    if text.len() > 40 { short + "…" } else { short }
}

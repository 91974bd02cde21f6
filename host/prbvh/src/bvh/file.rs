//! `tree.bvh`: a tree on disk. The format is described in `docs/tree-format.md`.

use super::layout::FlatTree;
use super::parse::{NODE_BYTES, parse};
use super::validate::structure_faults;
use super::{Bvh, reference_faults, summary};
use crate::write::{WriteError, write_atomically};
use std::io;
use std::path::{Path, PathBuf};

/// First bytes of the file. Line ends and end-of-file mark betray a transfer as text.
const MAGIC: [u8; 8] = *b"PRBVH\r\n\x1a";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 64;
const CHECKSUM_BYTES: usize = 16;

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TreeFile {
    /// The tree, its nodes in the order of the file.
    pub tree: Bvh,
    /// Hash of the scene that the tree was made for, 32 hexadecimal digits.
    pub scene_hash: String,
}

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
    #[error("{path}: no tree file of version {VERSION}: at byte {offset}, {what} is {value}, but must be {need}")]
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

/// Writes a tree under a temporary name, syncs it and renames it: the file is whole or not there.
///
/// # Errors
/// If the tree's links are no tree, if `scene_hash` is not 32 hexadecimal digits, or if the file cannot be written.
pub fn write(path: &Path, tree: &Bvh, scene_hash: &str) -> Result<(), TreeFileError> {
    let splits_of = triangles_of_splits(tree);
    let faults = match splits_of {
        Some(triangles) => reference_faults(tree, Some(triangles as usize)),
        None => structure_faults(tree),
    };
    if !faults.is_empty() {
        return Err(TreeFileError::BrokenTree { path: path.to_owned(), faults: summary(&faults) });
    }
    let header = header(tree, splits_of.unwrap_or(0), scene_hash)
        .ok_or_else(|| TreeFileError::SceneHash { path: path.to_owned(), hash: scene_hash.to_owned() })?;
    let layout = FlatTree::new(tree).into_little_endian();
    let mut checksum = blake3::Hasher::new();
    write_atomically(path, |out| {
        let [nodes, order] = layout.bytes();
        for bytes in [&header[..], nodes, order] {
            checksum.update(bytes);
            out.write_all(bytes)?;
        }
        out.write_all(&checksum.finalize().as_bytes()[..CHECKSUM_BYTES])
    })?;
    Ok(())
}

/// Reads a tree. Its links and triangle ids are right; ask [`validate`](super::validate()) about its boxes.
///
/// # Errors
/// [`TreeFileError::Read`] if there is no such file, [`TreeFileError::Malformed`] if it is not exactly what [`write()`] writes.
pub fn read(path: &Path) -> Result<TreeFile, TreeFileError> {
    let failed = |source| TreeFileError::Read { path: path.to_owned(), source };
    // A device or a pipe could go on for ever.
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")));
    }
    decode(path, &std::fs::read(path).map_err(failed)?)
}

/// Triangles of the scene, where one is in several leaves: every triangle is in one at least, so the last is there.
fn triangles_of_splits(tree: &Bvh) -> Option<u32> {
    let triangles = tree.triangle_order.iter().max()?.checked_add(1)?;
    tree.has_splits(triangles as usize).then_some(triangles)
}

fn header(tree: &Bvh, splits_of: u32, scene_hash: &str) -> Option<[u8; HEADER_BYTES]> {
    let hash = parse_hash(scene_hash)?;
    let mut header = [0; HEADER_BYTES];
    header[..8].copy_from_slice(&MAGIC);
    header[8..12].copy_from_slice(&VERSION.to_le_bytes());
    header[12..16].copy_from_slice(&(tree.triangle_order.len() as u32).to_le_bytes());
    header[16..20].copy_from_slice(&(tree.nodes.len() as u32).to_le_bytes());
    header[20..24].copy_from_slice(&splits_of.to_le_bytes());
    header[24..40].copy_from_slice(&hash);
    Some(header)
}

fn parse_hash(hash: &str) -> Option<[u8; 16]> {
    if hash.len() != 32 || !hash.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    u128::from_str_radix(hash, 16).ok().map(u128::to_be_bytes)
}

fn decode(path: &Path, bytes: &[u8]) -> Result<TreeFile, TreeFileError> {
    let malformed = |offset: usize, what: &'static str, value: String, need: String| {
        Err(TreeFileError::Malformed { path: path.to_owned(), offset, what, value, need })
    };
    let length = bytes.len();
    let smallest = HEADER_BYTES + NODE_BYTES + 4 + CHECKSUM_BYTES;
    if length < MAGIC.len() || bytes[..MAGIC.len()] != MAGIC {
        let found = bytes[..length.min(MAGIC.len())].escape_ascii().to_string();
        return malformed(0, "the magic number", found, MAGIC.escape_ascii().to_string());
    }
    if length < smallest {
        return malformed(length, "the length of the file", format!("{length} bytes"), format!("at least {smallest}"));
    }
    let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    if word(8) != VERSION {
        return malformed(8, "the version", word(8).to_string(), VERSION.to_string());
    }
    let (triangles, nodes, splits_of) = (word(12) as usize, word(16) as usize, word(20));
    if let Some(at) = (40..HEADER_BYTES).find(|&at| bytes[at] != 0) {
        return malformed(at, "a reserved byte", bytes[at].to_string(), "0".to_owned());
    }
    if triangles == 0 {
        return malformed(12, "the number of triangles", "0".to_owned(), "at least 1".to_owned());
    }
    if splits_of as usize >= triangles {
        let need = format!("0, or with splits below {triangles}");
        return malformed(20, "the number of triangles of a tree with splits", splits_of.to_string(), need);
    }
    if nodes.is_multiple_of(2) || nodes as u64 > 2 * triangles as u64 - 1 {
        let need = format!("odd and at most {}", 2 * triangles as u64 - 1);
        return malformed(16, "the number of nodes", nodes.to_string(), need);
    }
    // In 64 bits, so that no count overflows. Nothing is allocated before the file is known to be as long as it says.
    let need = (HEADER_BYTES + CHECKSUM_BYTES) as u64 + nodes as u64 * NODE_BYTES as u64 + triangles as u64 * 4;
    if length as u64 != need {
        let at = (length as u64).min(need) as usize;
        return malformed(at, "the length of the file", format!("{length} bytes"), format!("{need} by its header"));
    }
    let checksum_at = length - CHECKSUM_BYTES;
    let checksum = blake3::hash(&bytes[..checksum_at]);
    if checksum.as_bytes()[..CHECKSUM_BYTES] != bytes[checksum_at..] {
        let value = hex(&bytes[checksum_at..]);
        return malformed(checksum_at, "the checksum", value, checksum.to_hex()[..2 * CHECKSUM_BYTES].to_owned());
    }
    let order_at = HEADER_BYTES + nodes * NODE_BYTES;
    let of_splits = (splits_of > 0).then_some(splits_of);
    match parse(&bytes[HEADER_BYTES..order_at], &bytes[order_at..checksum_at], of_splits) {
        Ok(tree) => Ok(TreeFile { tree, scene_hash: hex(&bytes[24..40]) }),
        Err(error) => malformed(HEADER_BYTES + error.offset, error.what, error.value.to_string(), error.need),
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;

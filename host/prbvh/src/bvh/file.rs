//! `tree.bvh`: a tree on disk. The format is described in `docs/tree-format.md`.

use super::envelope::{self, CHECKSUM_BYTES, HEADER_BYTES, Header};
pub use super::file_error::TreeFileError;
use super::layout::FlatTree;
use super::parse::{NODE_BYTES, parse};
use super::validate::structure_faults;
use super::{Bvh, reference_faults, summary};
use crate::write::write_atomically;
use std::path::Path;

const VERSION: u32 = 1;

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TreeFile {
    /// The tree, its nodes in the order of the file.
    pub tree: Bvh,
    /// Hash of the scene that the tree was made for, 32 hexadecimal digits.
    pub scene_hash: String,
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
    decode(path, &envelope::read(path)?)
}

/// The version of a tree file: 1 is read here, 2 by [`wide::file`](crate::wide::file).
///
/// # Errors
/// [`TreeFileError::Read`] if there is no such file, [`TreeFileError::Malformed`] if it is no tree file of any version.
pub fn version(path: &Path) -> Result<u32, TreeFileError> {
    envelope::version(path, &envelope::read_start(path)?)
}

/// Triangles of the scene, where one is in several leaves: every triangle is in one at least, so the last is there.
fn triangles_of_splits(tree: &Bvh) -> Option<u32> {
    let triangles = tree.triangle_order.iter().max()?.checked_add(1)?;
    tree.has_splits(triangles as usize).then_some(triangles)
}

fn header(tree: &Bvh, splits_of: u32, scene_hash: &str) -> Option<[u8; HEADER_BYTES]> {
    let hash = envelope::parse_hash(scene_hash)?;
    Some(envelope::header(VERSION, [tree.triangle_order.len() as u32, tree.nodes.len() as u32, splits_of], hash))
}

fn decode(path: &Path, bytes: &[u8]) -> Result<TreeFile, TreeFileError> {
    let malformed = |offset: usize, what: &'static str, value: String, need: String| {
        Err(TreeFileError::Malformed { path: path.to_owned(), offset, what, value, need })
    };
    let smallest = HEADER_BYTES + NODE_BYTES + 4 + CHECKSUM_BYTES;
    let Header { counts: [triangles, nodes, splits_of], scene_hash } = Header::of(path, bytes, VERSION, smallest)?;
    if triangles == 0 {
        return malformed(12, "the number of triangles", "0".to_owned(), "at least 1".to_owned());
    }
    if splits_of >= triangles {
        let need = format!("0, or with splits below {triangles}");
        return malformed(20, "the number of triangles of a tree with splits", splits_of.to_string(), need);
    }
    if nodes.is_multiple_of(2) || u64::from(nodes) > 2 * u64::from(triangles) - 1 {
        let need = format!("odd and at most {}", 2 * u64::from(triangles) - 1);
        return malformed(16, "the number of nodes", nodes.to_string(), need);
    }
    let body = envelope::body(path, bytes, u64::from(nodes) * NODE_BYTES as u64 + u64::from(triangles) * 4)?;
    let (nodes, order) = body.split_at(nodes as usize * NODE_BYTES);
    match parse(nodes, order, (splits_of > 0).then_some(splits_of)) {
        Ok(tree) => Ok(TreeFile { tree, scene_hash }),
        Err(error) => malformed(HEADER_BYTES + error.offset, error.what, error.value.to_string(), error.need),
    }
}

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;

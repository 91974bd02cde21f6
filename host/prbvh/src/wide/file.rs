//! A packed tree on disk: version 2 of the tree file, described in `docs/tree-format.md`.

use super::layout::Layout;
use super::packed::{PackedNodes, PackedTree};
use super::validate::summary;
use super::width::Width;
use crate::bvh::envelope::{self, CHECKSUM_BYTES, HEADER_BYTES};
use crate::bvh::file::TreeFileError;
use crate::write::write_atomically;
use bytemuck::Pod;
use std::path::Path;

/// Number of this version.
pub const VERSION: u32 = 2;

/// Added to the number of a layout where a triangle is in several leaves.
const SPLITS: u32 = 256;

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WideFile {
    /// The tree, its nodes in the order of the file.
    pub tree: PackedTree,
    /// Hash of the scene that the tree was made for, 32 hexadecimal digits.
    pub scene_hash: String,
}

/// Writes a tree under a temporary name, syncs it and renames it: the file is whole or not there.
///
/// # Errors
/// If the tree is none, if a triangle below the last one is in no leaf, if `scene_hash` is not 32 hexadecimal digits, or if the file cannot be written.
pub fn write(path: &Path, tree: &PackedTree, scene_hash: &str) -> Result<(), TreeFileError> {
    let has_splits = checked(tree).map_err(|faults| TreeFileError::BrokenTree { path: path.to_owned(), faults })?;
    let hash = envelope::parse_hash(scene_hash)
        .ok_or_else(|| TreeFileError::SceneHash { path: path.to_owned(), hash: scene_hash.to_owned() })?;
    let layout = code(&tree.nodes) | if has_splits { SPLITS } else { 0 };
    let counts = [tree.order.len() as u32, tree.nodes.len() as u32, layout];
    let header = envelope::header(VERSION, counts, hash);
    let mut checksum = blake3::Hasher::new();
    write_atomically(path, |out| {
        let words: Vec<u8> = tree.words().flat_map(u32::to_le_bytes).collect();
        for bytes in [&header[..], &words] {
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
pub fn read(path: &Path) -> Result<WideFile, TreeFileError> {
    decode(path, &envelope::read(path)?)
}

fn decode(path: &Path, bytes: &[u8]) -> Result<WideFile, TreeFileError> {
    let malformed = |offset: usize, what: &'static str, value: String, need: String| TreeFileError::Malformed {
        path: path.to_owned(),
        offset,
        what,
        value,
        need,
    };
    let header = envelope::Header::of(path, bytes, VERSION, HEADER_BYTES + 80 + 4 + CHECKSUM_BYTES)?;
    let [triangles, nodes, layout] = header.counts;
    let code = layout & !SPLITS;
    let node_bytes = match code {
        1 => 128,
        2 => 256,
        3 => 80,
        _ => {
            let need = "1, 2 or 3, and 256 more with splits".to_owned();
            return Err(malformed(20, "the layout", layout.to_string(), need));
        }
    };
    if triangles == 0 {
        return Err(malformed(12, "the number of triangles", "0".to_owned(), "at least 1".to_owned()));
    }
    if nodes == 0 || nodes > triangles {
        return Err(malformed(16, "the number of nodes", nodes.to_string(), format!("from 1 to {triangles}")));
    }
    let body = envelope::body(path, bytes, u64::from(nodes) * node_bytes + u64::from(triangles) * 4)?;
    let (nodes, order) = body.split_at(nodes as usize * node_bytes as usize);
    let nodes = match code {
        1 => PackedNodes::Bvh4(elements(nodes)),
        2 => PackedNodes::Bvh8(elements(nodes)),
        _ => PackedNodes::Cwbvh(elements(nodes)),
    };
    let tree = PackedTree { nodes, order: elements(order) };
    match checked(&tree) {
        Ok(has_splits) if has_splits == (layout & SPLITS != 0) => Ok(WideFile { tree, scene_hash: header.scene_hash }),
        Ok(true) => {
            Err(malformed(20, "the layout", layout.to_string(), "256 more: a triangle is there twice".to_owned()))
        }
        Ok(false) => {
            Err(malformed(20, "the layout", layout.to_string(), "256 less: no triangle is there twice".to_owned()))
        }
        Err(faults) => Err(malformed(HEADER_BYTES, "the tree", format!("broken ({faults})"), "a tree".to_owned())),
    }
}

/// Whether a triangle of the tree is in several leaves.
///
/// # Errors
/// If it is no tree, or one of the triangles before the last is in no leaf.
fn checked(tree: &PackedTree) -> Result<bool, String> {
    tree.unpack().map_err(|faults| summary(&faults))?;
    let mut seen = vec![false; tree.order.len()];
    for (position, &id) in tree.order.iter().enumerate() {
        match seen.get_mut(id as usize) {
            None => return Err(format!("position {position}: triangle {id} is not among the {}", tree.order.len())),
            Some(seen) => *seen = true,
        }
    }
    let triangles = seen.iter().rposition(|&seen| seen).map_or(0, |last| last + 1);
    match seen[..triangles].iter().position(|&seen| !seen) {
        Some(missing) => Err(format!("triangle {missing} is in no leaf")),
        None => Ok(triangles < tree.order.len()),
    }
}

/// The number of a layout in a file.
fn code(nodes: &PackedNodes) -> u32 {
    match (nodes.layout(), nodes.width()) {
        (Layout::Soa, Width::Four) => 1,
        (Layout::Soa, Width::Eight) => 2,
        (Layout::Cwbvh, _) => 3,
    }
}

/// Elements made of little-endian words.
fn elements<T: Pod>(bytes: &[u8]) -> Vec<T> {
    let words = bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    let words: Vec<u32> = words.collect();
    bytemuck::pod_collect_to_vec(&words)
}

#[cfg(test)]
mod tests {
    use super::super::{WideSettings, collapse};
    use super::*;
    use crate::bvh::testing::tree;

    const HASH: &str = "00112233445566778899aabbccddeeff";

    fn packed(n: usize, width: Width, layout: Layout) -> PackedTree {
        let settings = WideSettings { width, layout, ..WideSettings::default() };
        PackedTree::new(&collapse(&tree(n, 7).1, &settings).unwrap(), layout).unwrap()
    }

    #[test]
    fn every_layout_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wide.bvh");
        for (width, layout) in [(Width::Four, Layout::Soa), (Width::Eight, Layout::Soa), (Width::Eight, Layout::Cwbvh)]
        {
            for n in [1, 2, 9, 300] {
                let tree = packed(n, width, layout);
                write(&path, &tree, HASH).unwrap();
                assert_eq!(read(&path).unwrap(), WideFile { tree, scene_hash: HASH.to_owned() });
                let error = crate::bvh::file::read(&path).unwrap_err().to_string();
                assert!(error.contains("the version is 2, but must be 1"), "{error}");
            }
        }
    }

    #[test]
    fn what_is_not_a_tree_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wide.bvh");
        let mut tree = packed(20, Width::Eight, Layout::Cwbvh);
        assert!(matches!(write(&path, &tree, "00"), Err(TreeFileError::SceneHash { .. })));
        let second = tree.order.iter().position(|&id| id == 1).unwrap();
        tree.order[second] = 0;
        assert!(matches!(write(&path, &tree, HASH), Err(TreeFileError::BrokenTree { .. })), "triangle 1 is nowhere");
        tree.order.pop();
        assert!(matches!(write(&path, &tree, HASH), Err(TreeFileError::BrokenTree { .. })));
        assert!(!path.exists());
    }

    #[test]
    fn a_triangle_may_be_in_several_leaves() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wide.bvh");
        let mut tree = packed(20, Width::Eight, Layout::Cwbvh);
        let last = tree.order.iter().position(|&id| id == 19).unwrap();
        tree.order[last] = 0;
        write(&path, &tree, HASH).unwrap();
        assert_eq!(read(&path).unwrap().tree, tree);
        let mut bytes = std::fs::read(&path).unwrap();
        assert_eq!(bytes[20..24], [3, 1, 0, 0]);
        bytes[21] = 0;
        let end = bytes.len() - CHECKSUM_BYTES;
        let checksum = blake3::hash(&bytes[..end]);
        bytes[end..].copy_from_slice(&checksum.as_bytes()[..CHECKSUM_BYTES]);
        let error = decode(&path, &bytes).unwrap_err().to_string();
        assert!(error.contains("the layout is 3, but must be 256 more: a triangle is there twice"), "{error}");
    }

    #[test]
    fn every_byte_that_changes_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wide.bvh");
        write(&path, &packed(9, Width::Eight, Layout::Cwbvh), HASH).unwrap();
        let good = std::fs::read(&path).unwrap();
        for at in 0..good.len() {
            let mut bytes = good.clone();
            bytes[at] ^= 1;
            // The hash of the scene may be any, but the checksum covers it.
            assert!(decode(&path, &bytes).is_err(), "byte {at}");
            assert!(decode(&path, &good[..at]).is_err(), "{at} bytes");
        }
        assert!(decode(&path, &[&good[..], &[0]].concat()).is_err());
        // Also behind a right checksum.
        for at in (8..20).chain(HEADER_BYTES..good.len() - CHECKSUM_BYTES) {
            let mut bytes = good.clone();
            bytes[at] ^= 0x80;
            let end = bytes.len() - CHECKSUM_BYTES;
            let checksum = blake3::hash(&bytes[..end]);
            bytes[end..].copy_from_slice(&checksum.as_bytes()[..CHECKSUM_BYTES]);
            if let Ok(file) = decode(&path, &bytes) {
                // Another box, as good as the first one.
                assert!(file.tree.unpack().is_ok(), "byte {at}");
            }
        }
    }
}

//! Files come back as they were, and a file with anything wrong in it is refused with the place named.

use super::super::envelope::MAGIC;
use super::super::testing::{Rng, renumbered, tree};
use super::super::{tree_hash, validate};
use super::*;
use proptest::prelude::*;

const SCENE: &str = "00112233445566778899aabbccddeeff";

fn encoded(tree: &Bvh) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/tree.bvh");
    write(&path, tree, SCENE).unwrap();
    std::fs::read(path).unwrap()
}

fn decoded(bytes: &[u8]) -> Result<TreeFile, TreeFileError> {
    decode(Path::new("some/tree.bvh"), bytes)
}

/// Puts the right checksum under changed bytes, so that only the change itself can be found.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let at = bytes.len() - CHECKSUM_BYTES;
    let checksum = blake3::hash(&bytes[..at]);
    bytes[at..].copy_from_slice(&checksum.as_bytes()[..CHECKSUM_BYTES]);
    bytes
}

/// Where and what, of a file that must be refused.
fn refused(bytes: &[u8]) -> (usize, &'static str, String) {
    let error = decoded(bytes).unwrap_err();
    assert!(error.to_string().starts_with("some/tree.bvh: "), "{error}");
    match error {
        TreeFileError::Malformed { offset, what, value, .. } => (offset, what, value),
        other => panic!("{other}"),
    }
}

fn put(bytes: &[u8], at: usize, word: u32) -> Vec<u8> {
    let mut changed = bytes.to_vec();
    changed[at..at + 4].copy_from_slice(&word.to_le_bytes());
    sealed(changed)
}

fn get(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

proptest! {
    #[test]
    fn round_trip(n in 1usize..60, seed: u64) {
        let (triangles, tree) = tree(n, seed);
        let bytes = encoded(&tree);
        prop_assert_eq!(bytes.len(), 64 + 32 * (2 * n - 1) + 4 * n + 16);
        let file = decoded(&bytes).unwrap();
        prop_assert_eq!(&file.scene_hash, SCENE);
        prop_assert_eq!(tree_hash(&file.tree), tree_hash(&tree));
        prop_assert!(validate(&file.tree, Some(&triangles)).is_ok());
        // Canonical: whatever the numbering was, the bytes are the same, also when written again.
        prop_assert_eq!(encoded(&file.tree), bytes.clone());
        prop_assert_eq!(encoded(&renumbered(&tree, &mut Rng::new(seed))), bytes);
    }

    #[test]
    fn any_flipped_byte_is_found(n in 1usize..20, seed: u64, at: prop::sample::Index, flip in 1u8..) {
        let mut bytes = encoded(&tree(n, seed).1);
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        prop_assert!(decoded(&bytes).is_err());
    }

    /// With the checksum right again the change must be found by what it means, or make another tree.
    #[test]
    fn flipped_and_sealed_bytes_do_no_harm(n in 1usize..20, seed: u64, at: prop::sample::Index, word: u32, small: bool) {
        let bytes = encoded(&tree(n, seed).1);
        let at = at.index((bytes.len() - CHECKSUM_BYTES) / 4) * 4;
        let changed = put(&bytes, at, if small { word % 50 } else { word });
        if let Ok(file) = decoded(&changed) {
            prop_assert!(structure_faults(&file.tree).is_empty());
            if changed != bytes {
                prop_assert!(file.scene_hash != SCENE || tree_hash(&file.tree) != tree_hash(&decoded(&bytes).unwrap().tree)
                    // -0.0 is read as it stands but is no other box.
                    || word == 0x8000_0000);
            }
        }
    }

    #[test]
    fn any_truncation_is_found(n in 1usize..20, seed: u64, at: prop::sample::Index) {
        let bytes = encoded(&tree(n, seed).1);
        let cut = at.index(bytes.len());
        prop_assert!(decoded(&bytes[..cut]).is_err());
        if cut >= 128 {
            prop_assert!(decoded(&sealed(bytes[..cut].to_vec())).is_err());
        }
    }

    #[test]
    fn garbage_is_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(decoded(&bytes).is_err());
        let mut with_magic = MAGIC.to_vec();
        with_magic.extend(&bytes);
        prop_assert!(decoded(&with_magic).is_err());
    }
}

#[test]
fn each_fault_of_the_header_is_named() {
    let bytes = encoded(&tree(8, 1).1);
    let mut changed = bytes.clone();
    changed[1] = b'Q';
    assert_eq!(refused(&sealed(changed)), (0, "the magic number", r"PQBVH\r\n\x1a".into()));
    assert_eq!(refused(b""), (0, "the magic number", String::new()));
    assert_eq!(refused(&put(&bytes, 8, 2)), (8, "the version", "2".into()));
    assert_eq!(refused(&put(&bytes, 12, 0)), (12, "the number of triangles", "0".into()));
    assert_eq!(refused(&put(&bytes, 16, 16)), (16, "the number of nodes", "16".into()));
    assert_eq!(refused(&put(&bytes, 16, 17)), (16, "the number of nodes", "17".into()));
    assert_eq!(refused(&put(&bytes, 20, 8)), (20, "the number of triangles of a tree with splits", "8".into()));
    let (_, what, value) = refused(&put(&bytes, 20, 5));
    assert!(what == "triangle" && ["5", "6", "7"].contains(&&*value), "{value}");
    assert_eq!(refused(&put(&bytes, 40, 5)), (40, "a reserved byte", "5".into()));
    assert_eq!(refused(&put(&bytes, 60, 9)), (60, "a reserved byte", "9".into()));
    let end = bytes.len();
    let (offset, what, value) = refused(&bytes[..end - 1]);
    assert_eq!((offset, what, value), (end - 1, "the length of the file", format!("{} bytes", end - 1)));
    let mut longer = bytes.clone();
    longer.push(0);
    assert_eq!(refused(&longer).0, end);
    // A header that promises 4 GiB of triangles must not cost 4 GiB.
    assert_eq!(refused(&put(&bytes, 12, u32::MAX)).1, "the length of the file");
    let mut unsealed = bytes.clone();
    unsealed[64] ^= 1;
    assert_eq!(refused(&unsealed).1, "the checksum");
}

#[test]
fn each_fault_of_the_nodes_is_named() {
    let bytes = encoded(&tree(8, 1).1);
    let node = |v: usize| 64 + 32 * v;
    let order = node(15);
    let is_leaf = |v: usize| get(&bytes, node(v) + 28) != 0;
    let leaf = (0..15).find(|&v| is_leaf(v)).unwrap();
    let internal = (1..15).find(|&v| !is_leaf(v)).unwrap();

    // A ring, a link past the end, a link to a neighbour's children.
    for child in [0, 5, 14, 15, u32::MAX] {
        assert_eq!(refused(&put(&bytes, node(0) + 12, child)), (node(0) + 12, "left child", child.to_string()));
    }
    let wrong = get(&bytes, node(internal) + 12) + 2;
    assert_eq!(
        refused(&put(&bytes, node(internal) + 12, wrong)),
        (node(internal) + 12, "left child", wrong.to_string())
    );
    assert_eq!(refused(&put(&bytes, node(leaf) + 12, 77)), (node(leaf) + 12, "first position", "77".into()));
    assert_eq!(refused(&put(&bytes, node(leaf) + 28, 99)), (node(leaf) + 28, "triangles of a leaf", "99".into()));
    // A leaf of all triangles as the root leaves the other nodes over.
    let mut changed = put(&bytes, node(0) + 12, 0);
    changed = put(&changed, node(0) + 28, 8);
    assert_eq!(refused(&changed), (node(1), "nodes", "15".into()));
    assert_eq!(refused(&put(&bytes, order, 8)), (order, "triangle", "8".into()));
    let twice = get(&bytes, order);
    assert_eq!(refused(&put(&bytes, order + 4, twice)), (order + 4, "triangle", twice.to_string()));
}

#[test]
fn nodes_and_triangles_left_over_or_missing_are_named() {
    // One leaf that holds one of two triangles.
    let (_, tree) = tree(2, 1);
    let bytes = encoded(&tree);
    let mut one = bytes[..64 + 32].to_vec();
    one.extend_from_slice(&bytes[64 + 96..]);
    let one = put(&put(&put(&one, 16, 1), 64 + 12, 0), 64 + 28, 1);
    assert_eq!(refused(&one), (64 + 32 + 4, "triangles", "2".into()));
    // An internal root without room for children.
    let alone = put(&put(&one, 64 + 28, 0), 64 + 12, 1);
    assert_eq!(refused(&alone), (64 + 12, "left child", "1".into()));
}

#[test]
fn a_broken_tree_and_a_bad_hash_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree.bvh");
    let (_, mut tree) = tree(4, 1);
    for hash in ["", "0", "zz112233445566778899aabbccddeeff", "+0112233445566778899aabbccddeeff"] {
        assert!(matches!(write(&path, &tree, hash), Err(TreeFileError::SceneHash { .. })));
    }
    tree.triangle_order[0] = 9;
    let error = write(&path, &tree, SCENE).unwrap_err();
    assert!(error.to_string().contains("triangle 9"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(read(folder.path()), Err(TreeFileError::Read { .. })));
    let error = read(&folder.path().join("missing.bvh")).unwrap_err();
    assert!(error.to_string().contains("missing.bvh"), "{error}");
    let path = folder.path().join("tree.bvh");
    write(&path, &tree(4, 1).1, SCENE).unwrap();
    assert_eq!(read(&path).unwrap().tree.triangle_order.len(), 4);
}

#[test]
fn a_tree_with_splits_comes_back() {
    let (_, mut with_splits) = tree(8, 1);
    // Two triangles of the last are pieces of the others.
    with_splits.triangle_order.iter_mut().for_each(|triangle| *triangle %= 6);
    let read = decoded(&encoded(&with_splits)).unwrap();
    assert_eq!((tree_hash(&read.tree), read.tree.references()), (tree_hash(&with_splits), 8));
    assert!(read.tree.has_splits(6));
    with_splits.triangle_order.iter_mut().for_each(|triangle| *triangle = if *triangle == 3 { 2 } else { *triangle });
    let missing = std::panic::catch_unwind(|| encoded(&with_splits));
    assert!(missing.is_err(), "a triangle in no leaf was written");
}

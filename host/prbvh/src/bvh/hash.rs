//! One number that says whether two trees are the same.

use super::Bvh;
use super::layout::FlatTree;
use prbvh_kernel::aabb::Aabb;

/// 128 bits of BLAKE3 over the canonical layout (that of the tree file), as 32 hexadecimal digits.
///
/// It covers links, left and right, triangle ids and the bits of every box, but not the numbering of nodes: the hashes of two trees
/// are equal if and only if (up to collisions) the trees are equal bit for bit, whichever device numbered them. The sign of a zero
/// is left out: -0.0 is hashed as +0.0.
///
/// # Panics
/// If the links are no tree.
#[must_use]
pub fn tree_hash(tree: &Bvh) -> String {
    let mut hasher = blake3::Hasher::new();
    // The counts keep two different pairs of arrays from running together to the same bytes.
    hasher.update(&(tree.nodes.len() as u64).to_le_bytes());
    hasher.update(&(tree.triangle_order.len() as u64).to_le_bytes());
    for bytes in FlatTree::new(tree).into_little_endian().bytes() {
        hasher.update(bytes);
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

/// [`tree_hash`] of the tree without its boxes: links, left and right, and triangle ids alone.
///
/// # Panics
/// If the links are no tree.
#[must_use]
pub fn topology_hash(tree: &Bvh) -> String {
    let mut bare = tree.clone();
    bare.nodes.iter_mut().for_each(|node| node.aabb = Aabb { min: [0.0; 3], max: [0.0; 3] });
    tree_hash(&bare)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Rng, renumbered, tree};
    use super::super::{BvhNode, Content};
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    proptest! {
        #[test]
        fn numbering_does_not_matter(n in 1usize..100, seed: u64) {
            let (_, tree) = tree(n, seed);
            prop_assert_eq!(tree_hash(&tree), tree_hash(&renumbered(&tree, &mut Rng::new(seed))));
        }
    }

    #[test]
    fn every_change_matters() {
        let (_, whole) = tree(30, 6);
        let change = |f: &dyn Fn(&mut Bvh)| {
            let mut tree = whole.clone();
            f(&mut tree);
            tree_hash(&tree)
        };
        let hashes = [
            tree_hash(&whole),
            change(&|tree| tree.triangle_order.swap(3, 4)),
            change(&|tree| tree.nodes[7].aabb.min[0] = tree.nodes[7].aabb.min[0].next_up()),
            change(&|tree| tree.nodes[31].aabb.max[2] = tree.nodes[31].aabb.max[2].next_up()),
            change(&|tree| {
                let BvhNode { content: Content::Internal { left, right }, .. } = &mut tree.nodes[0] else { panic!() };
                std::mem::swap(left, right);
            }),
        ];
        assert_eq!(hashes.iter().collect::<HashSet<_>>().len(), hashes.len());
        assert!(hashes.iter().all(|hash| hash.len() == 32 && hash.bytes().all(|c| c.is_ascii_hexdigit())));
    }

    #[test]
    fn a_topology_has_no_boxes() {
        let (_, whole) = tree(30, 6);
        let hash = topology_hash(&whole);
        let mut other = whole.clone();
        other.nodes[7].aabb.min[0] = -1.0;
        assert_eq!(topology_hash(&other), hash);
        other.triangle_order.swap(3, 4);
        assert_ne!(topology_hash(&other), hash);
    }

    #[test]
    fn the_sign_of_zero_does_not_matter() {
        let (triangles, mut tree) = tree(3, 6);
        tree.nodes[0].aabb.min[0] = 0.0;
        let plus = tree_hash(&tree);
        tree.nodes[0].aabb.min[0] = -0.0;
        assert_eq!(tree_hash(&tree), plus);
        assert_ne!(tree_hash(&tree.with_boxes_of(&triangles)), plus);
    }

    /// A change of layout or hash is a change of format: it must be meant.
    #[test]
    fn the_hash_of_a_known_tree_stays() {
        let (triangles, tree) = tree(10, 42);
        assert_eq!(tree_hash(&tree.with_boxes_of(&triangles)), "a7dd58ce69b0cf5d99368b4b5544e860");
    }
}

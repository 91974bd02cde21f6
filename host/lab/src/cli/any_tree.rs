//! Trees of a file, binary or wide.

use prbvh::bvh::file::{self, TreeFileError};
use prbvh::bvh::{self, Bvh};
use prbvh::scene::Triangle;
use prbvh::wide::{self, PackedTree};
use prbvh_lab::render::TracedTree;
use std::path::Path;

/// What a tree file holds.
#[derive(Clone, Debug)]
pub(super) enum AnyTree {
    /// Version 1.
    Binary(Bvh),
    /// Version 2.
    Wide(PackedTree),
}

impl AnyTree {
    /// The tree and the hash of its scene.
    ///
    /// # Errors
    /// If there is no such file, or it is not as its version says.
    pub(super) fn read(path: &Path) -> Result<(Self, String), TreeFileError> {
        if file::version(path)? == wide::file::VERSION {
            let wide = wide::file::read(path)?;
            return Ok((Self::Wide(wide.tree), wide.scene_hash));
        }
        let binary = file::read(path)?;
        Ok((Self::Binary(binary.tree), binary.scene_hash))
    }

    /// # Errors
    /// All faults, in words.
    pub(super) fn validate(&self, triangles: Option<&[Triangle]>) -> Result<(), Vec<String>> {
        match self {
            Self::Binary(tree) => {
                let checked = match triangles {
                    Some(triangles) => bvh::validate_tree(tree, triangles),
                    None => bvh::validate(tree, None),
                };
                checked.map(|_| ()).map_err(|faults| texts(&faults))
            }
            Self::Wide(tree) => {
                let tree = tree.unpack().map_err(|faults| texts(&faults))?;
                // Of pieces the boxes are not those of the triangles.
                let whole = triangles.filter(|triangles| triangles.len() >= tree.triangle_order.len());
                wide::validate(&tree, whole).map_err(|faults| texts(&faults))
            }
        }
    }

    pub(super) fn traced(&self) -> TracedTree<'_> {
        match self {
            Self::Binary(tree) => tree.into(),
            Self::Wide(tree) => tree.into(),
        }
    }

    pub(super) fn hash(&self) -> String {
        match self {
            Self::Binary(tree) => bvh::tree_hash(tree),
            Self::Wide(tree) => tree.hash(),
        }
    }
}

fn texts<T: ToString>(faults: &[T]) -> Vec<String> {
    faults.iter().map(ToString::to_string).collect()
}

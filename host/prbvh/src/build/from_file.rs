//! The initial tree out of a file.

use super::top_down::fill_boxes;
use crate::bvh::EncodeError;
use crate::bvh::file::{self, TreeFileError};
use crate::scene::Scene;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use std::path::{Path, PathBuf};

/// Why a file gives no initial tree.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TreeOfFileError {
    /// The file cannot be read or is no tree.
    #[error(transparent)]
    File(#[from] TreeFileError),
    /// It is a tree over another scene.
    #[error(
        "{path} is a tree over {have_triangles} triangles with the hash {have}, but {scene} has {need_triangles} with {need}"
    )]
    OtherScene {
        /// The file.
        path: PathBuf,
        /// Where the scene came from.
        scene: String,
        /// Hash of the scene that the tree was made for.
        have: String,
        /// Hash of the scene.
        need: String,
        /// Triangles of the tree.
        have_triangles: usize,
        /// Triangles of the scene.
        need_triangles: usize,
    },
    /// A triangle is in several of its leaves.
    #[error("{path} is a tree with splits: these cannot be optimised from a file")]
    Splits {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be optimised as it is.
    #[error("{path}")]
    Encode {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: EncodeError,
    },
}

/// Reads the tree over `scene` from a `tree.bvh`. Returns `nodes[2n-1]` with the boxes of `triangles`: those of the scene in working
/// coordinates ([`SafeRange`](crate::scene::SafeRange)).
///
/// # Errors
/// If the file is no tree, is a tree over other triangles, or has leaves of several triangles.
///
/// # Panics
/// If `triangles` are not as many as the scene has.
pub fn from_file(path: &Path, scene: &Scene, triangles: &[Triangle]) -> Result<Vec<Node>, TreeOfFileError> {
    assert_eq!(triangles.len(), scene.triangles.len(), "the triangles are those of the scene");
    let file = file::read(path)?;
    if file.scene_hash == scene.hash && file.tree.has_splits(triangles.len()) {
        return Err(TreeOfFileError::Splits { path: path.to_owned() });
    }
    let have_triangles = file.tree.triangle_order.len();
    if file.scene_hash != scene.hash || have_triangles != triangles.len() {
        return Err(TreeOfFileError::OtherScene {
            path: path.to_owned(),
            scene: scene.source.clone(),
            have: file.scene_hash,
            need: scene.hash.clone(),
            have_triangles,
            need_triangles: triangles.len(),
        });
    }
    let encoded = file.tree.to_device();
    let mut nodes = encoded.map_err(|source| TreeOfFileError::Encode { path: path.to_owned(), source })?;
    let count = nodes.len() / 2;
    let (internal, leaves) = nodes.split_at_mut(count);
    fill_boxes((internal, 0), (leaves, count as u32), triangles);
    Ok(nodes)
}

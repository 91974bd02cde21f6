//! Trees that rays go through.

use prbvh::bvh::Bvh;
use prbvh::device::Device;
use prbvh::scene::{Aabb, Scene, Triangle};
use prbvh::trace::{TraceError, TraceScene};
use prbvh::wide::PackedTree;

/// A tree of whatever width.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum TracedTree<'a> {
    /// Nodes of two children.
    Binary(&'a Bvh),
    /// Nodes of several, in a layout.
    Wide(&'a PackedTree),
}

impl<'a> From<&'a Bvh> for TracedTree<'a> {
    fn from(tree: &'a Bvh) -> Self {
        Self::Binary(tree)
    }
}

impl<'a> From<&'a PackedTree> for TracedTree<'a> {
    fn from(tree: &'a PackedTree) -> Self {
        Self::Wide(tree)
    }
}

impl TracedTree<'_> {
    /// Puts it on a device ([`TraceScene::new`], [`TraceScene::of_wide`]).
    ///
    /// # Errors
    /// As these.
    pub fn on(
        self,
        device: &mut dyn Device,
        triangles: &[Triangle],
        starts: &[[f32; 3]],
    ) -> Result<TraceScene, TraceError> {
        match self {
            Self::Binary(tree) => TraceScene::new(device, tree, triangles, starts),
            Self::Wide(tree) => TraceScene::of_wide(device, tree, triangles, starts),
        }
    }
}

/// The box around the scene, which is that of the root of an exact tree.
pub(super) fn bounds(scene: &Scene) -> Aabb {
    Aabb { min: scene.census.min.map(|x| x + 0.0), max: scene.census.max.map(|x| x + 0.0) }
}

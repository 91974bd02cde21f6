//! The wide tree beside the one handed out.

use super::PipelineError;
use crate::bvh::Bvh;
use crate::device::{Device, Timing, on_host};
use crate::scene::Scene;
use crate::wide::{self, PackedTree, WideQuality, WideSettings, collapse_on, validate};

/// A wide tree.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WideTree {
    /// Its nodes in the layout that was asked for.
    pub tree: PackedTree,
    /// Quality by the costs that decided, of the boxes as they were before they were packed.
    pub quality: WideQuality,
}

/// The wide tree of `tree`, validated as it is packed, where a triangle is in several leaves without the triangles; and the times of the device.
pub(super) fn wide_tree(
    tree: &Bvh,
    scene: &Scene,
    device: &mut dyn Device,
    settings: &WideSettings,
) -> Result<(WideTree, Vec<Timing>), PipelineError> {
    let (wide, timings) = collapse_on(device, tree, settings)?;
    on_host(device, || {
        let invalid = |faults| PipelineError::InvalidWideTree { faults };
        let quality = wide::quality(&wide, &settings.costs());
        let packed = PackedTree::new(&wide, settings.layout).expect("leaves were made for the layout");
        let triangles = (!tree.has_splits(scene.triangles.len())).then_some(&*scene.triangles);
        validate(&packed.unpack().map_err(invalid)?, triangles).map_err(invalid)?;
        Ok((WideTree { tree: packed, quality }, timings))
    })
}

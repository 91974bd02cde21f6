//! Trees that leave a device: validated, in the boxes of the scene, measured, of bounded depth.
//!
//! A whole run takes most memory here. So nothing is kept that is not needed: nodes come in pieces, links are made in place.

use super::{PipelineError, working_triangles};
use crate::build::DeviceTree;
use crate::bvh::{self, Bvh, DepthBound, MaxDepth, Quality, SahModel, TreeFault};
use crate::collapse::{CollapseSettings, collapse_sound};
use crate::device::{Device, DeviceError, DeviceInfo, Timing, on_host};
use crate::fold::Fold;
use crate::scene::Scene;
use crate::stop::Stop;

/// The device's tree, unfolded, with the boxes of the original triangles, validated; unless there is a stop and an end is asked for.
pub(super) fn hand_out(
    (tree, fold): (&DeviceTree, Option<&Fold>),
    scene: &Scene,
    device: &mut dyn Device,
    (stage, stop): (&'static str, Option<&Stop>),
) -> Result<(Bvh, Quality), PipelineError> {
    let decoded = tree.decode(device, fold.map_or(0, |fold| 2 * fold.folded()))?;
    let decoded = match fold {
        Some(fold) => decoded.map(|tree| fold.unfold(tree)),
        None => decoded,
    };
    measured(decoded, scene, device.info(), (stage, stop), &SahModel::default())
}

/// A decoded tree with the boxes of the original triangles, validated, and its quality.
fn measured(
    decoded: Result<Bvh, Vec<TreeFault>>,
    scene: &Scene,
    device: &DeviceInfo,
    (stage, stop): (&'static str, Option<&Stop>),
    sah: &SahModel,
) -> Result<(Bvh, Quality), PipelineError> {
    let invalid = |faults| PipelineError::InvalidTree { stage, device: device.name.clone(), faults };
    let go_on = || if stop.is_some_and(Stop::is_asked) { Err(DeviceError::Stopped) } else { Ok(()) };
    go_on()?;
    let tree = decoded.map_err(invalid)?.with_boxes_of(&scene.triangles);
    go_on()?;
    bvh::validate(&tree, Some(&scene.triangles)).map_err(invalid)?;
    let quality = bvh::quality(&tree, sah);
    Ok((tree, quality))
}

/// The tree within the bound on its depth; validated again where that changed it.
pub(super) fn bounded(
    (mut tree, quality): (Bvh, Quality),
    scene: &Scene,
    device: &dyn Device,
    max_depth: MaxDepth,
) -> Result<(Bvh, Quality, Option<DepthBound>), PipelineError> {
    if max_depth.allows(quality.max_depth) {
        return Ok((tree, quality, None));
    }
    let sah = SahModel::default();
    let bound = on_host(device, || bvh::bound_depth(&mut tree, max_depth, &sah))?;
    let mut faults = bvh::validate(&tree, Some(&scene.triangles)).err().unwrap_or_default();
    if faults.is_empty() {
        faults.extend(max_depth.fault(&tree));
    }
    if !faults.is_empty() {
        let device = device.info().name.clone();
        return Err(PipelineError::InvalidTree { stage: "bound on the depth", device, faults });
    }
    let quality = bvh::quality(&tree, &sah);
    Ok((tree, quality, bound))
}

/// A tree over all triangles, in working coordinates, on the device.
pub(super) fn upload_whole(tree: Bvh, scene: &Scene, device: &mut dyn Device) -> Result<DeviceTree, PipelineError> {
    let tree = tree.with_boxes_of(&working_triangles(scene, device));
    let nodes = tree.to_device()?;
    drop(tree);
    Ok(DeviceTree::upload(device, &nodes)?)
}

/// The device's tree with adaptive leaves, validated.
pub(super) fn hand_out_collapsed(
    tree: &DeviceTree,
    scene: &Scene,
    device: &mut dyn Device,
    settings: &CollapseSettings,
) -> Result<(Bvh, Quality, Vec<Timing>), PipelineError> {
    let mut collapsed = collapse_sound(device, tree, settings)?;
    let timings = std::mem::take(&mut collapsed.timings);
    let (tree, quality) =
        measured(Ok(collapsed.free(device)), scene, device.info(), ("collapse", None), &settings.sah)?;
    Ok((tree, quality, timings))
}

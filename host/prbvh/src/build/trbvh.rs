//! TRBVH: passes of treelet restructuring, each treelet the best of all over its leaves (Karras & Aila 2013).

use super::treelets::{Pass, Restructured, Way, lbvh_by, restructure_by};
use super::{Codes, DeviceTree, Input, UnfitTree};
use crate::device::{Device, DeviceError, Timing};
use prbvh_kernel::Kernel;
use prbvh_kernel::atrbvh::OPTIMAL_TREELET;
use std::num::NonZeroU32;

/// Builds an LBVH over `triangles`, whose coordinates are in the safe range (`crate::scene::SafeRange`), and restructures it. Returns the tree with
/// the times of its stages and its passes, `passes` at the most. Triangles that are handed over are freed as soon as the device has them.
///
/// # Errors
/// If there are no triangles, they do not fit the device or [are out of range](crate::scene::SafeRange::check), or the device fails.
pub fn trbvh<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
    passes: NonZeroU32,
) -> Result<(DeviceTree, Vec<Timing>, Vec<Pass>), DeviceError> {
    lbvh_by(device, triangles, codes, way(passes))
}

/// Restructures a tree in place, whose boxes are right (refitted). Its root, its leaves and what it is a tree over stay; its SAH cost
/// does not rise. `observe` is called after every pass.
///
/// Treelets have 7 leaves. The first pass takes those below every node of at least 7 references, and each further one doubles that bound (γ), so that
/// it takes about half the time of the one before; there are `passes` at the most, fewer where γ is beyond the tree or a pass changed nothing.
///
/// # Errors
/// If [`DeviceTree::check`] finds fault with the tree, before anything runs, or the device fails; the tree is then not to be used.
pub fn restructure_optimally(
    device: &mut dyn Device,
    tree: &DeviceTree,
    passes: NonZeroU32,
    observe: &mut dyn FnMut(&Pass, &mut dyn Device),
) -> Result<Restructured, UnfitTree> {
    tree.check(device)?;
    Ok(restructure_optimally_unchecked(device, tree, passes, observe)?)
}

/// [`restructure_optimally`] of a tree that a builder of this library made.
#[doc(hidden)]
pub fn restructure_optimally_unchecked(
    device: &mut dyn Device,
    tree: &DeviceTree,
    passes: NonZeroU32,
    observe: &mut dyn FnMut(&Pass, &mut dyn Device),
) -> Result<Restructured, DeviceError> {
    restructure_by(device, tree, way(passes), observe)
}

fn way(passes: NonZeroU32) -> Way {
    Way { name: "TRBVH", kernel: Kernel::TrbvhRestructure, treelet: OPTIMAL_TREELET, most_passes: passes.get() }
}

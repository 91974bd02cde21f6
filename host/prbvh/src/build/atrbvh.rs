//! ATRBVH: passes of treelet restructuring by agglomerative clustering (Domingues & Pedrini 2015).

use super::treelets::{Pass, Restructured, Way, lbvh_by, restructure_by};
use super::{Codes, DeviceTree, Input, TreeletSize, UnfitTree};
use crate::device::{Device, DeviceError, Timing};
use prbvh_kernel::Kernel;

/// Builds an LBVH over `triangles`, whose coordinates are in the safe range (`crate::scene::SafeRange`), and restructures it. Returns the tree with
/// the times of its stages and its passes. Triangles that are handed over are freed as soon as the device has them.
///
/// # Errors
/// If there are no triangles, they do not fit the device or [are out of range](crate::scene::SafeRange::check), or the device fails.
pub fn atrbvh<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
    treelet: TreeletSize,
) -> Result<(DeviceTree, Vec<Timing>, Vec<Pass>), DeviceError> {
    lbvh_by(device, triangles, codes, way(treelet))
}

/// Restructures a tree in place, whose boxes are right (refitted). Its root, its leaves and what it is a tree over stay; its SAH cost
/// does not rise. `observe` is called after every pass.
///
/// The first pass takes treelets below every node of at least `treelet` references, and each further one doubles that bound (γ) until it is
/// beyond the tree. A tree of fewer references than `treelet` is one treelet. A pass that changed nothing is the last: the treelets of the
/// next would be some of those that it found good.
///
/// # Errors
/// If [`DeviceTree::check`] finds fault with the tree, before anything runs, or the device fails; the tree is then not to be used.
pub fn restructure(
    device: &mut dyn Device,
    tree: &DeviceTree,
    treelet: TreeletSize,
    observe: &mut dyn FnMut(&Pass, &mut dyn Device),
) -> Result<Restructured, UnfitTree> {
    tree.check(device)?;
    Ok(restructure_unchecked(device, tree, treelet, observe)?)
}

/// [`restructure`] of a tree that a builder of this library made.
#[doc(hidden)]
pub fn restructure_unchecked(
    device: &mut dyn Device,
    tree: &DeviceTree,
    treelet: TreeletSize,
    observe: &mut dyn FnMut(&Pass, &mut dyn Device),
) -> Result<Restructured, DeviceError> {
    restructure_by(device, tree, way(treelet), observe)
}

fn way(treelet: TreeletSize) -> Way {
    Way { name: "ATRBVH", kernel: Kernel::AtrbvhRestructure, treelet: treelet.get(), most_passes: u32::MAX }
}

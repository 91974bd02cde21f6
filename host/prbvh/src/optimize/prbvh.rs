//! PRBVH on a device, in either order of search.

use super::session::Outcome;
use super::{IterationRow, OptimizeError, Order, PrbvhSettings, TreeAreas, published, worst_first};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Lease};
use std::ops::ControlFlow;

/// Optimises a tree in place. `observe` sees the tree's every row and may break; the best tree so far is kept in every case.
///
/// Coordinates are those of the tree, which must be in the [range](crate::scene::SafeRange::check) of the kernels;
/// [`pipeline`](crate::pipeline) takes any and scales them.
///
/// # Errors
/// If a setting makes no sense or [`DeviceTree::check`] finds fault with the tree: then nothing has run. If the device fails or a kernel reports a fault:
/// then the tree is not to be used.
pub fn prbvh(
    device: &mut dyn Device,
    tree: &DeviceTree,
    settings: &PrbvhSettings,
    observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
) -> Result<Outcome, OptimizeError> {
    prbvh_from(device, tree, None, settings, observe)
}

/// The same for a tree whose boxes are right and whose areas are [measured](super::measure()): nothing is done that its maker has done. Without areas the
/// boxes are made anew first.
///
/// # Errors
/// As [`prbvh`].
pub fn prbvh_from(
    device: &mut dyn Device,
    tree: &DeviceTree,
    areas: Option<TreeAreas>,
    settings: &PrbvhSettings,
    observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
) -> Result<Outcome, OptimizeError> {
    settings.check()?;
    tree.check(device)?;
    Ok(prbvh_unchecked(device, tree, areas, settings, observe)?)
}

/// [`prbvh_from`] of a tree that this library made, in working coordinates, by settings that were checked; and of what is neither, for experiments.
#[doc(hidden)]
pub fn prbvh_unchecked(
    device: &mut dyn Device,
    tree: &DeviceTree,
    areas: Option<TreeAreas>,
    settings: &PrbvhSettings,
    observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
) -> Result<Outcome, DeviceError> {
    let device = &mut Lease::new(device);
    let outcome = match settings.order {
        Order::WorstFirst => worst_first::run(device, tree, areas, settings, observe)?,
        Order::Published => published::run(device, tree, areas, settings, observe)?,
    };
    // What the observer allocated is the observer's.
    device.keep();
    Ok(outcome)
}

//! PRBVH on a device, in either order of search.

use super::session::Outcome;
use super::{IterationRow, Order, PrbvhSettings, TreeAreas, published, worst_first};
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Lease};
use std::ops::ControlFlow;

/// Optimises a tree in place. `observe` sees the tree's every row and may break; the best tree so far is kept in every case.
///
/// # Errors
/// If the device fails.
pub fn prbvh(
    device: &mut dyn Device,
    tree: &DeviceTree,
    settings: &PrbvhSettings,
    observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
) -> Result<Outcome, DeviceError> {
    prbvh_from(device, tree, None, settings, observe)
}

/// The same for a tree whose boxes are right and whose areas are [measured](super::measure()): nothing is done that its maker has done. Without areas the
/// boxes are made anew first.
///
/// # Errors
/// If the device fails.
pub fn prbvh_from(
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

//! LBVH: hierarchy of the Morton codes, refit (Karras 2012).

use super::codes::Codes;
use super::order::MortonOrder;
use super::{DeviceTree, Input, Scratch, arrivals_length, record_refit};
use crate::device::{Device, DeviceError, Lease, Recording, Timing};

/// Builds a tree over `triangles`, whose coordinates are in the safe range (`crate::scene::SafeRange`). Returns it with the
/// times of its stages. Triangles that are handed over are freed as soon as the device has them.
///
/// # Errors
/// If there are no triangles, they do not fit the device or [are out of range](crate::scene::SafeRange::check), or the device fails.
pub fn lbvh<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
) -> Result<(DeviceTree, Vec<Timing>), DeviceError> {
    let device = &mut Lease::new(device);
    let mut recording = Recording::new();
    let (sorted, mut timings) = MortonOrder::record(&mut recording, device, triangles.into(), codes.into())?;
    let n = sorted.references;
    let tree = DeviceTree::allocate(device, n)?;
    sorted.record_leaves(&mut recording, "hierarchy", &tree.nodes);
    sorted.record_hierarchy(&mut recording, &tree.nodes);
    let mut scratch = Scratch::default();
    let arrivals = scratch.allocate(device, "arrivals", arrivals_length(n), 4)?;
    record_refit(&mut recording, n, &tree.nodes, &arrivals);
    timings.extend(device.run(&recording)?);
    scratch.free(device);
    sorted.free(device);
    device.keep();
    Ok((tree, timings))
}

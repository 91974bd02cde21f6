//! H-PLOC: the clusters of PLOC merge within the ranges of a radix tree, in one climb (Benthin et al. 2024).

use super::codes::Codes;
use super::order::MortonOrder;
use super::{DeviceTree, Input, Scratch};
use crate::device::{Device, DeviceError, Lease, Recording, Timing};
use prbvh_kernel::Kernel;
use prbvh_kernel::hploc::{HplocParams, STEPS};
use std::num::NonZeroU32;

/// Radius where none is asked for, as published.
pub const DEFAULT_HPLOC_RADIUS: NonZeroU32 = NonZeroU32::new(8).expect("not 0");

/// Stages that bring every climb to its end: a level for each bit of a code, and of a place in the order among equal ones.
const MOST_STAGES: u32 = (60 + 32) / STEPS + 1;

/// Stages of a climb between questions whether it is over. A radix tree of 60 bits is rarely deeper than 40 levels, four to a stage.
const STAGES_UNASKED: u32 = 10;

/// Builds a tree over `triangles`, whose coordinates are in the safe range (`crate::scene::SafeRange`); a cluster looks for its
/// nearest neighbour `radius` places to the left and to the right, among the 32 at most that meet in a range: from 31 on that is all. Returns the tree
/// with the times of its stages. Triangles that are handed over are freed as soon as the device has them.
///
/// # Errors
/// If there are no triangles, they do not fit the device or [are out of range](crate::scene::SafeRange::check), or the device fails.
pub fn hploc<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
    radius: NonZeroU32,
) -> Result<(DeviceTree, Vec<Timing>), DeviceError> {
    let device = &mut Lease::new(device);
    let mut recording = Recording::new();
    let (sorted, mut timings) = MortonOrder::record(&mut recording, device, triangles.into(), codes.into())?;
    let n = sorted.references;
    let tree = DeviceTree::allocate(device, n)?;
    sorted.record_leaves(&mut recording, "leaves", &tree.nodes);
    if n == 1 {
        timings.extend(device.run(&recording)?);
        sorted.free(device);
        device.keep();
        return Ok((tree, timings));
    }
    let radix = DeviceTree::allocate(device, n)?;
    sorted.record_hierarchy(&mut recording, &radix.nodes);
    timings.extend(device.run(&recording)?);
    sorted.free(device);

    let mut scratch = Scratch::default();
    let mut words = |label, length| scratch.allocate(device, label, length as usize, 4);
    let (clusters, spare, sizes) = (words("clusters", n)?, words("spare nodes", n)?, words("sizes", n - 1)?);
    let (arrivals, places, waiting) = (words("arrivals", n - 1)?, words("places", n)?, words("climbs", 1)?);
    let params = HplocParams { count: n, radius: radius.get() };
    let buffers = [&radix.nodes, &tree.nodes, &clusters, &spare, &sizes, &arrivals, &places, &waiting];
    let mut recording = Recording::new();
    recording.clear("merge", &arrivals);
    recording.clear("merge", &places);
    let mut climbs = 0u32;
    for _ in 0..MOST_STAGES.div_ceil(STAGES_UNASKED) {
        for _ in 0..STAGES_UNASKED {
            recording.clear("merge", &waiting);
            recording.dispatch("merge", Kernel::HplocStage, n, &params, &buffers);
        }
        recording.fetch("merge", &waiting, 4);
        timings.extend(device.run(&recording)?);
        recording = Recording::new();
        device.download(&waiting, bytemuck::bytes_of_mut(&mut climbs))?;
        if climbs == 0 {
            break;
        }
    }
    if climbs > 0 {
        let problem = format!("{climbs} climbs are not over after more levels than a radix tree has");
        let kernel = Kernel::HplocStage.info().name;
        return Err(DeviceError::Kernel { kernel, problem, device: device.info().name.clone() });
    }
    scratch.free(device);
    radix.free(device);
    device.keep();
    Ok((tree, timings))
}

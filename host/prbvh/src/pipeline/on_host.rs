//! The optimisers that are not the device's.

use super::PipelineError;
use crate::build::DeviceTree;
use crate::device::Device;
use crate::optimize::{self, CurrentTree, IterationRow, Outcome, RbvhSettings, StopReason};
use std::ops::ControlFlow;

type Observe<'a> = &'a mut dyn FnMut(&IterationRow, CurrentTree<'_>) -> ControlFlow<()>;

/// Runs RBVH on the device's tree, which comes back as another: the device holds none meanwhile.
pub(super) fn rbvh(
    tree: DeviceTree,
    device: &mut dyn Device,
    settings: &RbvhSettings,
    observe: Observe<'_>,
) -> Result<(DeviceTree, Outcome), PipelineError> {
    let decoded = tree.decode(device, 0)?.map_err(|faults| PipelineError::InvalidTree {
        stage: "builder",
        device: device.info().name.clone(),
        faults,
    })?;
    tree.free(device);
    let (nodes, outcome) = optimize::rbvh_of(decoded, settings, &mut |row, tree| observe(row, CurrentTree::Host(tree)));
    Ok((DeviceTree::upload(device, &nodes)?, outcome))
}

/// What is said of a tree of this cost that nothing optimised, and why.
pub(super) fn nothing(
    tree: &DeviceTree,
    device: &mut dyn Device,
    cost: f64,
    why: StopReason,
    observe: Observe<'_>,
) -> Outcome {
    let row = IterationRow { cost, ..IterationRow::default() };
    let is_cancelled = observe(&row, CurrentTree::Device(tree, device, None)).is_break();
    let stop = if is_cancelled { StopReason::Cancelled } else { why };
    Outcome { rows: vec![row], stop, timings: Vec::new(), working_bytes: 0 }
}

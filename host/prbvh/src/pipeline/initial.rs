//! The tree that a run starts from.

use super::PipelineError;
use crate::build::{self, Codes, DeviceTree};
use crate::device::{Device, Timing, on_host};
use crate::scene::Scene;
#[cfg(not(feature = "atrbvh"))]
use crate::settings::FeatureOff;
use crate::settings::Initial;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use std::time::Instant;

/// The tree to start from, on the device, and the times of its stages.
pub(super) fn initial_tree(
    #[cfg_attr(
        not(feature = "files"),
        expect(unused_variables, reason = "only a tree of a file is asked whose it is")
    )]
    scene: &Scene,
    working: Vec<Triangle>,
    device: &mut dyn Device,
    (initial, codes): (&Initial, Codes),
) -> Result<(DeviceTree, Vec<Timing>), PipelineError> {
    let start = Instant::now();
    let (label, nodes): (_, Vec<Node>) = match initial {
        Initial::Lbvh => return Ok(build::lbvh(device, working, codes)?),
        Initial::Ploc { radius } => {
            let (tree, timings, _) = build::ploc(device, working, codes, *radius)?;
            return Ok((tree, timings));
        }
        #[cfg(feature = "atrbvh")]
        Initial::Atrbvh { treelet } => {
            let (tree, timings, _) = build::atrbvh(device, working, codes, *treelet)?;
            return Ok((tree, timings));
        }
        #[cfg(not(feature = "atrbvh"))]
        Initial::Atrbvh { .. } => return Err(FeatureOff { method: "atrbvh", feature: "atrbvh" }.into()),
        Initial::SahSweep => ("sah sweep", on_host(device, || build::sah_sweep(&working))),
        Initial::SahBinned => ("sah binned", on_host(device, || build::sah_binned(&working))),
        #[cfg(feature = "files")]
        Initial::File { path } => ("read tree", build::from_file(path, scene, &working)?),
    };
    drop(working);
    let timing = Timing { label, seconds: start.elapsed().as_secs_f64() };
    Ok((DeviceTree::upload(device, &nodes)?, vec![timing]))
}

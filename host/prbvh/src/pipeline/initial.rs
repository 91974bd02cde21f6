//! The tree that a run starts from.

use super::PipelineError;
use super::host_tree::build_on_host;
use crate::build::{self, Codes, DeviceTree};
use crate::device::{Device, DeviceError, Timing, on_host};
use crate::references::References;
use crate::scene::Scene;
#[cfg(not(feature = "atrbvh"))]
use crate::settings::FeatureOff;
use crate::settings::{Initial, Settings};
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
    given: Option<&References>,
    working: Vec<Triangle>,
    device: &mut dyn Device,
    (settings, codes): (&Settings, Codes),
) -> Result<(DeviceTree, Vec<Timing>), PipelineError> {
    let start = Instant::now();
    let stop = settings.limits().stop.as_ref();
    let (label, nodes): (_, Vec<Node>) = match &settings.initial {
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
        #[cfg(feature = "atrbvh")]
        Initial::Trbvh { passes } => {
            let (tree, timings, _) = build::trbvh(device, working, codes, *passes)?;
            return Ok((tree, timings));
        }
        #[cfg(not(feature = "atrbvh"))]
        Initial::Trbvh { .. } => return Err(FeatureOff { method: "trbvh", feature: "atrbvh" }.into()),
        Initial::Hploc { radius } => return Ok(build::hploc(device, working, codes, *radius)?),
        Initial::KMeans { kmeans } => return Ok(build::kmeans_unchecked(device, working, codes, kmeans)?),
        Initial::SahSweep
        | Initial::SahBinned { .. }
        | Initial::Agglomerative
        | Initial::Aac { .. }
        | Initial::Insertion { .. }
        | Initial::Online { .. }
        | Initial::Hunt { .. }
        | Initial::Phr { .. } => {
            let built = on_host(device, || build_on_host(&settings.initial, &working, stop))?;
            ("build on the host", built.ok_or(DeviceError::Stopped)?)
        }
        Initial::Tree(_) | Initial::Sbvh => {
            let References { tree, .. } = given.expect("whoever asks for such a tree has made its references");
            ("read tree", tree.clone().with_boxes_of(&working).to_device()?)
        }
        #[cfg(feature = "files")]
        Initial::File { path } => ("read tree", build::from_file(path, scene, &working)?),
    };
    drop(working);
    let timing = Timing { label, seconds: start.elapsed().as_secs_f64() };
    Ok((DeviceTree::upload(device, &nodes)?, vec![timing]))
}

//! The tree that a run starts from.

use super::{FeatureOff, PipelineError};
use crate::build::{self, Codes, DeviceTree, TreeletSize};
use crate::device::{Device, Timing, on_host};
use crate::scene::Scene;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use serde::Serialize;
use std::fmt;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Instant;

/// Where the initial tree comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Initial {
    /// LBVH (Karras 2012), on the device.
    #[default]
    Lbvh,
    /// PLOC (Meister & Bittner 2017), on the device.
    Ploc {
        /// Places in the Morton order that a cluster looks to either side for its nearest neighbour.
        radius: NonZeroU32,
    },
    /// ATRBVH (Domingues & Pedrini 2015), on the device; only with the cargo feature `atrbvh`.
    Atrbvh {
        /// Leaves of a treelet.
        treelet: TreeletSize,
    },
    /// Full-sweep SAH, on the CPU.
    SahSweep,
    /// Binned SAH (Wald 2007), on the CPU.
    SahBinned,
    /// A `tree.bvh` over the same scene with one triangle per leaf.
    File(PathBuf),
}

impl Initial {
    /// Whether it is built from Morton codes.
    pub(crate) fn has_codes(&self) -> bool {
        matches!(self, Self::Lbvh | Self::Ploc { .. } | Self::Atrbvh { .. })
    }

    /// As on the command line, but no path.
    pub(crate) fn method(&self) -> String {
        if let Self::File(_) = self { "tree file".to_owned() } else { self.to_string() }
    }

    /// Whether this program has the builder.
    ///
    /// # Errors
    /// If a cargo feature left it out.
    pub fn check(&self) -> Result<(), FeatureOff> {
        match self {
            Self::Atrbvh { .. } if !cfg!(feature = "atrbvh") => Err(FeatureOff { method: "atrbvh", feature: "atrbvh" }),
            _ => Ok(()),
        }
    }
}

/// As on the command line: `lbvh`, `ploc`, `atrbvh`, `sah-sweep`, `sah-binned`, or the path of the file.
impl fmt::Display for Initial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lbvh => f.write_str("lbvh"),
            Self::Ploc { .. } => f.write_str("ploc"),
            Self::Atrbvh { .. } => f.write_str("atrbvh"),
            Self::SahSweep => f.write_str("sah-sweep"),
            Self::SahBinned => f.write_str("sah-binned"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// The tree to start from, on the device, and the times of its stages.
pub(super) fn initial_tree(
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
        Initial::File(path) => ("read tree", build::from_file(path, scene, &working)?),
    };
    drop(working);
    let timing = Timing { label, seconds: start.elapsed().as_secs_f64() };
    Ok((DeviceTree::upload(device, &nodes)?, vec![timing]))
}

//! Initial trees.

mod agglomerative;
#[cfg(feature = "atrbvh")]
mod atrbvh;
mod binned;
mod bins;
mod clusters;
mod codes;
mod cut;
#[cfg(feature = "files")]
mod from_file;
mod hploc;
mod input;
mod kmeans;
mod lbvh;
mod links;
mod morton;
mod order;
mod ploc;
mod sbvh;
mod sort;
mod sweep;
mod top_down;
#[cfg(feature = "atrbvh")]
mod trbvh;
mod treelet;
#[cfg(feature = "atrbvh")]
mod treelets;
mod unfit;

pub use agglomerative::{AacSettings, MOST_AGGLOMERATED, aac, agglomerative};
pub(crate) use agglomerative::{aac_until, agglomerative_until};
#[cfg(feature = "atrbvh")]
#[doc(hidden)]
pub use atrbvh::restructure_unchecked;
#[cfg(feature = "atrbvh")]
pub use atrbvh::{atrbvh, restructure};
pub(crate) use binned::binned_until;
pub use binned::{sah_binned, sah_binned_by};
pub use bins::{Bins, BinsError};
pub use codes::MortonBits;
pub use codes::{CodeCensus, Codes, MOST_COMPARED};
pub use cut::{HuntSettings, PhrSettings, hunt, phr};
pub(crate) use cut::{hunt_until, phr_until};
#[cfg(feature = "files")]
pub use from_file::{TreeOfFileError, from_file};
pub use hploc::{DEFAULT_HPLOC_RADIUS, hploc};
pub use input::Input;
pub(crate) use kmeans::kmeans_unchecked;
pub use kmeans::{KMeansError, KMeansSettings, kmeans};
pub use lbvh::lbvh;
pub use ploc::{DEFAULT_RADIUS, ploc};
pub use sbvh::{SbvhSettings, sbvh};
#[cfg(feature = "atrbvh")]
pub(crate) use sort::kernels as sort_kernels;
pub use sweep::sah_sweep;
pub(crate) use sweep::sweep_until;
pub(crate) use top_down::in_range;
#[cfg(feature = "atrbvh")]
#[doc(hidden)]
pub use trbvh::restructure_optimally_unchecked;
#[cfg(feature = "atrbvh")]
pub use trbvh::{restructure_optimally, trbvh};
pub use treelet::{DEFAULT_PASSES, TreeletSize, TreeletSizeError};
#[cfg(feature = "atrbvh")]
pub use treelets::{Pass, Restructured};
pub use unfit::UnfitTree;

use crate::bvh::{Bvh, Decoder, TreeFault};
use crate::device::{Buffer, Device, DeviceError, DeviceInfo, Lease, Recording, read_pieces};
use crate::scene::MAX_TRIANGLES;
use bytemuck::Zeroable;
use prbvh_kernel::Kernel;
use prbvh_kernel::node::Node;
use prbvh_kernel::refit::RefitParams;

/// A tree on a device: `2n-1` nodes in the form of [`prbvh_kernel::node`], over at least one reference.
#[derive(Debug)]
#[non_exhaustive]
pub struct DeviceTree {
    /// References (triangles), `n`.
    pub references: u32,
    /// The nodes.
    pub nodes: Buffer,
}

impl DeviceTree {
    /// A tree of `references` references in a buffer of `2n-1` nodes; [`DeviceTree::check`] tells whether it is one.
    #[must_use]
    pub fn new(references: u32, nodes: Buffer) -> Self {
        Self { references, nodes }
    }

    /// Nodes of a tree over `references` references.
    #[must_use]
    pub fn node_count(references: u32) -> u32 {
        2 * references - 1
    }

    /// Room for a tree over `references` references.
    pub(crate) fn allocate(device: &mut dyn Device, references: u32) -> Result<Self, DeviceError> {
        let length = Self::node_count(references) as usize;
        Ok(Self { references, nodes: device.allocate("nodes", length, size_of::<Node>())? })
    }

    /// Copies the nodes out.
    ///
    /// # Errors
    /// If the device fails.
    pub fn download(&self, device: &mut dyn Device) -> Result<Vec<Node>, DeviceError> {
        let mut nodes = vec![Node::zeroed(); self.nodes.length];
        device.download(&self.nodes, bytemuck::cast_slice_mut(&mut nodes))?;
        Ok(nodes)
    }

    /// The tree as [`Bvh::from_device`] has it, without a copy of all nodes on the way, and with room for `more` of them.
    ///
    /// # Errors
    /// If the device fails; inside, the faults of the links.
    pub(crate) fn decode(
        &self,
        device: &mut dyn Device,
        more: usize,
    ) -> Result<Result<Bvh, Vec<TreeFault>>, DeviceError> {
        let mut decoder = match Decoder::new(self.nodes.length, more) {
            Ok(decoder) => decoder,
            Err(faults) => return Ok(Err(faults)),
        };
        read_pieces(device, &self.nodes, |piece| decoder.push(piece))?;
        Ok(decoder.finish())
    }

    /// Puts a tree that was made elsewhere on the device.
    ///
    /// # Errors
    /// If `nodes` has not the odd length of a tree, or the device fails. Links are not looked at: [`DeviceTree::check`] does that.
    pub fn upload(device: &mut dyn Device, nodes: &[Node]) -> Result<Self, DeviceError> {
        if nodes.len().is_multiple_of(2) {
            let problem = TreeFault::NodeCount { nodes: nodes.len() }.to_string();
            return Err(DeviceError::Buffer { label: "nodes", problem });
        }
        let device = &mut Lease::new(device);
        let buffer = device.allocate("nodes", nodes.len(), size_of::<Node>())?;
        device.upload(&buffer, bytemuck::cast_slice(nodes))?;
        device.keep();
        let references = u32::try_from(nodes.len().div_ceil(2)).expect("node indices have 32 bits");
        Ok(Self { references, nodes: buffer })
    }

    /// Makes all boxes of internal nodes anew from those of the leaves.
    ///
    /// # Errors
    /// If the device fails, or the links are no tree.
    pub fn refit(&self, device: &mut dyn Device) -> Result<(), UnfitTree> {
        if let Err(faults) = self.decode(device, 0)? {
            return Err(UnfitTree::Broken { faults });
        }
        let device = &mut Lease::new(device);
        let arrivals = device.allocate("arrivals", arrivals_length(self.references), 4)?;
        let mut recording = Recording::new();
        record_refit(&mut recording, self.references, &self.nodes, &arrivals);
        device.run(&recording)?;
        Ok(())
    }

    /// Gives the memory back.
    pub fn free(self, device: &mut dyn Device) {
        device.free(self.nodes);
    }
}

/// Refuses a scene over which no tree fits the device, before anything is allocated. What the stages of a run need beside the tree is in
/// [`Plan::check`](crate::plan::Plan::check).
///
/// # Errors
/// [`DeviceError::Limit`] with the limit's name, what is needed and what there is.
pub fn check_limits(info: &DeviceInfo, triangles: usize) -> Result<(), DeviceError> {
    let limit = |what: &str, name, need, have| {
        if need > have && have > 0 {
            let what = format!("{what} of {triangles} triangles");
            Err(DeviceError::Limit { what, name, need, have, device: info.name.clone() })
        } else {
            Ok(())
        }
    };
    limit("a tree", "31-bit node indices (triangles)", triangles as u64, MAX_TRIANGLES)?;
    let node_bytes = 2 * triangles as u64 * size_of::<Node>() as u64;
    limit("the tree", info.max_buffer_limit, node_bytes, info.max_buffer_bytes)
}

/// Counters that a refit over `n` references needs; not 0, since no buffer may be empty.
pub(crate) fn arrivals_length(n: u32) -> usize {
    (n as usize - 1).max(1)
}

/// Records the recomputation of all boxes. `arrivals` ends as 2 everywhere if the nodes are a tree.
pub(crate) fn record_refit(recording: &mut Recording, n: u32, nodes: &Buffer, arrivals: &Buffer) {
    recording.clear("refit", arrivals);
    recording.dispatch("refit", Kernel::Refit, n, &RefitParams { count: n }, &[nodes, arrivals]);
}

/// Buffers that live as long as one stage.
#[derive(Debug, Default)]
pub struct Scratch(Vec<Buffer>);

impl Scratch {
    /// As [`Device::allocate`].
    ///
    /// # Errors
    /// As there.
    pub fn allocate(
        &mut self,
        device: &mut dyn Device,
        label: &'static str,
        length: usize,
        element_bytes: usize,
    ) -> Result<Buffer, DeviceError> {
        let buffer = device.allocate(label, length, element_bytes)?;
        self.0.push(buffer.clone());
        Ok(buffer)
    }

    /// Gives their memory back.
    pub fn free(self, device: &mut dyn Device) {
        for buffer in self.0 {
            device.free(buffer);
        }
    }
}

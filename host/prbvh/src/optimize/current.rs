//! The tree while it is optimised, and the moves of the last round.

use super::RbvhTree;
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, Dispatch, on_host};
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::Move;
use prbvh_kernel::prbvh::dual::search::DualParams;

/// A round of dual moves: what was searched, and what came out.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DualRound {
    /// How.
    pub params: DualParams,
    /// The nodes that were searched.
    pub inputs: Vec<u32>,
    /// What the search found for each of them, with [`WON`](prbvh_kernel::prbvh::WON) where it was made.
    pub found: Vec<Move>,
}

/// The tree after an iteration, where the optimiser has it.
#[expect(missing_debug_implementations, reason = "devices are opaque")]
pub enum CurrentTree<'a> {
    /// On a device; with the last search of dual moves, if there was one.
    Device(&'a DeviceTree, &'a mut dyn Device, Option<Dispatch>),
    /// On the host.
    Host(&'a RbvhTree),
}

impl CurrentTree<'_> {
    /// Its nodes in the form of [`prbvh_kernel::node`], boxes in working coordinates.
    ///
    /// # Errors
    /// If the device fails.
    pub fn nodes(&mut self) -> Result<Vec<Node>, DeviceError> {
        match self {
            Self::Device(tree, device, _) => tree.download(&mut **device),
            Self::Host(tree) => Ok(tree.nodes()),
        }
    }

    /// The last round of dual moves, in which `searched` nodes were searched; none if there was no such round.
    ///
    /// # Errors
    /// If the device fails.
    pub fn dual_round(&mut self, searched: u32) -> Result<Option<DualRound>, DeviceError> {
        let Self::Device(_, device, Some(search)) = self else { return Ok(None) };
        let [_, list, found, ..] = &search.buffers[..] else { return Ok(None) };
        // A count that cannot be is the caller's to find.
        let count = (searched as usize).min(list.length).min(found.length);
        let mut round = DualRound {
            params: bytemuck::pod_read_unaligned(&search.push),
            inputs: vec![0; count],
            found: vec![Move::NONE; count],
        };
        device.download(list, bytemuck::cast_slice_mut(&mut round.inputs))?;
        device.download(found, bytemuck::cast_slice_mut(&mut round.found))?;
        Ok(Some(round))
    }

    /// Does work of the host on the threads that the user gave.
    pub fn on_host<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match self {
            Self::Device(_, device, _) => on_host(&**device, work),
            Self::Host(_) => work(),
        }
    }
}

//! The tree while it is optimised.

use super::RbvhTree;
use crate::build::DeviceTree;
use crate::device::{Device, DeviceError, on_host};
use prbvh_kernel::node::Node;

/// The tree after an iteration, where the optimiser has it.
#[expect(missing_debug_implementations, reason = "devices are opaque")]
pub enum CurrentTree<'a> {
    /// On a device.
    Device(&'a DeviceTree, &'a mut dyn Device),
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
            Self::Device(tree, device) => tree.download(&mut **device),
            Self::Host(tree) => Ok(tree.nodes()),
        }
    }

    /// Does work of the host on the threads that the user gave.
    pub(crate) fn on_host<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match self {
            Self::Device(_, device) => on_host(&**device, work),
            Self::Host(_) => work(),
        }
    }
}

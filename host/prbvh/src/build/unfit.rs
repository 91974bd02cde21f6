//! Whether a tree that somebody put on a device may be worked on.

use super::DeviceTree;
use crate::bvh::{TreeFault, summary};
use crate::device::{Device, DeviceError};
use crate::scene::{OutOfRange, SafeRange};
use bytemuck::Zeroable;
use prbvh_kernel::node::Node;

/// Why a tree on a device may not be worked on. Nothing has run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UnfitTree {
    /// The device failed, or the nodes are no buffer of it.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The links are no tree.
    #[error("the tree is broken: {}", summary(.faults))]
    Broken {
        /// All faults.
        faults: Vec<TreeFault>,
    },
    /// The coordinates are too small or too large.
    #[error(transparent)]
    Range(#[from] OutOfRange),
}

impl DeviceTree {
    /// Reads the nodes once and checks that their links are those of a tree over [`DeviceTree::references`] references, and that the root's box is in the
    /// [range](SafeRange::check) of what works on trees. The optimisers and the collapse ask this of a tree that they are given, before anything runs.
    /// Other boxes are not looked at: they are made anew, or are said to be right.
    ///
    /// # Errors
    /// [`UnfitTree`] with what is wrong.
    pub fn check(&self, device: &mut dyn Device) -> Result<(), UnfitTree> {
        let nodes = self.nodes.length;
        if nodes.is_multiple_of(2) || nodes / 2 + 1 != self.references as usize {
            return Err(UnfitTree::Broken { faults: vec![TreeFault::NodeCount { nodes }] });
        }
        if self.nodes.element_bytes != size_of::<Node>() {
            let problem = format!("a node has {} bytes, not {}", size_of::<Node>(), self.nodes.element_bytes);
            return Err(DeviceError::Buffer { label: self.nodes.label, problem }.into());
        }
        let mut root = [Node::zeroed()];
        device.download(&self.nodes, bytemuck::cast_slice_mut(&mut root))?;
        SafeRange::check(&root[0].aabb())?;
        self.decode(device, 0)?.map_err(|faults| UnfitTree::Broken { faults })?;
        Ok(())
    }
}

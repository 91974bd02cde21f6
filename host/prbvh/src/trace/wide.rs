//! Wide trees as the tracing kernels take them.

use super::TraceError;
use crate::wide::{self, PackedTree, WideFault};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::trace::TraceTriangle;

/// The arrays on the host.
pub(super) struct WideArrays {
    pub(super) tree: PackedTree,
    pub(super) triangles: Vec<TraceTriangle>,
    /// Most nodes on a way from the root to a leaf.
    pub(super) levels: u32,
}

impl WideArrays {
    /// The tree with boxes of `working` triangles, in its layout.
    pub(super) fn new(tree: &PackedTree, working: &[Triangle]) -> Result<Self, TraceError> {
        let unpacked = tree.unpack().map_err(TraceError::InvalidWideTree)?;
        let faults = ids(&unpacked.triangle_order, working.len());
        if !faults.is_empty() {
            return Err(TraceError::InvalidWideTree(faults));
        }
        let levels = wide::quality(&unpacked, &unpacked.width.sah()).levels;
        let tree = PackedTree::new(&unpacked.with_boxes_of(working), tree.nodes.layout())
            .expect("it has no larger leaves than it had");
        let mut triangles: Vec<TraceTriangle> = tree.order.iter().map(|&id| packed(id, working)).collect();
        for (first, count) in tree.leaves() {
            triangles[(first + count - 1) as usize].is_last = 1;
        }
        Ok(Self { tree, triangles, levels })
    }
}

/// A triangle that is not the last one of its leaf.
pub(super) fn packed(id: u32, working: &[Triangle]) -> TraceTriangle {
    let Triangle { a, b, c } = working[id as usize];
    TraceTriangle { a, id, b, is_last: 0, c, unused: 0 }
}

/// Ids that are none, and triangles that are in no leaf.
fn ids(order: &[u32], triangles: usize) -> Vec<WideFault> {
    let mut seen = vec![false; triangles];
    let mut faults = Vec::new();
    for (position, &triangle) in (0u32..).zip(order) {
        match seen.get_mut(triangle as usize) {
            None => faults.push(WideFault::TriangleOutOfRange { position, triangle, triangles }),
            Some(seen) => *seen = true,
        }
    }
    let missing = (0..triangles as u32).filter(|&triangle| !seen[triangle as usize]);
    faults.extend(missing.map(|triangle| WideFault::TriangleMissing { triangle }));
    faults
}

//! Wide trees as the tracing kernels take them.

use super::{TraceError, TraceRange};
use crate::wide::{self, PackedTree, WideBvh, WideFault};
use prbvh_kernel::aabb::Aabb;
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
    /// The tree in its layout, with boxes of the `working` triangles, which are in `range`; where one is in several leaves the boxes are its own.
    pub(super) fn new(tree: &PackedTree, working: &[Triangle], range: &TraceRange) -> Result<Self, TraceError> {
        let unpacked = tree.unpack().map_err(TraceError::InvalidWideTree)?;
        let faults = ids(&unpacked.triangle_order, working.len());
        if !faults.is_empty() {
            return Err(TraceError::InvalidWideTree(faults));
        }
        let levels = wide::quality(&unpacked, &unpacked.width.sah()).levels;
        let has_splits = unpacked.triangle_order.len() > working.len();
        let boxed = if has_splits { with_boxes_in(unpacked, range) } else { unpacked.with_boxes_of(working) };
        let tree = PackedTree::new(&boxed, tree.nodes.layout()).expect("it has no larger leaves than it had");
        let mut triangles: Vec<TraceTriangle> = tree.order.iter().map(|&id| packed(id, working)).collect();
        for (first, count) in tree.leaves() {
            triangles[(first + count - 1) as usize].is_last = 1;
        }
        Ok(Self { tree, triangles, levels })
    }
}

/// The tree with its boxes in the range: what a corner may be rounded by here is far less than rays' tests widen boxes by.
fn with_boxes_in(mut tree: WideBvh, range: &TraceRange) -> WideBvh {
    for child in tree.nodes.iter_mut().flat_map(|node| node.slots.iter_mut().flatten()) {
        let Aabb { min, max } = child.aabb;
        child.aabb = Aabb { min: range.point(min), max: range.point(max) };
    }
    tree
}

/// A triangle that is not the last one of its leaf.
pub(super) fn packed(id: u32, working: &[Triangle]) -> TraceTriangle {
    let Triangle { a, b, c } = working[id as usize];
    TraceTriangle::new(id, [a, b, c])
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

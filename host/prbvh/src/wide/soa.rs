//! Nodes with boxes as they are.

use super::{WideChild, WideContent, WideNode, without_negative_zeros};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::trace::LEAF;
use prbvh_kernel::trace::wide::{Bvh4Node, Bvh8Node, NO_CHILD};

macro_rules! soa {
    ($node:ident, $width:literal, $pack:ident, $unpack:ident) => {
        pub(super) fn $pack(node: &WideNode) -> $node {
            let mut packed: $node = bytemuck::Zeroable::zeroed();
            packed.child = [NO_CHILD; $width];
            for (k, child) in node.slots[..$width].iter().enumerate() {
                let Some(WideChild { aabb, content }) = child else { continue };
                let Aabb { min, max } = without_negative_zeros(*aabb);
                [packed.min_x[k], packed.min_y[k], packed.min_z[k]] = min;
                [packed.max_x[k], packed.max_y[k], packed.max_z[k]] = max;
                (packed.child[k], packed.count[k]) = match *content {
                    WideContent::Node(node) => (node, 0),
                    WideContent::Leaf { first, count } => (first | LEAF, count),
                };
            }
            packed
        }

        pub(super) fn $unpack(packed: &$node) -> WideNode {
            let mut node = WideNode::default();
            for k in (0..$width).filter(|&k| packed.child[k] != NO_CHILD) {
                let aabb = Aabb {
                    min: [packed.min_x[k], packed.min_y[k], packed.min_z[k]],
                    max: [packed.max_x[k], packed.max_y[k], packed.max_z[k]],
                };
                let child = packed.child[k];
                let content = if child & LEAF == 0 {
                    WideContent::Node(child)
                } else {
                    WideContent::Leaf { first: child & !LEAF, count: packed.count[k] }
                };
                node.slots[k] = Some(WideChild { aabb, content });
            }
            node
        }
    };
}

soa!(Bvh4Node, 4, pack4, unpack4);
soa!(Bvh8Node, 8, pack8, unpack8);

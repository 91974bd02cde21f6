//! Compressed nodes: from children whose nodes and triangles lie side by side, and back.

use super::quantize::Axis;
use super::{SLOTS, WideChild, WideContent, WideFault, WideNode};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::trace::LEAF;
use prbvh_kernel::trace::wide::CwbvhNode;

/// Bits of a leaf's byte that count its triangles.
const COUNT_SHIFT: u32 = 5;
/// What stands in the byte of a node beside its slot.
const NODE: u32 = 32 + 24;

/// Packs a node whose children that are nodes are numbered one after another, as are the triangles of its leaves, at most three each.
pub(super) fn pack(node: &WideNode) -> CwbvhNode {
    let around = node.aabb();
    let axes: [Axis; 3] = std::array::from_fn(|k| Axis::of(around.min[k], around.max[k]));
    let mut bytes = [[0u8; SLOTS]; 7];
    let (mut inner, mut first_node, mut first_triangle) = (0u32, None, None);
    for (slot, child) in node.slots.iter().enumerate() {
        let Some(WideChild { aabb, content }) = child else { continue };
        let meta = match *content {
            WideContent::Node(node) => {
                first_node.get_or_insert(node);
                inner |= 1 << slot;
                NODE + slot as u32
            }
            WideContent::Leaf { first, count } => {
                let start = *first_triangle.get_or_insert(first);
                (((1 << count) - 1) << COUNT_SHIFT) | (first - start)
            }
        };
        bytes[0][slot] = meta as u8;
        for k in 0..3 {
            bytes[1 + 2 * k][slot] = axes[k].below(aabb.min[k]);
            bytes[2 + 2 * k][slot] = axes[k].above(aabb.max[k]);
        }
    }
    let [meta, min_x, max_x, min_y, max_y, min_z, max_z] = bytes.map(words);
    let [x, y, z] = axes.map(|axis| u32::from(axis.exponent));
    CwbvhNode {
        origin: axes.map(|axis| axis.origin.to_bits()),
        scales_and_inner: x | (y << 8) | (z << 16) | (inner << 24),
        first_node: first_node.unwrap_or(0),
        first_triangle: first_triangle.unwrap_or(0),
        meta,
        min_x,
        max_x,
        min_y,
        max_y,
        min_z,
        max_z,
    }
}

/// Two words of eight bytes, the first one lowest.
fn words(bytes: [u8; SLOTS]) -> [u32; 2] {
    let [a, b, c, d, e, f, g, h] = bytes;
    [u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])]
}

/// What lies in the nodes, or what in them means nothing.
pub(super) fn unpack(nodes: &[CwbvhNode]) -> Result<Vec<WideNode>, Vec<WideFault>> {
    let mut faults = Vec::new();
    let unpacked = nodes.iter().enumerate().map(|(v, node)| one(v as u32, node, &mut faults)).collect();
    if faults.is_empty() { Ok(unpacked) } else { Err(faults) }
}

fn one(v: u32, packed: &CwbvhNode, faults: &mut Vec<WideFault>) -> WideNode {
    let mut meaningless = |what, value, need| faults.push(WideFault::Meaningless { node: v, what, value, need });
    for (k, what) in ["the scale of x", "the scale of y", "the scale of z"].into_iter().enumerate() {
        let exponent = (packed.scales_and_inner >> (8 * k)) & 255;
        if !(1..=254).contains(&exponent) {
            meaningless(what, exponent, "from 1 to 254");
        }
    }
    let mut node = WideNode::default();
    for slot in 0..SLOTS as u32 {
        let meta = packed.meta_of(slot);
        let is_inner = packed.inner() & (1 << slot) != 0;
        if is_inner && meta != NODE + slot {
            meaningless("the byte of a slot with a node", meta, "56 and the slot");
        }
        if is_inner && packed.first_node.checked_add(SLOTS as u32).is_none() {
            meaningless("the first node", packed.first_node, "a number of a node");
            continue;
        }
        if meta == 0 {
            continue;
        }
        let content = if is_inner {
            WideContent::Node(packed.child(slot))
        } else {
            let unary = meta >> COUNT_SHIFT;
            if !matches!(unary, 1 | 3 | 7) || meta & 31 >= 24 {
                meaningless("the byte of a leaf", meta, "32, 96 or 224 and a triangle below 24");
            }
            if packed.first_triangle >= LEAF {
                meaningless("the first triangle", packed.first_triangle, "below 2147483648");
                continue;
            }
            WideContent::Leaf { first: packed.child(slot) & !LEAF, count: unary.count_ones() }
        };
        node.slots[slot as usize] = Some(WideChild { aabb: finite(packed.aabb(slot)), content });
    }
    node
}

/// A step beyond the largest number holds all that the largest number does.
fn finite(Aabb { min, max }: Aabb) -> Aabb {
    Aabb { min: min.map(|x| x.max(f32::MIN)), max: max.map(|x| x.min(f32::MAX)) }
}

//! tinybvh 1.6: the nodes and triangles of `BVH8_CWBVH`, as its kernel `traverse_cwbvh.cl` reads them.

use crate::wide::{Layout, NotPacked, PackedNodes, PackedTree, WideBvh};
use bytemuck::{Pod, Zeroable};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::trace::wide::CwbvhNode;

/// A node of `BVH8_CWBVH`: five vectors of four words, 80 bytes. It differs from [`CwbvhNode`] in the exponents, which are bytes with a sign, in the unit of
/// the first triangle, which are vectors, and in the order of faces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TinyCwbvhNode {
    /// Bits of the smallest corner of the node's box.
    pub origin: [u32; 3],
    /// From the lowest byte: exponents of x, y, z, without bias and with a sign; a bit for each slot that holds a node.
    pub exponents_and_inner: u32,
    /// The node of the first such slot.
    pub first_node: u32,
    /// The first vector of the triangles of all leaves of the node, three a triangle.
    pub first_vector: u32,
    /// A byte a slot, as in [`CwbvhNode`].
    pub meta: [u32; 2],
    /// Steps to the smallest x, y, z of each box.
    pub min: [[u32; 2]; 3],
    /// Steps to the largest x, y, z.
    pub max: [[u32; 2]; 3],
}

const _: () = assert!(size_of::<TinyCwbvhNode>() == 80);

/// A triangle beside them, three vectors of four words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TinyCwbvhTriangle {
    /// Third corner less the first, and 0.
    pub edge_2: [f32; 4],
    /// Second corner less the first, and 0.
    pub edge_1: [f32; 4],
    /// The first corner.
    pub corner: [f32; 3],
    /// Number of the triangle.
    pub id: u32,
}

/// The compressed tree as `bvh8Data` and `bvh8Tris`.
///
/// # Errors
/// If a leaf has more than three triangles.
///
/// # Panics
/// If the links are no tree or a triangle id is not below `triangles.len()`.
pub fn to_cwbvh(
    tree: &WideBvh,
    triangles: &[Triangle],
) -> Result<(Vec<TinyCwbvhNode>, Vec<TinyCwbvhTriangle>), NotPacked> {
    let packed = PackedTree::new(tree, Layout::Cwbvh)?;
    let PackedNodes::Cwbvh(nodes) = &packed.nodes else { unreachable!("the layout that was asked for") };
    let triangle = |&id: &u32| {
        let Triangle { a, b, c } = triangles[id as usize];
        let edge = |to: [f32; 3]| [to[0] - a[0], to[1] - a[1], to[2] - a[2], 0.0];
        TinyCwbvhTriangle { edge_2: edge(c), edge_1: edge(b), corner: a, id }
    };
    Ok((nodes.iter().map(node).collect(), packed.order.iter().map(triangle).collect()))
}

fn node(node: &CwbvhNode) -> TinyCwbvhNode {
    const BIAS: u8 = 127;
    let [x, y, z, inner] = node.scales_and_inner.to_le_bytes();
    let [x, y, z] = [x, y, z].map(|exponent| exponent.wrapping_sub(BIAS));
    TinyCwbvhNode {
        origin: node.origin,
        exponents_and_inner: u32::from_le_bytes([x, y, z, inner]),
        first_node: node.first_node,
        first_vector: 3 * node.first_triangle,
        meta: node.meta,
        min: [node.min_x, node.min_y, node.min_z],
        max: [node.max_x, node.max_y, node.max_z],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::testing::tree;
    use crate::wide::{WideSettings, Width, collapse};

    #[test]
    fn every_byte_is_where_the_kernel_reads_it() {
        let (triangles, binary) = tree(300, 21);
        let settings = WideSettings { width: Width::Eight, layout: Layout::Cwbvh, ..WideSettings::default() };
        let wide = collapse(&binary, &settings).unwrap();
        let (nodes, leaves) = to_cwbvh(&wide, &triangles).unwrap();
        let packed = PackedTree::new(&wide, Layout::Cwbvh).unwrap();
        let PackedNodes::Cwbvh(ours) = &packed.nodes else { unreachable!() };
        assert_eq!(nodes.len(), ours.len());
        for (node, ours) in nodes.iter().zip(ours) {
            let bytes = bytemuck::bytes_of(node);
            for slot in (0..8).filter(|&slot| ours.meta_of(slot) != 0) {
                let aabb = ours.aabb(slot);
                for axis in 0..3 {
                    let origin = f32::from_ne_bytes(bytes[4 * axis..][..4].try_into().unwrap());
                    let step = f32::from_bits(((i32::from(bytes[12 + axis] as i8) + 127) as u32) << 23);
                    let face = |at: usize| origin + f32::from(bytes[at + 8 * axis + slot as usize]) * step;
                    assert_eq!([face(32), face(56)], [aabb.min[axis], aabb.max[axis]]);
                }
                assert_eq!(u32::from(bytes[24 + slot as usize]), ours.meta_of(slot));
            }
            assert_eq!(bytes[15], ours.inner() as u8);
            assert_eq!(node.first_vector, 3 * ours.first_triangle);
        }
        let words: &[u32] = bytemuck::cast_slice(&leaves);
        for (position, &id) in packed.order.iter().enumerate() {
            let Triangle { a, b, c } = triangles[id as usize];
            let vector = |k: usize| words[12 * position + 4 * k..][..3].to_vec();
            let edge = |to: [f32; 3]| [0, 1, 2].map(|k| (to[k] - a[k]).to_bits()).to_vec();
            assert_eq!([vector(0), vector(1), vector(2)], [edge(c), edge(b), a.map(f32::to_bits).to_vec()]);
            assert_eq!(words[12 * position + 11], id);
        }
    }
}

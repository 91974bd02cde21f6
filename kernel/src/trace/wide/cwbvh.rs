//! Compressed nodes of eight children (Ylitie, Karras & Laine 2017, §3.2), byte for byte those of obvhs.

use super::WideNodes;
use crate::aabb::Aabb;
use crate::ray::Prepared;
use crate::trace::LEAF;
use bytemuck::{Pod, Zeroable};

/// A compressed node of eight children, 80 bytes. Bytes of slots come in words, the first slot in the lowest byte.
///
/// A face of a box lies at `origin + q · 2^(e - 127)`, its coordinates rounded after the exact product.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct CwbvhNode {
    /// Bits of the smallest corner of the node's box, f32.
    pub origin: [u32; 3],
    /// From the lowest byte: `e` of x, y, z, each from 1 to 254; a bit for each slot that holds a node.
    pub scales_and_inner: u32,
    /// The node of the first such slot; those of the others follow.
    pub first_node: u32,
    /// The first triangle of all leaves of the node.
    pub first_triangle: u32,
    /// A byte a slot. Empty: 0. Node: 32 + 24 + slot. Leaf: its first triangle, counted from `first_triangle`, below 24, and a bit for each of
    /// its triangles from bit 5 on.
    pub meta: [u32; 2],
    /// `q` of the smallest x of each box.
    pub min_x: [u32; 2],
    /// `q` of the largest x.
    pub max_x: [u32; 2],
    /// `q` of the smallest y.
    pub min_y: [u32; 2],
    /// `q` of the largest y.
    pub max_y: [u32; 2],
    /// `q` of the smallest z.
    pub min_z: [u32; 2],
    /// `q` of the largest z.
    pub max_z: [u32; 2],
}

const _: () = assert!(size_of::<CwbvhNode>() == 80);

/// Byte `slot` of two words.
#[inline(always)]
fn byte(words: [u32; 2], slot: u32) -> u32 {
    let word = if slot < 4 { words[0] } else { words[1] };
    (word >> (8 * (slot & 3))) & 255
}

impl CwbvhNode {
    /// Bits of the slots that hold nodes.
    #[inline(always)]
    #[must_use]
    pub fn inner(&self) -> u32 {
        self.scales_and_inner >> 24
    }

    /// Byte of a slot in [`CwbvhNode::meta`].
    #[inline(always)]
    #[must_use]
    pub fn meta_of(&self, slot: u32) -> u32 {
        byte(self.meta, slot)
    }

    /// The box of a slot that is not empty, as a ray meets it.
    #[inline(always)]
    #[must_use]
    pub fn aabb(&self, slot: u32) -> Aabb {
        let face = |axis: usize, q: [u32; 2]| {
            let scale = f32::from_bits(((self.scales_and_inner >> (8 * axis as u32)) & 255) << 23);
            f32::from_bits(self.origin[axis]) + byte(q, slot) as f32 * scale
        };
        Aabb {
            min: [face(0, self.min_x), face(1, self.min_y), face(2, self.min_z)],
            max: [face(0, self.max_x), face(1, self.max_y), face(2, self.max_z)],
        }
    }

    /// What a slot that is not empty holds: a node, or the first triangle of a leaf with [`LEAF`].
    #[inline(always)]
    #[must_use]
    pub fn child(&self, slot: u32) -> u32 {
        let inner = self.inner();
        if inner & (1 << slot) != 0 {
            self.first_node + (inner & !(u32::MAX << slot)).count_ones()
        } else {
            (self.first_triangle + (self.meta_of(slot) & 31)) | LEAF
        }
    }
}

impl WideNodes for [CwbvhNode] {
    const WIDTH: u32 = 8;

    #[inline(always)]
    fn entered(&self, node: u32, prepared: &Prepared, octant: u32, t_max: f32) -> u32 {
        let node = self[node as usize];
        // No loop over the slots: a driver may count its rounds with those of the walk ([`STEPS`](crate::trace::STEPS)).
        let bit = |slot: u32| {
            let entered = prepared.enters(&node.aabb(slot), t_max) < f32::INFINITY && node.meta_of(slot) != 0;
            if entered { 1 << (slot ^ octant) } else { 0 }
        };
        bit(0) | bit(1) | bit(2) | bit(3) | bit(4) | bit(5) | bit(6) | bit(7)
    }

    #[inline(always)]
    fn next(&self, node: u32, word: u32, octant: u32) -> (u32, u32) {
        let lowest = word & (!word).wrapping_add(1);
        let slot = (31 - lowest.leading_zeros()) ^ octant;
        (self[node as usize].child(slot), word & !lowest)
    }
}

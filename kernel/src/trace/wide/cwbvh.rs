//! Compressed nodes of eight children (Ylitie, Karras & Laine 2017, §3.2), byte for byte those of obvhs.

use super::WideNodes;
use crate::aabb::Aabb;
use crate::ray::{Prepared, Steps};
use crate::trace::LEAF;
use bytemuck::{Pod, Zeroable};
#[cfg(not(target_arch = "spirv"))]
use {
    super::native::{Group, NodesAtOnce},
    fearless_simd::prelude::*,
    fearless_simd::{f32x8, i32x8, u8x16},
};

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

    /// The box of a slot that is not empty, its coordinates rounded.
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

    /// Its boxes for a ray.
    #[inline(always)]
    pub(super) fn steps(&self, prepared: &Prepared) -> Steps {
        let step = |axis: u32| f32::from_bits(((self.scales_and_inner >> (8 * axis)) & 255) << 23);
        let corner = [f32::from_bits(self.origin[0]), f32::from_bits(self.origin[1]), f32::from_bits(self.origin[2])];
        prepared.steps(corner, [step(0), step(1), step(2)])
    }

    /// A bit for each child that the ray enters, in the order of the octant.
    #[inline(always)]
    fn entered(&self, prepared: &Prepared, steps: &Steps, octant: u32, t_max: f32) -> u32 {
        // No loop over the slots: a driver may count its rounds with those of the walk ([`STEPS`](crate::trace::STEPS)).
        let bit = |slot: u32| if self.enters(slot, prepared, steps, t_max) { 1 << (slot ^ octant) } else { 0 };
        bit(0) | bit(1) | bit(2) | bit(3) | bit(4) | bit(5) | bit(6) | bit(7)
    }

    /// The children that the ray enters.
    #[cfg(not(target_arch = "spirv"))]
    #[inline(always)]
    fn group<S: Simd>(&self, simd: S, prepared: &Prepared, t_max: f32) -> CwbvhGroup<S> {
        let bytes = |words: [u32; 2]| u8x16::simd_from(simd, bytemuck::cast::<_, [u8; 16]>([words[0], words[1], 0, 0]));
        let numbers = |words: [u32; 2]| -> f32x8<S> {
            let (low, high) = bytes(words).widen().0.widen();
            low.combine(high).bitcast::<i32x8<S>>().to_float()
        };
        let min = [numbers(self.min_x), numbers(self.min_y), numbers(self.min_z)];
        let max = [numbers(self.max_x), numbers(self.max_y), numbers(self.max_z)];
        let (near, entered) = prepared.enters_each_steps(&self.steps(prepared), min, max, t_max);
        let empty = bytes(self.meta).simd_eq(0).to_bitmask() as u32;
        CwbvhGroup { near, left: entered & !empty }
    }

    /// Whether the ray enters the box of a slot that is not empty.
    #[inline(always)]
    pub(super) fn enters(&self, slot: u32, prepared: &Prepared, steps: &Steps, t_max: f32) -> bool {
        let number = |words: [u32; 2]| byte(words, slot) as f32;
        let min = [number(self.min_x), number(self.min_y), number(self.min_z)];
        let max = [number(self.max_x), number(self.max_y), number(self.max_z)];
        prepared.enters_steps(steps, min, max, t_max) < f32::INFINITY && self.meta_of(slot) != 0
    }
}

/// The bit of each slot where that of `slot ^ octant` was.
#[cfg(not(target_arch = "spirv"))]
#[inline(always)]
fn in_order(slots: u32, octant: u32) -> u32 {
    let swapped = |word: u32, by: u32, low: u32| {
        if octant & by == 0 { word } else { ((word >> by) & low) | ((word & low) << by) }
    };
    swapped(swapped(swapped(slots, 4, 0x0f), 2, 0x33), 1, 0x55)
}

/// Children that wait: a bit for each slot, and where the ray enters it.
#[cfg(not(target_arch = "spirv"))]
#[derive(Clone, Copy, Debug)]
pub struct CwbvhGroup<S: Simd> {
    near: f32x8<S>,
    left: u32,
}

#[cfg(not(target_arch = "spirv"))]
impl<S: Simd> Group for CwbvhGroup<S> {
    #[inline(always)]
    fn take(&mut self, octant: u32, t_max: f32) -> Option<u32> {
        let left = self.left & self.near.simd_le(t_max).to_bitmask() as u32;
        let slot = (in_order(left, octant).trailing_zeros() & 7) ^ octant;
        self.left = left & !(1 << slot);
        (left != 0).then_some(slot)
    }

    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.left == 0
    }
}

#[cfg(not(target_arch = "spirv"))]
impl NodesAtOnce for [CwbvhNode] {
    type Group<S: Simd> = CwbvhGroup<S>;

    #[inline(always)]
    fn group<S: Simd>(&self, simd: S, node: u32, prepared: &Prepared, t_max: f32) -> CwbvhGroup<S> {
        self[node as usize].group(simd, prepared, t_max)
    }

    #[inline(always)]
    fn triangles(&self, node: u32, slot: u32) -> u32 {
        let bits = self[node as usize].meta_of(slot) >> 5;
        (bits & 1) + ((bits >> 1) & 1) + (bits >> 2)
    }
}

impl WideNodes for [CwbvhNode] {
    const WIDTH: u32 = 8;

    #[inline(always)]
    fn entered(&self, node: u32, prepared: &Prepared, octant: u32, t_max: f32) -> u32 {
        // Whole: slots share its words.
        let node = self[node as usize];
        node.entered(prepared, &node.steps(prepared), octant, t_max)
    }

    #[inline(always)]
    fn first(word: u32, octant: u32) -> (u32, u32) {
        let lowest = word & (!word).wrapping_add(1);
        ((31 - lowest.leading_zeros()) ^ octant, word & !lowest)
    }

    #[inline(always)]
    fn child(&self, node: u32, slot: u32) -> u32 {
        self[node as usize].child(slot)
    }

    #[inline(always)]
    fn enters(&self, node: u32, slot: u32, prepared: &Prepared, t_max: f32) -> bool {
        let node = &self[node as usize];
        node.enters(slot, prepared, &node.steps(prepared), t_max)
    }
}

//! Nodes whose boxes lie as they are, one coordinate of all children after another.

use super::{NO_CHILD, WideNodes};
use crate::aabb::Aabb;
use crate::ray::Prepared;
use bytemuck::{Pod, Zeroable};
#[cfg(not(target_arch = "spirv"))]
use {
    super::native::{Group, NodesAtOnce},
    fearless_simd::prelude::*,
    fearless_simd::{f32x4, f32x8, mask32x4, mask32x8, u32x4, u32x8},
};

/// Key of a child that the ray does not enter.
const MISSED: u32 = u32::MAX;

/// Set in the four bits that a child takes in a word.
const TAKEN: u32 = 8;

macro_rules! soa_node {
    ($(#[$doc:meta])* $name:ident, $group:ident, $width:literal, $lanes:ident, $words:ident, $mask:ident, $($k:literal)+) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
        #[repr(C)]
        pub struct $name {
            /// Smallest x of each child's box; 0 in an empty slot, like all of its numbers but the child.
            pub min_x: [f32; $width],
            /// Smallest y.
            pub min_y: [f32; $width],
            /// Smallest z.
            pub min_z: [f32; $width],
            /// Largest x.
            pub max_x: [f32; $width],
            /// Largest y.
            pub max_y: [f32; $width],
            /// Largest z.
            pub max_z: [f32; $width],
            /// A node, the first triangle of a leaf with [`LEAF`](crate::trace::LEAF), or [`NO_CHILD`].
            pub child: [u32; $width],
            /// Triangles of a leaf, else 0.
            pub count: [u32; $width],
        }

        const _: () = assert!(size_of::<$name>() == 32 * $width);

        impl $name {
            #[inline(always)]
            fn aabb(&self, k: usize) -> Aabb {
                Aabb {
                    min: [self.min_x[k], self.min_y[k], self.min_z[k]],
                    max: [self.max_x[k], self.max_y[k], self.max_z[k]],
                }
            }

            /// The children that the ray enters, as [`WideNodes::entered`] has them.
            #[inline(always)]
            fn entered(&self, prepared: &Prepared, t_max: f32) -> u32 {
                // No loops over the slots: a driver may count their rounds with those of the walk ([`STEPS`](crate::trace::STEPS)).
                let key = |k: usize| {
                    let near = prepared.enters(&self.aabb(k), t_max);
                    // The bits of numbers that are not negative are in their order.
                    let entered = near < f32::INFINITY && self.child[k] != NO_CHILD;
                    if entered { (near.to_bits() & !7) | k as u32 } else { MISSED }
                };
                let keys = [$(key($k)),+];
                let place = |key: u32| 0 $(+ if keys[$k] < key { 4 } else { 0 })+;
                let mut word = 0;
                $(
                    if keys[$k] != MISSED {
                        word |= ($k | TAKEN) << place(keys[$k]);
                    }
                )+
                word
            }

            /// The children that the ray enters.
            #[cfg(not(target_arch = "spirv"))]
            #[inline(always)]
            fn group<S: Simd>(&self, simd: S, prepared: &Prepared, t_max: f32) -> $group<S> {
                let row = |row: [f32; $width]| $lanes::simd_from(simd, row);
                let min = [row(self.min_x), row(self.min_y), row(self.min_z)];
                let max = [row(self.max_x), row(self.max_y), row(self.max_z)];
                let (near, entered) = prepared.enters_each(min, max, t_max);
                let empty = $words::simd_from(simd, self.child).simd_eq(NO_CHILD).to_bitmask() as u32;
                $group { near, left: entered & !empty }
            }
        }

        /// Children that wait: a bit for each, and where the ray enters them.
        #[cfg(not(target_arch = "spirv"))]
        #[derive(Clone, Copy, Debug)]
        pub struct $group<S: Simd> {
            near: $lanes<S>,
            left: u32,
        }

        #[cfg(not(target_arch = "spirv"))]
        impl<S: Simd> Group for $group<S> {
            #[inline(always)]
            fn take(&mut self, _octant: u32, t_max: f32) -> Option<u32> {
                let left = self.left & self.near.simd_le(t_max).to_bitmask() as u32;
                if left & left.wrapping_sub(1) == 0 {
                    self.left = 0;
                    return (left != 0).then(|| left.trailing_zeros());
                }
                // The bits of numbers that are not negative are in their order.
                let simd = self.near.simd;
                let keys = (self.near.to_bits() & !7) | $words::simd_from(simd, [$($k),+]);
                let waits = $mask::from_bitmask(simd, left.into());
                let slot = waits.select(keys, $words::splat(simd, u32::MAX)).reduce_min() & 7;
                self.left = left & !(1 << slot);
                Some(slot)
            }

            #[inline(always)]
            fn is_empty(&self) -> bool {
                self.left == 0
            }
        }

        #[cfg(not(target_arch = "spirv"))]
        impl NodesAtOnce for [$name] {
            type Group<S: Simd> = $group<S>;

            #[inline(always)]
            fn group<S: Simd>(&self, simd: S, node: u32, prepared: &Prepared, t_max: f32) -> $group<S> {
                self[node as usize].group(simd, prepared, t_max)
            }

            #[inline(always)]
            fn triangles(&self, node: u32, slot: u32) -> u32 {
                self[node as usize].count[slot as usize]
            }
        }

        impl WideNodes for [$name] {
            const WIDTH: u32 = $width;

            #[inline(always)]
            fn entered(&self, node: u32, prepared: &Prepared, _octant: u32, t_max: f32) -> u32 {
                self[node as usize].entered(prepared, t_max)
            }

            #[inline(always)]
            fn first(word: u32, _octant: u32) -> (u32, u32) {
                (word & (TAKEN - 1), word >> 4)
            }

            #[inline(always)]
            fn child(&self, node: u32, slot: u32) -> u32 {
                self[node as usize].child[slot as usize]
            }

            #[inline(always)]
            fn enters(&self, node: u32, slot: u32, prepared: &Prepared, t_max: f32) -> bool {
                prepared.enters(&self[node as usize].aabb(slot as usize), t_max) < f32::INFINITY
            }
        }
    };
}

soa_node!(
    /// A node of four children, 128 bytes: two cache lines.
    Bvh4Node, Bvh4Group, 4, f32x4, u32x4, mask32x4, 0 1 2 3
);
soa_node!(
    /// A node of eight children, 256 bytes: four cache lines.
    Bvh8Node, Bvh8Group, 8, f32x8, u32x8, mask32x8, 0 1 2 3 4 5 6 7
);

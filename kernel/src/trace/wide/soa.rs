//! Nodes whose boxes lie as they are, one coordinate of all children after another.

use super::{NO_CHILD, WideNodes};
use crate::aabb::Aabb;
use crate::ray::Prepared;
use bytemuck::{Pod, Zeroable};

/// Key of a child that the ray does not enter.
#[cfg(any(target_arch = "spirv", test))]
const MISSED: u32 = u32::MAX;

/// Set in the four bits that a child takes in a word.
const TAKEN: u32 = 8;

/// Four times the bits that are set in a byte.
#[cfg(not(target_arch = "spirv"))]
const ONES_TIMES_4: [u8; 256] = {
    let mut ones = [0; 256];
    let mut byte = 1;
    while byte < 256 {
        ones[byte] = ones[byte / 2] + 4 * (byte % 2) as u8;
        byte += 1;
    }
    ones
};

macro_rules! soa_node {
    ($(#[$doc:meta])* $name:ident, $width:literal, $lanes:ty, $words:ty, $signed:ty, $($k:literal)+) => {
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
            #[cfg(any(target_arch = "spirv", test))]
            #[inline(always)]
            pub(super) fn entered_one_by_one(&self, prepared: &Prepared, t_max: f32) -> u32 {
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

            /// The same, all slots at once.
            #[cfg(not(target_arch = "spirv"))]
            #[inline(always)]
            pub(super) fn entered_at_once(&self, prepared: &Prepared, t_max: f32) -> u32 {
                let row = |row: [f32; $width]| <$lanes>::new(row);
                let min = [row(self.min_x), row(self.min_y), row(self.min_z)];
                let max = [row(self.max_x), row(self.max_y), row(self.max_z)];
                let (near, entered) = prepared.enters_each(min, max, t_max);
                let child = <$words>::new(self.child);
                let mut left = entered & !child.simd_eq(<$words>::splat(NO_CHILD)).to_bitmask();
                if left & left.wrapping_sub(1) == 0 {
                    return if left == 0 { 0 } else { left.trailing_zeros() | TAKEN };
                }
                let entered = left;
                let near: $words = bytemuck::cast(near);
                let keys = (near & <$words>::splat(!7)) | <$words>::new([$($k),+]);
                let each: [u32; $width] = keys.to_array();
                let keys: $signed = bytemuck::cast(keys);
                let mut word = 0;
                while left != 0 {
                    let k = left.trailing_zeros();
                    left &= left - 1;
                    let before = keys.simd_lt(<$signed>::splat(each[(k & ($width - 1)) as usize] as i32)).to_bitmask() & entered;
                    word |= (k | TAKEN) << ONES_TIMES_4[before as usize];
                }
                word
            }
        }

        impl WideNodes for [$name] {
            const WIDTH: u32 = $width;

            #[cfg(target_arch = "spirv")]
            #[inline(always)]
            fn entered(&self, node: u32, prepared: &Prepared, _octant: u32, t_max: f32) -> u32 {
                self[node as usize].entered_one_by_one(prepared, t_max)
            }

            #[cfg(not(target_arch = "spirv"))]
            #[inline(always)]
            fn entered(&self, node: u32, prepared: &Prepared, _octant: u32, t_max: f32) -> u32 {
                self[node as usize].entered_at_once(prepared, t_max)
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
    Bvh4Node, 4, wide::f32x4, wide::u32x4, wide::i32x4, 0 1 2 3
);
soa_node!(
    /// A node of eight children, 256 bytes: four cache lines.
    Bvh8Node, 8, wide::f32x8, wide::u32x8, wide::i32x8, 0 1 2 3 4 5 6 7
);

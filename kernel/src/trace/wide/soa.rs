//! Nodes whose boxes lie as they are, one coordinate of all children after another.

use super::{NO_CHILD, WideNodes};
use crate::aabb::Aabb;
use crate::ray::Prepared;
use bytemuck::{Pod, Zeroable};

/// Key of a child that the ray does not enter.
const MISSED: u32 = u32::MAX;

/// Set in the four bits that a child takes in a word.
const TAKEN: u32 = 8;

macro_rules! soa_node {
    ($(#[$doc:meta])* $name:ident, $width:literal, $($k:literal)+) => {
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

        impl WideNodes for [$name] {
            const WIDTH: u32 = $width;

            #[inline(always)]
            fn entered(&self, node: u32, prepared: &Prepared, _octant: u32, t_max: f32) -> u32 {
                let node = &self[node as usize];
                // No loops over the slots: a driver may count their rounds with those of the walk ([`STEPS`](crate::trace::STEPS)).
                let key = |k: usize| {
                    let aabb = Aabb {
                        min: [node.min_x[k], node.min_y[k], node.min_z[k]],
                        max: [node.max_x[k], node.max_y[k], node.max_z[k]],
                    };
                    let near = prepared.enters(&aabb, t_max);
                    // The bits of numbers that are not negative are in their order.
                    let entered = near < f32::INFINITY && node.child[k] != NO_CHILD;
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

            #[inline(always)]
            fn next(&self, node: u32, word: u32, _octant: u32) -> (u32, u32) {
                (self[node as usize].child[(word & (TAKEN - 1)) as usize], word >> 4)
            }
        }
    };
}

soa_node!(
    /// A node of four children, 128 bytes: two cache lines.
    Bvh4Node, 4, 0 1 2 3
);
soa_node!(
    /// A node of eight children, 256 bytes: four cache lines.
    Bvh8Node, 8, 0 1 2 3 4 5 6 7
);

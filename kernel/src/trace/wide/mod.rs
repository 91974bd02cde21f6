//! Rays through nodes of four or eight children.
//!
//! Source: Ylitie, Karras & Laine 2017, §3.2 and §4: what a ray enters of a node is a group, one word of bits beside the node's number, and a group that waits
//! is one entry of the stack. So a stack has an entry a level, however wide the nodes are.
//!
//! | layout | bytes | order of children |
//! |---|---|---|
//! | [`Bvh4Node`], [`Bvh8Node`] | 128, 256 | by where the ray enters them |
//! | [`CwbvhNode`] | 80 | by the octant of the ray: their slots were chosen for it |
//!
//! A box of any layout contains what it is around, so that hits are those of every other tree ([`crate::ray`]).

mod cwbvh;
#[cfg(not(target_arch = "spirv"))]
mod native;
mod soa;
#[cfg(test)]
mod tests;

pub use cwbvh::CwbvhNode;
#[cfg(not(target_arch = "spirv"))]
pub use native::NodesAtOnce;
pub use soa::{Bvh4Node, Bvh8Node};

use super::stack::Stack;
use super::{DONE, LEAF, Nodes, STEPS, TraceParams, TraceTriangle, Walk};
use crate::mem::Slot;
use crate::ray::{Hit, NO_TRIANGLE, Prepared, Ray, SOME_TRIANGLE};
#[cfg(not(target_arch = "spirv"))]
use native::{NodesAtOnce as NodesAlone, walk_alone};
#[cfg(target_arch = "spirv")]
use {super::Nodes as NodesAlone, super::stack::LocalStack};

/// A slot of a node without a child.
pub const NO_CHILD: u32 = u32::MAX;

/// Levels whose groups fit into the stack of an invocation's own.
pub const LOCAL_LEVELS: u32 = 32;

/// Words of an entry: a node, and what remains of its children.
pub const ENTRY_WORDS: u32 = 2;

/// Words of that stack.
pub const LOCAL_WORDS: usize = (LOCAL_LEVELS * ENTRY_WORDS) as usize;

/// [`Walk::current`] of a child that lies beyond what was hit since its node was visited.
const BEYOND: u32 = DONE - 1;

/// Nodes of several children.
pub trait WideNodes {
    /// Slots of a node.
    const WIDTH: u32;

    /// The children of `node` that the ray enters before `t_max`, as a word to take them from, nearer ones first; 0 if there are none.
    fn entered(&self, node: u32, prepared: &Prepared, octant: u32, t_max: f32) -> u32;

    /// The slot of the first child in the word, which is not 0, and the word without it.
    fn first(word: u32, octant: u32) -> (u32, u32);

    /// What a slot that is not empty holds: a node, or the first triangle of a leaf with [`LEAF`].
    fn child(&self, node: u32, slot: u32) -> u32;

    /// Whether the ray enters the box of a slot that is not empty before `t_max`.
    fn enters(&self, node: u32, slot: u32, prepared: &Prepared, t_max: f32) -> bool;
}

/// The octant that a ray goes to: a bit for each negative component, x the highest.
#[inline(always)]
#[must_use]
pub fn octant(direction: [f32; 3]) -> u32 {
    let bit = |k: usize, bit: u32| if direction[k] < 0.0 { bit } else { 0 };
    bit(0, 4) | bit(1, 2) | bit(2, 1)
}

/// [`Nodes::walk`]. Between two dispatches the group in hand waits on the stack.
#[inline(always)]
fn walk_wide<N: WideNodes + ?Sized, S: Stack>(
    nodes: &N,
    params: &TraceParams,
    ray: &Ray,
    triangles: &[TraceTriangle],
    stack: &mut S,
    mut walk: Walk,
) -> Walk {
    let prepared = Prepared::new(ray);
    let octant = octant(ray.direction);
    let mut node = 0;
    let mut entered = 0;
    for _ in 0..STEPS {
        if walk.current == DONE {
            break;
        }
        let mut goes_on = true;
        let mut is_fresh = false;
        if walk.current == BEYOND {
            // Nothing to visit.
        } else if walk.current & LEAF == 0 {
            if entered != 0 {
                stack.set(walk.depth, node);
                stack.set(walk.depth + 1, entered);
                walk.depth += ENTRY_WORDS;
            }
            node = walk.current;
            walk.hit.box_tests += N::WIDTH;
            entered = nodes.entered(node, &prepared, octant, walk.hit.t);
            is_fresh = entered != 0;
        } else {
            goes_on = walk.visit_triangle(params, &prepared, triangles);
            if walk.hit.triangle == SOME_TRIANGLE {
                entered = 0;
            }
        }
        if goes_on {
            if entered == 0 && walk.depth > 0 {
                walk.depth -= ENTRY_WORDS;
                node = stack.get(walk.depth);
                entered = stack.get(walk.depth + 1);
            }
            walk.current = DONE;
            if entered != 0 {
                let (slot, rest) = N::first(entered, octant);
                entered = rest;
                // Since the node was visited something may have been hit before this child.
                let is_beyond =
                    !is_fresh && walk.hit.triangle != NO_TRIANGLE && !nodes.enters(node, slot, &prepared, walk.hit.t);
                walk.current = if is_beyond { BEYOND } else { nodes.child(node, slot) };
            }
        }
    }
    if entered != 0 {
        stack.set(walk.depth, node);
        stack.set(walk.depth + 1, entered);
        walk.depth += ENTRY_WORDS;
    }
    walk
}

/// Invocation `i` traces ray `first + i` with a stack of its own.
#[inline(always)]
pub fn trace_wide<N: NodesAlone + ?Sized>(
    i: u32,
    params: &TraceParams,
    nodes: &N,
    triangles: &[TraceTriangle],
    rays: &[Ray],
    hits: &[Slot<Hit>],
) {
    let k = (params.first + i) as usize;
    hits[k].set(walk_alone(params, &rays[k], nodes, triangles).result(params));
}

/// A walk of its own; natively it is another one.
#[cfg(target_arch = "spirv")]
#[inline(always)]
fn walk_alone<N: Nodes + ?Sized>(params: &TraceParams, ray: &Ray, nodes: &N, triangles: &[TraceTriangle]) -> Walk {
    nodes.walk(params, ray, triangles, &mut LocalStack::<LOCAL_WORDS>::new(), Walk::start(params, ray))
}

macro_rules! nodes {
    ($($node:ty),+) => {$(
        impl Nodes for [$node] {
            #[inline(always)]
            fn walk<S: Stack>(
                &self,
                params: &TraceParams,
                ray: &Ray,
                triangles: &[TraceTriangle],
                stack: &mut S,
                walk: Walk,
            ) -> Walk {
                walk_wide(self, params, ray, triangles, stack, walk)
            }
        }
    )+};
}

nodes!(Bvh4Node, Bvh8Node, CwbvhNode);

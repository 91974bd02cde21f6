//! Rays through a tree, to measure the tree.
//!
//! Source: Aila & Laine 2009, "if-if": a node holds the boxes of both children, the nearer child comes first, the other one goes on
//! a stack; a step visits one node or one triangle. Kind: map: invocation `i` reads the scene and `rays[first + i]`, writes `hits[first + i]`.
//!
//! | kernel | stack |
//! |---|---|
//! | `trace_32`, `trace_64`, `trace_128` | an array of the invocation, for trees of at most that depth |
//! | `trace_deep` | a buffer, for any depth and any number of steps, over as many dispatches as it takes |
//! | `trace_bvh4`, `trace_bvh8`, `trace_cwbvh` | an array of the invocation, for wide trees of at most 32 levels ([`wide`]) |
//! | `trace_bvh4_deep`, `trace_bvh8_deep`, `trace_cwbvh_deep` | a buffer, as `trace_deep` |
//!
//! [`path`] has the kernels of the path tracer around them. See [`crate::ray`] for the tests and why hits do not depend on
//! the tree.

pub mod counts;
pub mod path;
pub mod random;
pub mod stack;
pub mod wide;

use crate::aabb::Aabb;
use crate::mem::Slot;
use crate::ray::{Hit, NO_TRIANGLE, Prepared, Ray, SOME_TRIANGLE, UNFINISHED};
use bytemuck::{Pod, Zeroable};
use stack::{BufferStack, Stack};

/// Set in a reference to a leaf, whose other bits are its first triangle.
pub const LEAF: u32 = 0x8000_0000;

/// An internal node, 64 bytes: boxes of and references to both children.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TraceNode {
    /// Lower corner of the left child's box.
    pub left_min: [f32; 3],
    /// Left child: a node, or the first triangle of a leaf with [`LEAF`].
    pub left: u32,
    /// Upper corner of the left child's box.
    pub left_max: [f32; 3],
    /// Right child.
    pub right: u32,
    /// Lower corner of the right child's box.
    pub right_min: [f32; 3],
    /// 0.
    pub unused: u32,
    /// Upper corner of the right child's box.
    pub right_max: [f32; 3],
    /// 0.
    pub also_unused: u32,
}

/// A triangle in the order of the leaves, 48 bytes: a row for each coordinate of its corners.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TraceTriangle {
    /// x of the corners.
    pub x: [f32; 3],
    /// Number in the scene.
    pub id: u32,
    /// y of the corners.
    pub y: [f32; 3],
    /// 1 for the last triangle of a leaf, else 0.
    pub is_last: u32,
    /// z of the corners.
    pub z: [f32; 3],
    /// 0.
    pub unused: u32,
}

impl TraceTriangle {
    /// A triangle that is not the last one of its leaf.
    #[must_use]
    pub fn new(id: u32, [a, b, c]: [[f32; 3]; 3]) -> Self {
        Self { x: [a[0], b[0], c[0]], id, y: [a[1], b[1], c[1]], is_last: 0, z: [a[2], b[2], c[2]], unused: 0 }
    }

    /// [`Prepared::hits`]: parameter of the ray's hit before `t_max`; infinite if there is none.
    #[inline(always)]
    pub(crate) fn hit(&self, prepared: &Prepared, t_max: f32) -> f32 {
        #[cfg(not(target_arch = "spirv"))]
        if prepared.misses(bytemuck::cast_ref(self)) {
            return f32::INFINITY;
        }
        prepared.hits(self.corners(), t_max)
    }

    #[inline(always)]
    fn corners(&self) -> [[f32; 3]; 3] {
        let Self { x, y, z, .. } = *self;
        [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]]
    }
}

const _: () = assert!(size_of::<TraceNode>() == 64 && size_of::<TraceTriangle>() == 48);

/// Push constants of the tracing kernels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TraceParams {
    /// Invocations: one per ray.
    pub count: u32,
    /// The first ray.
    pub first: u32,
    /// Reference to the root: node 0, or the only leaf.
    pub root: u32,
    /// 1: whether a ray hits anything; 0: the closest hit.
    pub any: u32,
    /// `trace_deep`: 1 to go on where the last dispatch stopped, 0 to start.
    pub resumes: u32,
}

/// Nodes and triangles that a ray visits in one dispatch at most. A driver may end long loops (lavapipe does after 65,535
/// iterations, silently), and a display may be waiting for the device.
pub const STEPS: u32 = 32_768;

/// [`Walk::current`] at the end of a walk.
pub const DONE: u32 = u32::MAX;

/// A ray on its way through the tree.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    /// The node or triangle to visit next; [`DONE`].
    pub current: u32,
    /// References on the stack.
    pub depth: u32,
    /// What was hit so far; `t` is the largest parameter that still matters.
    pub hit: Hit,
}

impl Walk {
    /// A ray at the root.
    #[inline(always)]
    #[must_use]
    pub fn start(params: &TraceParams, ray: &Ray) -> Self {
        let hit = Hit { t: ray.t_max, triangle: NO_TRIANGLE, box_tests: 0, triangle_tests: 0 };
        Self { current: if ray.is_active() { params.root } else { DONE }, depth: 0, hit }
    }

    /// The hit, [`UNFINISHED`] if the walk is not at its end.
    #[inline(always)]
    #[must_use]
    pub fn result(self, params: &TraceParams) -> Hit {
        let mut hit = self.hit;
        if hit.triangle == NO_TRIANGLE || params.any != 0 {
            hit.t = 0.0;
        }
        if self.current != DONE {
            hit.triangle = UNFINISHED;
        }
        hit
    }

    /// Tests the current triangle and goes on to the next one of its leaf; whether there is none. Of hits at the same parameter the one with the
    /// lowest triangle wins. An any-hit ray that hits has [`SOME_TRIANGLE`] afterwards, and nothing on its stack.
    #[inline(always)]
    fn visit_triangle(&mut self, params: &TraceParams, prepared: &Prepared, triangles: &[TraceTriangle]) -> bool {
        let triangle = &triangles[(self.current & !LEAF) as usize];
        self.hit.triangle_tests += 1;
        let t = triangle.hit(prepared, self.hit.t);
        self.current += 1;
        if self.meets(params, t, triangle.id) {
            self.depth = 0;
            return true;
        }
        triangle.is_last != 0
    }

    /// Takes note of a triangle that is hit at `t`, if it is: infinity if not. Whether that is all that an any-hit ray asks.
    #[inline(always)]
    fn meets(&mut self, params: &TraceParams, t: f32, triangle: u32) -> bool {
        let hits = t < f32::INFINITY;
        if hits && (t < self.hit.t || triangle < self.hit.triangle) {
            self.hit.t = t;
            self.hit.triangle = triangle;
        }
        let ends = hits && params.any != 0;
        if ends {
            self.hit.triangle = SOME_TRIANGLE;
        }
        ends
    }
}

/// The nodes of a tree, in whatever layout.
pub trait Nodes {
    /// Walks on by at most [`STEPS`] nodes and triangles.
    fn walk<S: Stack>(
        &self,
        params: &TraceParams,
        ray: &Ray,
        triangles: &[TraceTriangle],
        stack: &mut S,
        walk: Walk,
    ) -> Walk;
}

impl Nodes for [TraceNode] {
    #[inline(always)]
    fn walk<S: Stack>(
        &self,
        params: &TraceParams,
        ray: &Ray,
        triangles: &[TraceTriangle],
        stack: &mut S,
        mut walk: Walk,
    ) -> Walk {
        let prepared = Prepared::new(ray);
        for _ in 0..STEPS {
            if walk.current == DONE {
                break;
            }
            let pops;
            if walk.current & LEAF == 0 {
                let node = self[walk.current as usize];
                walk.hit.box_tests += 2;
                let left = prepared.enters(&Aabb { min: node.left_min, max: node.left_max }, walk.hit.t);
                let right = prepared.enters(&Aabb { min: node.right_min, max: node.right_max }, walk.hit.t);
                let left_first = left <= right;
                let (near, far) = if left_first { (left, right) } else { (right, left) };
                pops = near == f32::INFINITY;
                walk.current = if left_first { node.left } else { node.right };
                if far < f32::INFINITY {
                    stack.set(walk.depth, if left_first { node.right } else { node.left });
                    walk.depth += 1;
                }
            } else {
                pops = walk.visit_triangle(params, &prepared, triangles);
            }
            if pops {
                walk.current = DONE;
                if walk.depth > 0 {
                    walk.depth -= 1;
                    walk.current = stack.get(walk.depth);
                }
            }
        }
        walk
    }
}

/// Invocation `i` traces ray `first + i` with a stack of its own.
#[inline(always)]
pub fn trace<N: Nodes + ?Sized, S: Stack>(
    i: u32,
    params: &TraceParams,
    nodes: &N,
    triangles: &[TraceTriangle],
    rays: &[Ray],
    hits: &[Slot<Hit>],
    stack: &mut S,
) {
    let k = (params.first + i) as usize;
    let ray = rays[k];
    let end = nodes.walk(params, &ray, triangles, stack, Walk::start(params, &ray));
    hits[k].set(end.result(params));
}

/// Invocation `i` traces ray `first + i` with its stack in `words[(depth + 3) · count]`, whose first three rows keep the walk from one
/// dispatch to the next.
#[inline(always)]
pub fn trace_deep<N: Nodes + ?Sized>(
    i: u32,
    params: &TraceParams,
    nodes: &N,
    triangles: &[TraceTriangle],
    rays: &[Ray],
    hits: &[Slot<Hit>],
    words: &[Slot<u32>],
) {
    let k = (params.first + i) as usize;
    let ray = rays[k];
    let mut from = Walk::start(params, &ray);
    let (current, depth) = (i as usize, (params.count + i) as usize);
    if params.resumes != 0 {
        let mut hit = hits[k].get();
        if words[current].get() != DONE {
            hit.triangle = words[depth + params.count as usize].get();
        }
        from = Walk { current: words[current].get(), depth: words[depth].get(), hit };
    }
    if params.resumes == 0 || from.current != DONE {
        let mut stack = BufferStack { words, invocation: i, count: params.count };
        let end = nodes.walk(params, &ray, triangles, &mut stack, from);
        words[current].set(end.current);
        words[depth].set(end.depth);
        words[depth + params.count as usize].set(end.hit.triangle);
        let mut hit = end.result(params);
        if end.current != DONE {
            hit.t = end.hit.t;
        }
        hits[k].set(hit);
    }
}

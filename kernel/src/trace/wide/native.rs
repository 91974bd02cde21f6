//! Rays through nodes of several children as a processor takes them, for trees whose stack is the invocation's own.
//!
//! Hits and counts are those of [`walk_wide`](super), which a GPU runs and this is tested against; what differs is what a core has more of. Where a ray enters a child stays
//! on the stack, so that a child that lies beyond a later hit goes by one comparison, with all of its kind; the next child is looked for when it is wanted, instead of all
//! being sorted; triangles of a leaf are tested four at once.

use super::{LOCAL_LEVELS, WideNodes, octant};
use crate::ray::{Prepared, Ray};
use crate::trace::{DONE, LEAF, STEPS, TraceParams, TraceTriangle, Walk};
use arrayvec::ArrayVec;
use fearless_simd::{Level, Simd};

/// Triangles that are tested at once.
const FOUR: usize = 4;

/// Children of a node that a ray enters and has not visited.
pub trait Group: Copy {
    /// Takes the first one that the ray enters before `t_max` out of the group: its slot.
    fn take(&mut self, octant: u32, t_max: f32) -> Option<u32>;
    /// Whether none is left.
    fn is_empty(&self) -> bool;
}

/// Nodes whose children are tested at once.
pub trait NodesAtOnce: WideNodes {
    /// Children that wait.
    type Group<S: Simd>: Group;

    /// The children of `node` that the ray enters before `t_max`.
    fn group<S: Simd>(&self, simd: S, node: u32, prepared: &Prepared, t_max: f32) -> Self::Group<S>;

    /// Triangles of a leaf in a slot.
    fn triangles(&self, node: u32, slot: u32) -> u32;
}

/// A walk with the vectors that the processor has.
#[inline(always)]
pub(super) fn walk_alone<N: NodesAtOnce + ?Sized>(
    params: &TraceParams,
    ray: &Ray,
    nodes: &N,
    triangles: &[TraceTriangle],
) -> Walk {
    walk_on(Level::new(), params, ray, nodes, triangles)
}

/// A walk with the vectors of a level; on an x86-64 those of AVX2 or of SSE2.
#[inline(always)]
pub(super) fn walk_on<N: NodesAtOnce + ?Sized>(
    level: Level,
    params: &TraceParams,
    ray: &Ray,
    nodes: &N,
    triangles: &[TraceTriangle],
) -> Walk {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(avx2) = level.as_avx2() {
            return avx2.vectorize(
                #[inline(always)]
                || walk(avx2, params, ray, nodes, triangles),
            );
        }
        let sse2 = level.as_sse2().expect("every x86-64 has it");
        walk(sse2, params, ray, nodes, triangles)
    }
    #[cfg(not(target_arch = "x86_64"))]
    fearless_simd::dispatch!(level, simd => walk(simd, params, ray, nodes, triangles))
}

#[inline(always)]
fn walk<S: Simd, N: NodesAtOnce + ?Sized>(
    simd: S,
    params: &TraceParams,
    ray: &Ray,
    nodes: &N,
    triangles: &[TraceTriangle],
) -> Walk {
    let mut walk = Walk::start(params, ray);
    if walk.current == DONE {
        return walk;
    }
    let prepared = Prepared::new(ray);
    let octant = octant(ray.direction);
    let mut stack: ArrayVec<(N::Group<S>, u32), { LOCAL_LEVELS as usize }> = ArrayVec::new();
    // Of a leaf.
    let mut count = 0;
    let mut steps = 0;
    loop {
        let is_node = walk.current & LEAF == 0;
        steps += if is_node { 1 } else { count };
        if steps > STEPS {
            // As on a GPU, the walk begins anew with its stack in a buffer.
            return walk;
        }
        if is_node {
            let node = walk.current;
            walk.hit.box_tests += N::WIDTH;
            let mut group = nodes.group(simd, node, &prepared, walk.hit.t);
            if let Some(slot) = group.take(octant, walk.hit.t) {
                walk.current = nodes.child(node, slot);
                count = nodes.triangles(node, slot);
                if !group.is_empty() {
                    stack.push((group, node));
                }
                continue;
            }
        } else if walk.visit_leaf(simd, params, &prepared, triangles, count) {
            walk.current = DONE;
            return walk;
        }
        walk.current = DONE;
        while let Some((group, node)) = stack.last_mut() {
            let (taken, node) = (group.take(octant, walk.hit.t), *node);
            if group.is_empty() {
                stack.pop();
            }
            if let Some(slot) = taken {
                walk.current = nodes.child(node, slot);
                count = nodes.triangles(node, slot);
                break;
            }
        }
        if walk.current == DONE {
            return walk;
        }
    }
}

impl Walk {
    /// Tests the `count` triangles of the current leaf; whether an any-hit ray is at its end.
    #[inline(always)]
    fn visit_leaf<S: Simd>(
        &mut self,
        simd: S,
        params: &TraceParams,
        prepared: &Prepared,
        triangles: &[TraceTriangle],
        count: u32,
    ) -> bool {
        let first = (self.current & !LEAF) as usize;
        let leaf = &triangles[first..first + count as usize];
        if let [triangle] = leaf {
            self.hit.triangle_tests += 1;
            return !prepared.misses_by(simd, bytemuck::cast_ref(triangle)) && self.hits(params, prepared, triangle);
        }
        for four in leaf.chunks(FOUR) {
            let before = self.hit.triangle_tests;
            let rows = |k: usize| bytemuck::cast_ref(&four[k.min(four.len() - 1)]);
            let mut left = prepared.may_hit(simd, [rows(0), rows(1), rows(2), rows(3)]) & ((1 << four.len()) - 1);
            while left != 0 {
                let k = left.trailing_zeros();
                left &= left - 1;
                if self.hits(params, prepared, &four[k as usize]) {
                    self.hit.triangle_tests = before + k + 1;
                    return true;
                }
            }
            self.hit.triangle_tests = before + four.len() as u32;
        }
        false
    }

    /// Tests a triangle; whether an any-hit ray is at its end.
    #[inline(always)]
    fn hits(&mut self, params: &TraceParams, prepared: &Prepared, triangle: &TraceTriangle) -> bool {
        self.meets(params, prepared.hits(triangle.corners(), self.hit.t), triangle.id)
    }
}

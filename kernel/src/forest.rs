//! The subtrees that an invocation joins, in memory of its own.

use crate::aabb::Aabb;

/// Up to `N` roots of subtrees, each in a slot with its box.
pub(crate) struct Forest<const N: usize> {
    /// Slots in use, from 0 on.
    pub(crate) count: u32,
    nodes: [u32; N],
    boxes: [Aabb; N],
}

impl<const N: usize> Forest<N> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { count: 0, nodes: [0; N], boxes: [Aabb { min: [0.0; 3], max: [0.0; 3] }; N] }
    }

    /// Node of the root in `slot`.
    #[inline(always)]
    pub(crate) fn node(&self, slot: u32) -> u32 {
        self.nodes[slot as usize]
    }

    /// Its box.
    #[inline(always)]
    pub(crate) fn aabb(&self, slot: u32) -> Aabb {
        self.boxes[slot as usize]
    }

    /// Puts a root into `slot`, in use or not.
    #[inline(always)]
    pub(crate) fn put(&mut self, slot: u32, node: u32, aabb: Aabb) {
        self.nodes[slot as usize] = node;
        self.boxes[slot as usize] = aabb;
    }

    /// Puts a root behind the others.
    #[inline(always)]
    pub(crate) fn push(&mut self, node: u32, aabb: Aabb) {
        self.put(self.count, node, aabb);
        self.count += 1;
    }
}

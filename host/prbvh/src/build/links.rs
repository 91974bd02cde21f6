//! A tree that is made bottom-up: clusters of two, and at the end the nodes of a device.

use super::top_down::fill_boxes;
use prbvh_kernel::node::{NO_NODE, Node, RIGHT};
use prbvh_kernel::setup::Triangle;
use std::sync::atomic::{AtomicU32, Ordering};

/// Clusters over `n` references: `k < n` is the reference `k` alone, `n` and above are pairs. Several threads may make pairs; their numbers then
/// depend on who was first, and nothing may depend on these.
pub(super) struct Links {
    pairs: Vec<[AtomicU32; 2]>,
    made: AtomicU32,
}

impl Links {
    pub(super) fn new(references: usize) -> Self {
        let pairs = (1..references).map(|_| [const { AtomicU32::new(0) }; 2]).collect();
        Self { pairs, made: AtomicU32::new(0) }
    }

    fn references(&self) -> u32 {
        self.pairs.len() as u32 + 1
    }

    /// Makes a pair. Returns its number.
    pub(super) fn join(&self, left: u32, right: u32) -> u32 {
        let k = self.made.fetch_add(1, Ordering::Relaxed);
        let pair = &self.pairs[k as usize];
        pair[0].store(left, Ordering::Relaxed);
        pair[1].store(right, Ordering::Relaxed);
        self.references() + k
    }

    /// `nodes[2n-1]` of the tree below `root`, which holds all references. Nodes are numbered depth-first, so that equal trees are equal nodes.
    pub(super) fn nodes(self, root: u32, triangles: &[Triangle]) -> Vec<Node> {
        let n = self.references();
        let mut nodes = vec![Node { min: [0.0; 3], up: NO_NODE, max: [0.0; 3], down: 0 }; 2 * n as usize - 1];
        let (mut next_internal, mut next_leaf) = (0, n - 1);
        let mut pending = vec![(root, NO_NODE)];
        while let Some((cluster, up)) = pending.pop() {
            let next = if cluster < n { &mut next_leaf } else { &mut next_internal };
            let id = *next;
            *next += 1;
            nodes[id as usize].up = up;
            if up != NO_NODE {
                let parent = up & !RIGHT;
                if up & RIGHT == 0 {
                    nodes[parent as usize].down = id;
                } else {
                    let left = nodes[parent as usize].down;
                    nodes[left as usize].up = id;
                }
            }
            if cluster < n {
                nodes[id as usize].down = cluster;
            } else {
                let [left, right] =
                    self.pairs[(cluster - n) as usize].each_ref().map(|link| link.load(Ordering::Relaxed));
                pending.extend([(right, id | RIGHT), (left, id)]);
            }
        }
        let (internal, leaves) = nodes.split_at_mut(n as usize - 1);
        fill_boxes((internal, 0), (leaves, n - 1), triangles);
        nodes
    }
}

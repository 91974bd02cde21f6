//! Which nodes are treelet roots, and in which order they can be processed.

use crate::climb::climb;
use crate::math::umax;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Node, ROOT};
use bytemuck::{Pod, Zeroable};

/// Push constants of [`levels`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct LevelsParams {
    /// Invocations: one per leaf, `n`.
    pub count: u32,
    /// Fewest references below a treelet root, γ.
    pub gamma: u32,
}

/// References below node `v`.
#[inline(always)]
fn size(v: u32, internal: u32, sizes: &[AtomicU32]) -> u32 {
    if v < internal { sizes[v as usize].load() } else { 1 }
}

/// Level of node `v`; 0 if it is no treelet root.
#[inline(always)]
fn level(v: u32, internal: u32, levels: &[AtomicU32]) -> u32 {
    if v < internal { levels[v as usize].load() } else { 0 }
}

/// Invocation `i` climbs from leaf `i`. Reads `nodes[2n-1]`; `counts[n]` and `arrivals[n-1]` start as 0. Writes of each internal node the
/// references below it, `sizes[n-1]`, and its level, `levels[n-1]`: 0 with fewer than γ references, else one more than the higher of its
/// children's. `counts[l]` becomes the number of nodes of level `l > 0`, and `counts[0]` the level of the root, which no climb that
/// loses a leaf on its way writes. `order[n-1]` becomes the identity, which the sort by levels starts from.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn levels(
    i: u32,
    params: &LevelsParams,
    nodes: &[Node],
    sizes: &[AtomicU32],
    levels: &[AtomicU32],
    order: &[Slot<u32>],
    counts: &[AtomicU32],
    arrivals: &[AtomicU32],
) {
    let LevelsParams { count, gamma } = *params;
    let internal = count - 1;
    if i < internal {
        order[i as usize].set(i);
    }
    climb(i, count, nodes, arrivals, move |p, left, right| {
        let below = size(left, internal, sizes) + size(right, internal, sizes);
        sizes[p as usize].store(below);
        let mut own = 0;
        if below >= gamma {
            own = 1 + umax(level(left, internal, levels), level(right, internal, levels));
            counts[own as usize].add(1);
        }
        levels[p as usize].store(own);
        if p == ROOT && below == count {
            counts[0].store(own);
        }
    });
}

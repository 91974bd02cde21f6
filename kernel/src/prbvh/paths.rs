//! PRBVH refit: boxes of the nodes above what moved, and of no others.
//!
//! Source: Meister & Bittner 2018, §5 "Recompute bounding boxes", which recomputes all. Kind: two climbs from the two ends of every move, the
//! node that lost leaves and the one that gained them. The first ([`mark`]) counts how many ways lead into each node; only the first to come
//! goes on, so a node above many moves is passed once. The second ([`refit`]) counts down; the last to come completes the node and goes
//! on, as in [`climb`](mod@crate::climb), after both of its children. All counts are 0 again at the end if the links are a tree: in a
//! loop every node waits for another one.

use super::{PrbvhParams, Reinsertion};
use crate::mem::AtomicU32;
use crate::node::{AtomicNode, Links, NO_NODE, Node};

/// Invocation `i` climbs from the ends of the move `found[i]`. Reads `nodes[2n-1]`, raises `ways[n-1]`, which starts as 0.
#[inline(always)]
pub fn mark(i: u32, params: &PrbvhParams, found: &[Reinsertion], nodes: &[Node], ways: &[AtomicU32]) {
    let Reinsertion { input, output, .. } = found[i as usize];
    if output != NO_NODE {
        mark_from(nodes.parent(input), params, nodes, ways);
        mark_from(output, params, nodes, ways);
    }
}

#[inline(always)]
fn mark_from(start: u32, params: &PrbvhParams, nodes: &[Node], ways: &[AtomicU32]) {
    let mut v = start;
    for _ in 0..params.nodes {
        if v == NO_NODE || ways[v as usize].arrive() != 0 {
            break;
        }
        v = nodes.parent(v);
    }
}

/// Invocation `i` climbs from the ends of the move `found[i]` and recomputes boxes. Reads and writes `nodes[2n-1]`, lowers `ways[n-1]` to 0.
#[inline(always)]
pub fn refit(i: u32, params: &PrbvhParams, found: &[Reinsertion], nodes: &[AtomicNode], ways: &[AtomicU32]) {
    let Reinsertion { input, output, .. } = found[i as usize];
    if output != NO_NODE {
        refit_from(nodes.parent(input), params, nodes, ways);
        refit_from(output, params, nodes, ways);
    }
}

#[inline(always)]
fn refit_from(start: u32, params: &PrbvhParams, nodes: &[AtomicNode], ways: &[AtomicU32]) {
    let mut v = start;
    for _ in 0..params.nodes {
        if v == NO_NODE || ways[v as usize].depart() != 1 {
            break;
        }
        let left = nodes.down(v);
        nodes[v as usize].set_aabb(nodes[left as usize].aabb().union(nodes[nodes.up(left) as usize].aabb()));
        v = nodes.parent(v);
    }
}

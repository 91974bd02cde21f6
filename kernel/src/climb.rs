//! The way up a tree from all its leaves at once.
//!
//! Source: Karras 2012, §4 (last paragraph). The first arrival at a node ends; the second one finds both subtrees done and goes on. No race:
//! a node is completed by the one invocation that arrives second, and what it leaves there is read by whoever arrives second above it, after an
//! acquiring arrival. So what a climb hands on goes through atomics.

use crate::mem::AtomicU32;
use crate::node::{Links, NO_NODE};

/// Climbs from leaf `i` of a tree over `references` references and calls `complete(p, left, right)` at each node `p` that is completed by this
/// invocation. `arrivals[n-1]` starts as 0 and ends as 2 everywhere if the links are a tree.
#[inline(always)]
pub fn climb<L: Links + ?Sized>(
    i: u32,
    references: u32,
    nodes: &L,
    arrivals: &[AtomicU32],
    complete: impl Fn(u32, u32, u32),
) {
    let mut v = references - 1 + i;
    for _ in 0..references {
        let p = nodes.parent(v);
        if p == NO_NODE || arrivals[p as usize].arrive() == 0 {
            break;
        }
        let left = nodes.down(p);
        complete(p, left, nodes.up(left));
        v = p;
    }
}

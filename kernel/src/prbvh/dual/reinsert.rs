//! Reinsertion of both children: owners of their locks change the tree.
//!
//! Kind: scatter, as [`crate::prbvh::reinsert`]: the children links of a node are touched only by the reinsertion that owns the node. Reads
//! `found` and `seconds`; reads and writes the links of `nodes[2n-1]`; boxes are stale until the next refit.

use super::{DualMove, is_move};
use crate::mem::AtomicU32;
use crate::node::{AtomicNode, Links};
use crate::prbvh::reinsert::{insert, replace};
use crate::prbvh::{PrbvhParams, Reinsertion};
use crate::status::APPLIED;

/// Invocation `i` dissolves input node `params.input(i)`, if it kept its locks.
#[inline(always)]
pub fn reinsert(
    i: u32,
    params: &PrbvhParams,
    found: &[Reinsertion],
    seconds: &[u32],
    nodes: &[AtomicNode],
    report: &[AtomicU32],
) {
    let found = found[i as usize];
    if is_move(found) {
        let input = params.input(i);
        let dual = DualMove::new(nodes, input, found, seconds[i as usize]);
        let parent = nodes.parent(input);
        replace(parent, nodes.sibling(input), nodes);
        insert(dual.first, dual.first_output, parent, nodes);
        // The second output may be the node that was inserted just now.
        insert(dual.second, dual.second_output, input, nodes);
        report[APPLIED].add(1);
    }
}

//! LBVH: the binary radix tree of sorted Morton codes.
//!
//! Source: Karras 2012, §4 and figure 4. Kind: scatter: each word of a node is written by one invocation, since a node has one
//! parent. Leaf `k` of the sorted order is node `n-1+k`; internal node `i` covers a range that starts or ends at leaf `i`.

use crate::aabb::Aabb;
use crate::node::{AtomicNode, NO_NODE, RIGHT, ROOT};
use bytemuck::{Pod, Zeroable};

/// Push constants of [`leaves`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct LeavesParams {
    /// Invocations: one per reference, `n`.
    pub count: u32,
}

/// Invocation `i` fills box and reference of leaf `i`. Reads `order[n]`, `boxes[n]`; writes `nodes[n-1..2n-1]`, all but `up`.
#[inline(always)]
pub fn leaves(i: u32, params: &LeavesParams, order: &[u32], boxes: &[Aabb], nodes: &[AtomicNode]) {
    let reference = order[i as usize];
    let v = params.count - 1 + i;
    let node = &nodes[v as usize];
    node.set_aabb(boxes[reference as usize]);
    node.set_down(reference);
    if v == ROOT {
        node.set_up(NO_NODE);
    }
}

/// Push constants of [`hierarchy`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct HierarchyParams {
    /// Invocations: one per internal node, `n-1`.
    pub count: u32,
}

/// Length of the common prefix of the codes of leaves `i` and `j`; -1 outside the range. Equal codes go on with the bits of
/// the positions, which makes them a balanced tree.
#[inline(always)]
fn common_prefix(high: &[u32], low: &[u32], i: i32, j: i32, n: i32) -> i32 {
    if j < 0 || j >= n {
        return -1;
    }
    let high = high[i as usize] ^ high[j as usize];
    if high != 0 {
        return high.leading_zeros() as i32;
    }
    let low = low[i as usize] ^ low[j as usize];
    if low != 0 {
        return 32 + low.leading_zeros() as i32;
    }
    64 + ((i ^ j) as u32).leading_zeros() as i32
}

/// Invocation `i` finds the two children of internal node `i`. Reads the sorted codes `high[n]` and `low[n]` (the same
/// buffer twice where a code has one word); writes `down` of node `i` and `up` of its children, and of the root.
#[inline(always)]
pub fn hierarchy(i: u32, params: &HierarchyParams, high: &[u32], low: &[u32], nodes: &[AtomicNode]) {
    let n = params.count as i32 + 1;
    let at = i as i32;
    let prefix = |j: i32| common_prefix(high, low, at, j, n);

    let direction = if prefix(at + 1) > prefix(at - 1) { 1 } else { -1 };
    let outside = prefix(at - direction);

    // The other end of the range: doubling, then bisection. 31 doublings cover every range.
    let mut reach = 2;
    for _ in 0..30 {
        if prefix(at + reach * direction) <= outside {
            break;
        }
        reach *= 2;
    }
    let mut length = 0;
    let mut step = reach / 2;
    for _ in 0..31 {
        if step == 0 {
            break;
        }
        if prefix(at + (length + step) * direction) > outside {
            length += step;
        }
        step /= 2;
    }
    let end = at + length * direction;

    // The split: the last leaf whose prefix with `i` is longer than the range's.
    let inside = prefix(end);
    let mut split = 0;
    let mut step = length;
    for _ in 0..32 {
        step = (step + 1) / 2;
        if prefix(at + (split + step) * direction) > inside {
            split += step;
        }
        if step <= 1 {
            break;
        }
    }
    let split = at + split * direction + if direction < 0 { -1 } else { 0 };

    let (first, last) = if direction > 0 { (at, end) } else { (end, at) };
    let leaf = |k: i32| params.count + k as u32;
    let left = if first == split { leaf(split) } else { split as u32 };
    let right = if last == split + 1 { leaf(split + 1) } else { (split + 1) as u32 };

    nodes[i as usize].set_down(left);
    nodes[left as usize].set_up(right);
    nodes[right as usize].set_up(i | RIGHT);
    if i == ROOT {
        nodes[i as usize].set_up(NO_NODE);
    }
}

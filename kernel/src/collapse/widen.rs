//! Nodes of four or eight children: what each subtree costs at least as a forest of few roots, bottom-up.
//!
//! Source: Ylitie, Karras & Laine 2017, §3.1. Equation (1) is [`Forest::at_most`], (2) the leaf, (3) the node and (4) the two forests side by side of which
//! either is made: [`join`]. Kind: [`climb`](mod@crate::climb). Costs are those of f32 in one fixed order, so that every device decides alike. Only internal nodes have
//! words, as many as the width: a leaf's costs are known from its box and its triangles.

use super::area::{area_scale, relative_area};
use crate::climb::climb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{Node, ROOT};
use bytemuck::{Pod, Zeroable};

/// Most children of a node.
pub const MOST_CHILDREN: u32 = 8;
/// Most roots of a forest whose cost is asked for.
pub const MOST_ROOTS: usize = MOST_CHILDREN as usize - 1;

/// In a choice: of all ways to be a single root, a leaf costs least.
pub const IS_LEAF: u32 = 1 << 30;
/// In a choice: a leaf costs no more than children, as which the root counts that is a node in any case.
pub const IS_LEAF_AT_ROOT: u32 = 1 << 31;
/// Bits of a number of roots in a choice.
const ROOTS_BITS: u32 = 3;

/// More than what any subtree costs.
const TOO_MUCH: f32 = f32::MAX;

/// Push constants of [`widen`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct WidenParams {
    /// Invocations: one per leaf, `n`.
    pub count: u32,
    /// Most children of a node, 2 to [`MOST_CHILDREN`].
    pub width: u32,
    /// Cost of a step through a node.
    pub c_traversal: f32,
    /// Cost of a test against a triangle.
    pub c_intersect: f32,
    /// Most triangles of a leaf.
    pub max_leaf: u32,
}

/// A subtree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forest {
    /// What it costs at least as a forest of at most `i` roots, at `i - 1`, for `i` below the width; in units of [`relative_area`].
    pub at_most: [f32; MOST_ROOTS],
    /// Its triangles.
    pub triangles: u32,
}

impl Forest {
    /// A leaf of the binary tree, which is never taken apart.
    #[inline(always)]
    #[must_use]
    pub fn leaf(params: &WidenParams, area: f32, triangles: u32) -> Self {
        Self { at_most: [params.c_intersect * area * triangles as f32; MOST_ROOTS], triangles }
    }
}

/// The node above two subtrees, of this relative area, and its choice.
///
/// The choice has the roots that the left one gets in a forest of `i` roots, from 2 to the width less 1, in bits `3(i-1)` and on; 0: a forest of one root less costs no more. In
/// bits 0 to 2 are the left one's among the children of a node. See [`left_roots`], [`IS_LEAF`] and [`IS_LEAF_AT_ROOT`].
#[inline(always)]
#[must_use]
pub fn join(params: &WidenParams, area: f32, left: &Forest, right: &Forest) -> (Forest, u32) {
    let triangles = left.triangles + right.triangles;
    let leaf = if triangles <= params.max_leaf { params.c_intersect * area * triangles as f32 } else { TOO_MUCH };
    let (opened, mut choice) = side_by_side(left, right, params.width);
    let node = params.c_traversal * area + opened;
    if leaf <= node {
        choice |= IS_LEAF;
    }
    if leaf <= opened {
        choice |= IS_LEAF_AT_ROOT;
    }
    let mut least = if leaf <= node { leaf } else { node };
    let mut at_most = [least; MOST_ROOTS];
    for roots in 2..params.width {
        let (cost, left_roots) = side_by_side(left, right, roots);
        if cost < least {
            least = cost;
            choice |= left_roots << (ROOTS_BITS * (roots - 1));
        }
        at_most[roots as usize - 1] = least;
    }
    (Forest { at_most, triangles }, choice)
}

/// The least cost of two forests of `roots` roots together, and how many of them are the left one's.
#[inline(always)]
fn side_by_side(left: &Forest, right: &Forest, roots: u32) -> (f32, u32) {
    let mut best = TOO_MUCH;
    let mut best_left = 1;
    for left_roots in 1..roots {
        let cost = left.at_most[left_roots as usize - 1] + right.at_most[(roots - left_roots) as usize - 1];
        if cost < best {
            best = cost;
            best_left = left_roots;
        }
    }
    (best, best_left)
}

/// Roots of the left subtree in a forest of `roots` roots by a choice of [`join`]; of 1 root: among the children of the node. 0: as with a root less.
#[inline(always)]
#[must_use]
pub fn left_roots(choice: u32, roots: u32) -> u32 {
    (choice >> (ROOTS_BITS * (roots - 1))) & ((1 << ROOTS_BITS) - 1)
}

/// Invocation `i` climbs from leaf `i`. Reads `nodes[2n-1]`, whose boxes are right and whose leaves have their number of triangles in `down`; writes the costs and
/// the triangles of internal nodes to `forests`, `width` words each, their choices to `choices[n-1]`, and `arrivals[n-1]`, which starts as 0.
#[inline(always)]
pub fn widen(
    i: u32,
    params: &WidenParams,
    nodes: &[Node],
    forests: &[AtomicU32],
    choices: &[Slot<u32>],
    arrivals: &[AtomicU32],
) {
    let params = *params;
    let scale = area_scale(nodes[ROOT as usize].aabb().half_area());
    climb(i, params.count, nodes, arrivals, move |p, left, right| {
        let left = forest(left, &params, nodes, forests, scale);
        let right = forest(right, &params, nodes, forests, scale);
        let (joined, choice) = join(&params, relative_area(&nodes[p as usize], scale), &left, &right);
        let first = p * params.width;
        for k in 0..params.width - 1 {
            forests[(first + k) as usize].store_f32(joined.at_most[k as usize]);
        }
        forests[(first + params.width - 1) as usize].store(joined.triangles);
        choices[p as usize].set(choice);
    });
}

/// The subtree at `v`, which is done.
#[inline(always)]
fn forest(v: u32, params: &WidenParams, nodes: &[Node], forests: &[AtomicU32], scale: f32) -> Forest {
    if v >= params.count - 1 {
        let node = nodes[v as usize];
        return Forest::leaf(params, relative_area(&node, scale), node.down);
    }
    let first = v * params.width;
    let mut at_most = [0.0; MOST_ROOTS];
    for k in 0..params.width - 1 {
        at_most[k as usize] = forests[(first + k) as usize].load_f32();
    }
    Forest { at_most, triangles: forests[(first + params.width - 1) as usize].load() }
}

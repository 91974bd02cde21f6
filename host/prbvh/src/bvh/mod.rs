//! The tree handed out: decoding, validation, refit, quality, depth, hash and file.
//!
//! | step | function |
//! |---|---|
//! | nodes of a device → tree | [`Bvh::from_device`] |
//! | tree → nodes of a device | [`Bvh::to_device`] |
//! | boxes of the original triangles | [`Bvh::with_boxes_of`] |
//! | is it right? | [`validate`]; with spatial splits [`validate_tree`], [`validate_references`] |
//! | is it good? | [`quality()`], [`epo()`] |
//! | is it too deep? | [`bound_depth`] |
//! | is it the same? | [`tree_hash`] |
//! | keep it | [`file::write`], [`file::read`] |
//! | arrays of 32-byte nodes | [`FlatTree`], [`Bvh::from_flat`] |
//!
//! All walks use a stack of their own on the heap: a tree may be as deep as it has triangles.

mod clip;
mod decode;
mod depth;
mod encode;
#[cfg(feature = "files")]
pub(crate) mod envelope;
mod epo;
mod fault;
#[cfg(feature = "files")]
pub mod file;
#[cfg(feature = "files")]
mod file_error;
mod hash;
mod layout;
mod merge;
#[cfg(feature = "files")]
mod parse;
mod quality;
mod references;
mod refit;
#[cfg(test)]
pub(crate) mod testing;
mod validate;

pub(crate) use decode::Decoder;
pub use depth::{DepthBound, MaxDepth, NoMaxDepth, SAH_BUDGET, TooShallow, bound_depth};
pub use encode::EncodeError;
pub use epo::{Epo, EpoProgress, epo, epo_budget, epo_watched};
pub use fault::{Link, TreeFault, summary};
pub use hash::{topology_hash, tree_hash};
pub use layout::{FlatNode, FlatTree};
pub(crate) use merge::{merge_siblings, without_repeats};
pub(crate) use quality::half_area;
pub use quality::{Quality, SahModel, quality};
pub(crate) use references::{pieces, reference_faults};
pub use references::{validate_references, validate_tree};
pub use validate::{TreeStats, links_and_leaves, validate};

use prbvh_kernel::aabb::Aabb;
pub use prbvh_kernel::node::{NO_NODE, ROOT};

/// A bounding volume hierarchy over triangles. Node [`ROOT`] is the root.
///
/// The fields are open: whoever changes them asks [`validate`] whether the result is still a tree. The other functions of this
/// module take a tree that is, and panic (but always end) on links that are not.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    /// Nodes, in any order but for the root.
    pub nodes: Vec<BvhNode>,
    /// Triangle ids; a leaf holds a range of them. `[n]` for `n` triangles.
    pub triangle_order: Vec<u32>,
}

/// A node of a [`Bvh`], 40 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhNode {
    /// Smallest box around what lies below, scene units.
    pub aabb: Aabb,
    /// Parent; [`NO_NODE`] of the root.
    pub parent: u32,
    /// Children or triangles.
    pub content: Content,
}

/// What a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Two nodes.
    Internal {
        /// Left child.
        left: u32,
        /// Right child.
        right: u32,
    },
    /// Triangles `triangle_order[first..first + count]`, at least one.
    Leaf {
        /// First position in [`Bvh::triangle_order`].
        first: u32,
        /// Triangles.
        count: u32,
    },
}

impl Bvh {
    /// Nodes in depth-first order, left before right, each before its children: the same for every numbering of one tree.
    pub(crate) fn preorder(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut stack = vec![ROOT];
        while let Some(v) = stack.pop() {
            assert!(order.len() < self.nodes.len(), "the links are no tree");
            order.push(v);
            if let Content::Internal { left, right } = self.nodes[v as usize].content {
                stack.push(right);
                stack.push(left);
            }
        }
        order
    }

    /// Triangle ids of a leaf.
    fn triangles_of(&self, first: u32, count: u32) -> &[u32] {
        &self.triangle_order[first as usize..][..count as usize]
    }
}

/// The box with -0.0 turned into +0.0.
///
/// Which of two equal zeros `min` and `max` return depends on the order of their arguments, and so on which child is the left one.
/// The sign says nothing about the box; without it equal boxes have equal bits.
fn without_negative_zeros(aabb: Aabb) -> Aabb {
    Aabb { min: aabb.min.map(|x| x + 0.0), max: aabb.max.map(|x| x + 0.0) }
}

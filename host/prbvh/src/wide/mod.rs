//! Wide trees: nodes of up to four or eight children, made of a binary tree.
//!
//! | step | function |
//! |---|---|
//! | binary tree → wide tree of least cost, or a greedy one | [`collapse`], [`collapse_on`] |
//! | is it right? | [`validate`] |
//! | is it good? | [`quality`] |
//! | nodes as a traversal reads them, and back | [`PackedTree`] |
//! | keep it | `wide::file` |
//! | rays through it | [`TraceScene::of_wide`](crate::trace::TraceScene::of_wide) |
//!
//! `docs/wide.md` has the sources, the layouts, and when which of them pays. All walks use a stack on the heap: a tree may be as deep as it has triangles.

mod cwbvh;
mod emit;
mod fault;
#[cfg(feature = "files")]
pub mod file;
mod greedy;
mod layout;
mod limit;
mod moves;
mod octants;
mod optimal;
mod packed;
mod quality;
mod quantize;
mod settings;
mod soa;
mod validate;
mod weight;
mod width;

pub use fault::WideFault;
pub use layout::Layout;
pub use packed::{NotPacked, PackedNodes, PackedTree};
pub use quality::{WideQuality, quality};
pub use settings::{CollapseMethod, WideSettings};
pub use validate::{summary, validate};
pub use width::Width;

use crate::bvh::Bvh;
use crate::check::SettingError;
use crate::collapse::CollapseError;
use crate::device::{Device, DeviceError, Timing, on_host};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use std::borrow::Cow;

/// Slots of a node, the most of any width.
pub const SLOTS: usize = 8;

/// A tree whose nodes have up to [`Width`] children. Node 0 is the root.
///
/// The fields are open, as those of [`Bvh`] are: whoever changes them asks [`validate`]. The other functions take a tree that is one, and panic (but
/// always end) on links that are not.
#[derive(Clone, Debug, PartialEq)]
pub struct WideBvh {
    /// Most children of a node.
    pub width: Width,
    /// Nodes, in any order but for the root.
    pub nodes: Vec<WideNode>,
    /// Triangle ids; a leaf holds a range of them.
    pub triangle_order: Vec<u32>,
}

/// A node of a [`WideBvh`]; slots from the width on are empty.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WideNode {
    /// Its children, in slots that may be empty in between.
    pub slots: [Option<WideChild>; SLOTS],
}

/// What is in a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WideChild {
    /// A box around what lies below, scene units.
    pub aabb: Aabb,
    /// A node or triangles.
    pub content: WideContent,
}

/// What a child is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WideContent {
    /// A node.
    Node(u32),
    /// Triangles `triangle_order[first..first + count]`, at least one.
    Leaf {
        /// First position in [`WideBvh::triangle_order`].
        first: u32,
        /// Triangles.
        count: u32,
    },
}

impl WideNode {
    /// The children that there are.
    pub fn children(&self) -> impl DoubleEndedIterator<Item = &WideChild> {
        self.slots.iter().flatten()
    }

    /// The smallest box around all children.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.children().fold(Aabb::EMPTY, |aabb, child| aabb.union(child.aabb))
    }
}

impl WideBvh {
    /// Nodes, each before its children.
    fn preorder(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut stack = vec![0];
        while let Some(v) = stack.pop() {
            assert!(order.len() < self.nodes.len(), "the links are no tree");
            order.push(v);
            stack.extend(self.nodes[v as usize].children().rev().filter_map(|child| match child.content {
                WideContent::Node(node) => Some(node),
                WideContent::Leaf { .. } => None,
            }));
        }
        order
    }

    /// The same tree with every box computed anew from `triangles`, bottom-up.
    ///
    /// # Panics
    /// If the links are no tree or a triangle id is not below `triangles.len()`.
    #[must_use]
    pub fn with_boxes_of(mut self, triangles: &[Triangle]) -> Self {
        for v in self.preorder().into_iter().rev() {
            let mut node = self.nodes[v as usize];
            for child in node.slots.iter_mut().flatten() {
                child.aabb = match child.content {
                    WideContent::Node(below) => self.nodes[below as usize].aabb(),
                    WideContent::Leaf { first, count } => {
                        let ids = &self.triangle_order[first as usize..][..count as usize];
                        let boxes = ids.iter().map(|&id| triangles[id as usize].aabb());
                        without_negative_zeros(boxes.fold(Aabb::EMPTY, Aabb::union))
                    }
                };
            }
            self.nodes[v as usize] = node;
        }
        self
    }
}

/// Equal boxes have equal bits.
fn without_negative_zeros(aabb: Aabb) -> Aabb {
    Aabb { min: aabb.min.map(|x| x + 0.0), max: aabb.max.map(|x| x + 0.0) }
}

/// Makes a wide tree of a binary one, whose leaves are never taken apart unless they are larger than allowed.
///
/// Leaves of several triangles are made where that costs least. A leaf of more triangles than [`WideSettings::most_of_a_leaf`] becomes several, each with
/// the box of the whole. Boxes of nodes are the unions of what lies below.
///
/// # Errors
/// If a setting makes no sense.
///
/// # Panics
/// If the links of `tree` are no tree.
pub fn collapse(tree: &Bvh, settings: &WideSettings) -> Result<WideBvh, SettingError> {
    settings.check()?;
    let tree = prepared(tree, settings);
    let fates = match settings.method {
        CollapseMethod::Optimal => optimal::fates(&tree, settings),
        CollapseMethod::Greedy => greedy::fates(&tree, settings),
    };
    Ok(emit::emit(&tree, settings.width, &fates))
}

/// The binary tree that is collapsed.
fn prepared<'a>(tree: &'a Bvh, settings: &WideSettings) -> Cow<'a, Bvh> {
    let tree = limit::within(tree, settings.most_of_a_leaf());
    if settings.reach == 0 { tree } else { Cow::Owned(moves::moved(&tree, settings)) }
}

/// [`collapse`] whose costs a device computes, and the times of its commands: the same tree. The device holds 64 bytes and as many words as the width for each leaf of `tree`, and 8 bytes
/// more. A greedy collapse needs no device.
///
/// # Errors
/// If a setting makes no sense, the links of `tree` are no tree, or the device fails.
pub fn collapse_on(
    device: &mut dyn Device,
    tree: &Bvh,
    settings: &WideSettings,
) -> Result<(WideBvh, Vec<Timing>), CollapseError> {
    if settings.method == CollapseMethod::Greedy {
        return Ok((collapse(tree, settings)?, Vec::new()));
    }
    settings.check()?;
    optimal::checked_walk(device, tree)?;
    let tree = on_host(device, || prepared(tree, settings));
    let (fates, timings) = optimal::fates_on(device, &tree, settings)?;
    Ok((emit::emit(&tree, settings.width, &fates), timings))
}

/// Allocates what [`collapse_on`] takes for a tree of so many leaves at most, and gives it back: for plans.
pub(crate) fn reserve(device: &mut dyn Device, leaves: usize, settings: &WideSettings) -> Result<(), DeviceError> {
    optimal::reserve(device, leaves, settings)
}

#[cfg(test)]
mod tests;

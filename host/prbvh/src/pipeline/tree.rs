//! A tree that the caller has, made better in place.

use super::{Initial, PipelineError, SettingError, Settings, optimize};
use crate::bvh::{self, Bvh, Content, DepthBound, Quality, SahModel};
use crate::collapse::CollapseSettings;
use crate::device::{Device, on_host};
use crate::optimize::{IterationRow, Outcome};
use crate::references::References;
use crate::scene::{Aabb, Scene};
use std::ops::ControlFlow;

/// What is done with the leaves of a tree that is optimised.
#[derive(Clone, Copy, Debug, Default)]
pub enum Leaves<'a> {
    /// They stay what they are, with the boxes and the primitives they have, and move as a whole. This needs to know nothing of the primitives, and is right
    /// for any tree, also where a primitive is in several leaves (spatial splits).
    #[default]
    Whole,
    /// Each primitive of a leaf gets a leaf of its own, here with the boxes of the primitives by their numbers. Afterwards leaves of several are made again
    /// where that costs least, by [`Settings::adaptive`], or without it by the usual costs and with leaves as large as the largest of the tree. Of a
    /// primitive that is in several leaves each piece, its box cut to that of the leaf, stays by itself.
    Split(&'a [Aabb]),
}

/// What became of a tree.
#[derive(Clone, Debug)]
pub struct OptimizedTree {
    /// Quality of the tree as it was, in f64.
    pub initial: Quality,
    /// Quality of the tree as it is now, in f64.
    pub quality: Quality,
    /// What the bound on the depth changed; none where the tree was within it.
    pub bound: Option<DepthBound>,
    /// Iterations and times of the optimiser. The costs in its rows are those with a whole leaf, or a single primitive, in each leaf.
    pub outcome: Outcome,
}

/// Optimises a tree in place: any binary tree with leaves of any size, over triangles or boxes of any scale.
///
/// The tree ends with a SAH cost (of [`SahModel::default`]) that is no higher than before, unless it was deeper than [`Settings::max_depth`]; if nothing better
/// is found it stays as it was. Every box that a leaf had around a primitive is covered afterwards: a ray meets what it met. Boxes of internal nodes
/// are made anew, and need not be right before. After an error the tree is as it was.
///
/// Of the settings [`Settings::initial`], [`Settings::morton_bits`], [`Settings::fold_duplicates`] and [`Settings::wide`] are not looked at. Whoever has a [`Scene`] and wants a
/// report of all stages calls [`optimize`] with [`Initial::Tree`].
///
/// # Errors
/// [`PipelineError::GivenTree`] if it is no tree, a leaf's box is not finite or inverted, or the leaves do not cover the primitives; else as [`optimize`].
pub fn optimize_tree(
    tree: &mut Bvh,
    leaves: Leaves<'_>,
    device: &mut dyn Device,
    settings: &Settings,
    observe: &mut dyn FnMut(&IterationRow) -> ControlFlow<()>,
) -> Result<OptimizedTree, PipelineError> {
    let adaptive = match leaves {
        Leaves::Whole if settings.adaptive.is_some() => {
            let need = "none where leaves stay whole";
            return Err(SettingError { name: "adaptive", value: "given".to_owned(), need }.into());
        }
        Leaves::Whole => None,
        Leaves::Split(_) => {
            let max_leaf = largest_leaf(tree);
            Some(
                settings
                    .adaptive
                    .unwrap_or(CollapseSettings { max_leaf: Some(max_leaf), ..CollapseSettings::default() }),
            )
        }
    };
    let references = match leaves {
        Leaves::Whole => References::leaves(tree),
        Leaves::Split(boxes) => References::split(tree, boxes),
    };
    let references = references.map_err(|faults| PipelineError::GivenTree { faults })?;
    let scene = on_host(device, || Scene::from_boxes("tree", &references.boxes))?;
    let initial = Initial::from(references.tree.clone());
    let settings = Settings { initial, adaptive, fold_duplicates: false, wide: None, ..settings.clone() };
    let done = optimize(&scene, device, &settings, observe)?;

    let sah = SahModel::default();
    let given = tree.clone().with_boxes_of_leaves();
    let optimized = references.given_back(done.tree);
    let (initial, quality) = (bvh::quality(&given, &sah), bvh::quality(&optimized, &sah));
    if quality.sah_cost >= initial.sah_cost && settings.max_depth.allows(initial.max_depth) {
        return Ok(OptimizedTree { initial, quality: initial, bound: None, outcome: done.outcome });
    }
    *tree = optimized;
    Ok(OptimizedTree { initial, quality, bound: done.bound, outcome: done.outcome })
}

/// Primitives of the largest leaf; 1 where there is none.
fn largest_leaf(tree: &Bvh) -> u32 {
    let sizes = tree.nodes.iter().map(|node| match node.content {
        Content::Leaf { count, .. } => count,
        Content::Internal { .. } => 1,
    });
    sizes.fold(1, u32::max)
}

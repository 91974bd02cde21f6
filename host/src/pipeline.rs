//! From a scene to its best tree: safe range, initial tree, PRBVH, adaptive leaves, original boxes, validation.

use crate::build::{self, DeviceTree, MortonBits};
use crate::bvh::{self, Bvh, Quality, SahModel, TreeFault};
use crate::collapse::{CollapseError, CollapseSettings, collapse};
use crate::device::{Device, DeviceError, DeviceInfo, Timing};
use crate::optimize::{IterationRow, Outcome, PrbvhSettings, prbvh};
use crate::scene::{SafeRange, Scene};
use serde::Serialize;
use std::ops::ControlFlow;
use std::time::Instant;

/// Builder of the initial tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Initial {
    /// LBVH (Karras 2012).
    #[default]
    Lbvh,
}

/// When a reinsertion may run beside others (Meister & Bittner 2018, §4.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Locks the nodes whose links change.
    #[default]
    Aggressive,
}

/// Settings of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Settings {
    /// Builder of the initial tree.
    pub initial: Initial,
    /// Length of the Morton codes.
    pub morton_bits: MortonBits,
    /// Locking strategy.
    pub strategy: Strategy,
    /// The optimiser.
    pub prbvh: PrbvhSettings,
    /// Adaptive leaves after the optimisation; none: one triangle per leaf.
    pub adaptive: Option<CollapseSettings>,
}

/// A better tree, and how it came about.
#[derive(Clone, Debug)]
pub struct Optimized {
    /// The best tree, with adaptive leaves where they were asked for; its boxes are those of the scene's triangles.
    pub tree: Bvh,
    /// Quality of the initial tree, in f64.
    pub initial: Quality,
    /// Quality of the best tree with one triangle per leaf, which is what was optimised, in f64.
    pub quality: Quality,
    /// Quality of the best tree with adaptive leaves by the costs that made them, in f64.
    pub adaptive: Option<Quality>,
    /// Iterations and times of the optimiser.
    pub outcome: Outcome,
    /// Wall time of the initial tree, upload included, seconds.
    pub build_s: f64,
    /// Times of the initial tree's stages.
    pub build_timings: Vec<Timing>,
    /// Wall time of the optimiser, seconds.
    pub optimize_s: f64,
    /// Times of the collapse.
    pub collapse_timings: Vec<Timing>,
}

/// Why there is no tree.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// The device refused or failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// No leaf could be made of a subtree.
    #[error(transparent)]
    Collapse(#[from] CollapseError),
    /// What came back from the device is no tree over the triangles.
    #[error("the {stage} on {device} made an invalid tree: {}", bvh::summary(.faults))]
    InvalidTree {
        /// Which stage.
        stage: &'static str,
        /// On which device.
        device: String,
        /// All faults.
        faults: Vec<TreeFault>,
    },
}

/// Builds a tree over the scene's triangles and optimises it. `observe` sees each iteration, the initial tree as row 0, and may break:
/// then the best tree so far is returned.
///
/// # Errors
/// If the scene does not fit the device, the device fails, or a tree is invalid.
pub fn optimize(
    scene: &Scene,
    device: &mut dyn Device,
    settings: &Settings,
    observe: &mut dyn FnMut(&IterationRow) -> ControlFlow<()>,
) -> Result<Optimized, PipelineError> {
    build::check_limits(device.info(), scene.triangles.len())?;
    let range = SafeRange::of(&scene.triangles);
    let working = range.apply(&scene.triangles);

    let start = Instant::now();
    let (tree, build_timings) = match settings.initial {
        Initial::Lbvh => build::lbvh(device, &working, settings.morton_bits)?,
    };
    let build_s = start.elapsed().as_secs_f64();
    drop(working);
    let (_, initial) = hand_out(&tree, scene, device, "builder")?;

    let start = Instant::now();
    let outcome = prbvh(device, &tree, &settings.prbvh, &mut |row, _, _| observe(row))?;
    let optimize_s = start.elapsed().as_secs_f64();
    let (mut best, quality) = hand_out(&tree, scene, device, "optimiser")?;
    let mut adaptive = None;
    let mut collapse_timings = Vec::new();
    if let Some(settings) = &settings.adaptive {
        let (collapsed, measured, timings) = hand_out_collapsed(&tree, scene, device, settings)?;
        best = collapsed;
        adaptive = Some(measured);
        collapse_timings = timings;
    }
    tree.free(device);
    Ok(Optimized {
        tree: best,
        initial,
        quality,
        adaptive,
        outcome,
        build_s,
        build_timings,
        optimize_s,
        collapse_timings,
    })
}

/// The device's tree with adaptive leaves, validated.
fn hand_out_collapsed(
    tree: &DeviceTree,
    scene: &Scene,
    device: &mut dyn Device,
    settings: &CollapseSettings,
) -> Result<(Bvh, Quality, Vec<Timing>), PipelineError> {
    let mut collapsed = collapse(device, tree, settings)?;
    let timings = std::mem::take(&mut collapsed.timings);
    let tree = collapsed.free(device).with_boxes_of(&scene.triangles);
    let invalid = |faults| PipelineError::InvalidTree { stage: "collapse", device: device.info().name.clone(), faults };
    bvh::validate(&tree, Some(&scene.triangles)).map_err(invalid)?;
    let quality = bvh::quality(&tree, &settings.sah);
    Ok((tree, quality, timings))
}

/// The device's tree with the boxes of the original triangles, validated.
fn hand_out(
    tree: &DeviceTree,
    scene: &Scene,
    device: &mut dyn Device,
    stage: &'static str,
) -> Result<(Bvh, Quality), PipelineError> {
    let nodes = tree.download(device)?;
    let invalid = |faults| PipelineError::InvalidTree { stage, device: device.info().name.clone(), faults };
    let tree = Bvh::from_device(&nodes).map_err(invalid)?.with_boxes_of(&scene.triangles);
    bvh::validate(&tree, Some(&scene.triangles)).map_err(invalid)?;
    let quality = bvh::quality(&tree, &SahModel::default());
    Ok((tree, quality))
}

/// What the run leaves out because scene, device or settings do not need it, a line each.
#[must_use]
pub fn plan(scene: &Scene, device: &DeviceInfo, settings: &Settings) -> Vec<String> {
    let n = scene.triangles.len() as u64;
    let mut lines = Vec::new();
    if device.atomics_64 {
        lines.push("locks of two 32-bit words and their extra dispatch: the device has 64-bit atomics".to_owned());
    }
    if settings.strategy == Strategy::Aggressive {
        lines.push(format!("path bitset of the conservative strategy: {} bytes", 16 * (2 * n - 1)));
    }
    if settings.morton_bits == MortonBits::Thirty {
        lines.push(format!("lower words of the Morton codes: one sort and {} bytes", 8 * n));
    }
    lines.push("normals, texture coordinates, materials: only positions are read".to_owned());
    lines
}

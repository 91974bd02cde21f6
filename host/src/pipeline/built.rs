//! The initial tree alone.

use super::{Optimizer, PipelineError, Settings, hand_out, initial_tree};
use crate::bvh::{Bvh, Quality};
use crate::device::{Device, Timing, on_host};
use crate::plan::Plan;
use crate::scene::{SafeRange, Scene};
use std::time::Instant;

/// An initial tree.
#[derive(Clone, Debug)]
pub struct Built {
    /// The tree; its boxes are those of the scene's triangles.
    pub tree: Bvh,
    /// Its quality, in f64.
    pub quality: Quality,
    /// Wall time, upload included, seconds.
    pub build_s: f64,
    /// Times of its stages.
    pub timings: Vec<Timing>,
}

/// Builds the initial tree alone.
///
/// # Errors
/// As [`optimize`].
pub fn build_initial(scene: &Scene, device: &mut dyn Device, settings: &Settings) -> Result<Built, PipelineError> {
    settings.initial.check()?;
    // The initial tree alone is checked and made.
    let settings = Settings { optimizer: Optimizer::None, adaptive: None, ..settings.clone() };
    let plan = Plan::of(scene, device.info(), &settings, &[])?;
    plan.check(device.info())?;
    let working = on_host(device, || SafeRange::of(&scene.triangles).apply(&scene.triangles));
    let start = Instant::now();
    let (tree, timings) = initial_tree(scene, &working, device, (&settings.initial, plan.codes))?;
    let build_s = start.elapsed().as_secs_f64();
    let (handed_out, quality) = hand_out((&tree, None), scene, device, "builder")?;
    tree.free(device);
    Ok(Built { tree: handed_out, quality, build_s, timings })
}

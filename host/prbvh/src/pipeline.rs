//! From a scene to its best tree: safe range, initial tree, optimiser, original boxes, validation, bound on the depth, adaptive leaves.

mod hand_out;
mod initial;
mod on_host;

pub use crate::settings::{FeatureOff, Initial, Optimizer, Settings};
use hand_out::{bounded, hand_out, hand_out_collapsed, upload_whole};
use initial::initial_tree;

#[cfg(feature = "files")]
use crate::build::TreeOfFileError;
use crate::bvh::{self, Bvh, DepthBound, EncodeError, Quality, SahModel, TooShallow, TreeFault};
use crate::collapse::{CollapseError, check_settings};
use crate::device::{Device, DeviceError, Lease, Timing, Watched, on_host};
use crate::fold::{unfold_rows, unfolded_row};
use crate::optimize::{CurrentTree, IterationRow, Outcome, measure, prbvh_from};
use crate::plan::{Plan, PlanMismatch};
use crate::scene::{SafeRange, Scene};
use prbvh_kernel::Kernel;
use prbvh_kernel::setup::Triangle;
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// A better tree, and how it came about.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Optimized {
    /// The best tree, with adaptive leaves where they were asked for; its boxes are those of the scene's triangles.
    pub tree: Bvh,
    /// Quality of the initial tree, in f64.
    pub initial: Quality,
    /// Quality of the best tree with one triangle per leaf, which is what was optimised, its depth bounded, in f64.
    pub quality: Quality,
    /// What the bound on the depth changed; none where the tree was within it.
    pub bound: Option<DepthBound>,
    /// Quality of the best tree with adaptive leaves by the costs that made them, in f64.
    pub adaptive: Option<Quality>,
    /// Iterations and times of the optimiser.
    pub outcome: Outcome,
    /// Wall time of the initial tree, upload included, seconds.
    pub build_s: f64,
    /// Times of the initial tree's stages.
    pub build_timings: Vec<Timing>,
    /// Wall time of the optimiser and of bounding the depth, seconds.
    pub optimize_s: f64,
    /// Times of the collapse; none if it was left out.
    pub collapse_timings: Vec<Timing>,
    /// What was left out and why.
    pub plan: Plan,
    /// Kernels that ran; [`Plan::unplanned`] has none of them.
    pub ran: BTreeSet<Kernel>,
}

impl Optimized {
    /// SAH cost of the best tree as the optimiser left it, before its depth was bounded, in f64.
    #[must_use]
    pub fn optimized_cost(&self) -> f64 {
        self.bound.map_or(self.quality.sah_cost, |bound| bound.cost_before)
    }
}

/// Why there is no tree.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// The program was built without a method.
    #[error(transparent)]
    FeatureOff(#[from] FeatureOff),
    /// The device refused or failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The file of the initial tree is not fit for it.
    #[cfg(feature = "files")]
    #[error(transparent)]
    InitialTree(#[from] TreeOfFileError),
    /// No leaf could be made of a subtree.
    #[error(transparent)]
    Collapse(#[from] CollapseError),
    /// No tree over so many triangles is within the bound on the depth.
    #[error("max_depth: {0}")]
    MaxDepth(#[from] TooShallow),
    /// An unfolded tree has no form on the device.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The plan is for something else.
    #[error(transparent)]
    Plan(#[from] PlanMismatch),
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
/// If the program lacks a method, the scene does not fit the device, the device fails, or a tree is invalid.
pub fn optimize(
    scene: &Scene,
    device: &mut dyn Device,
    settings: &Settings,
    observe: &mut dyn FnMut(&IterationRow) -> ControlFlow<()>,
) -> Result<Optimized, PipelineError> {
    check(scene, settings)?;
    let plan = Plan::of(scene, device.info(), settings, &[])?;
    optimize_by(plan, scene, device, settings, observe)
}

/// [`optimize`] by a plan that was made for this scene, device and these settings.
///
/// # Errors
/// As [`optimize`].
pub fn optimize_by(
    plan: Plan,
    scene: &Scene,
    device: &mut dyn Device,
    settings: &Settings,
    observe: &mut dyn FnMut(&IterationRow) -> ControlFlow<()>,
) -> Result<Optimized, PipelineError> {
    run(plan, scene, device, settings, false, &mut |row, _| observe(row))
}

/// [`optimize_by`] whose observer sees the tree, too.
///
/// # Errors
/// As [`optimize`].
pub fn optimize_watched(
    plan: Plan,
    scene: &Scene,
    device: &mut dyn Device,
    settings: &Settings,
    observe: &mut dyn FnMut(&IterationRow, CurrentTree<'_>) -> ControlFlow<()>,
) -> Result<Optimized, PipelineError> {
    run(plan, scene, device, settings, true, observe)
}

/// `row_by_row`: the observer wants the tree of each row.
fn run(
    plan: Plan,
    scene: &Scene,
    device: &mut dyn Device,
    settings: &Settings,
    row_by_row: bool,
    observe: &mut dyn FnMut(&IterationRow, CurrentTree<'_>) -> ControlFlow<()>,
) -> Result<Optimized, PipelineError> {
    check(scene, settings)?;
    plan.check_purpose(scene, settings)?;
    plan.check(device.info())?;
    let mut lease = Lease::new(device);
    let device = &mut Watched::new(&mut lease);
    let fold = plan.fold.clone();
    let mut references = working_triangles(scene, device);
    if let Some(fold) = &fold {
        references = fold.references(&references);
    }
    let added = fold.as_ref().map_or(0.0, |fold| fold.added_cost(&scene.triangles, &SahModel::default()));

    let start = Instant::now();
    let (mut tree, mut build_timings) = initial_tree(scene, references, device, (&settings.initial, plan.codes))?;
    let areas = match settings.optimizer {
        Optimizer::Prbvh => {
            let (areas, timings) = measure(device, &tree)?;
            build_timings.extend(timings);
            Some(areas)
        }
        Optimizer::Rbvh(_) | Optimizer::None => None,
    };
    let build_s = start.elapsed().as_secs_f64();
    let (built, initial) = hand_out((&tree, fold.as_deref()), scene, device, "builder")?;
    // Only kept where nothing comes after it.
    let built = matches!(settings.optimizer, Optimizer::None).then_some(built);

    let start = Instant::now();
    let mut observe = |row: &IterationRow, tree: CurrentTree<'_>| observe(&unfolded_row(row, added), tree);
    let below = |target: Option<f64>| target.map(|cost| cost - added);
    let mut outcome = match &settings.optimizer {
        Optimizer::Prbvh => {
            let mut settings = settings.prbvh.clone();
            settings.limits.target_cost = below(settings.limits.target_cost);
            if row_by_row {
                settings.news = Duration::ZERO;
            }
            let last_search = device.last_search();
            prbvh_from(device, &tree, areas, &settings, &mut |row, tree, device| {
                observe(row, CurrentTree::Device(tree, device, last_search.borrow().clone()))
            })?
        }
        Optimizer::Rbvh(settings) => {
            let mut settings = settings.clone();
            settings.limits.target_cost = below(settings.limits.target_cost);
            let (optimized, outcome) = on_host::rbvh(tree, device, &settings, &mut observe)?;
            tree = optimized;
            outcome
        }
        Optimizer::None => on_host::nothing(&tree, device, &initial, &mut observe),
    };
    let optimize_s = start.elapsed().as_secs_f64();
    let (best, quality) = match built {
        Some(built) => (built, initial),
        None => hand_out((&tree, fold.as_deref()), scene, device, "optimiser")?,
    };
    let start = Instant::now();
    let (best, quality, bound) = bounded((best, quality), scene, device, settings.max_depth)?;
    let optimize_s = optimize_s + start.elapsed().as_secs_f64();
    if fold.is_some() {
        unfold_rows(&mut outcome.rows, added);
    }
    let (handed_out, adaptive, collapse_timings) = match &settings.adaptive {
        None => (best, None, Vec::new()),
        Some(settings) if !plan.collapses => {
            let measured = bvh::quality(&best, &settings.sah);
            (best, Some(measured), Vec::new())
        }
        Some(settings) => {
            if fold.is_some() || bound.is_some() {
                // The collapse counts triangles, and the device has not seen the bound.
                tree.free(device);
                tree = upload_whole(best, scene, device)?;
            } else {
                drop(best);
            }
            let (collapsed, measured, timings) = hand_out_collapsed(&tree, scene, device, settings)?;
            (collapsed, Some(measured), timings)
        }
    };
    tree.free(device);
    Ok(Optimized {
        tree: handed_out,
        initial,
        quality,
        bound,
        adaptive,
        outcome,
        build_s,
        build_timings,
        optimize_s,
        collapse_timings,
        plan,
        ran: device.kernels(),
    })
}

/// Refuses what cannot be done, before anything is.
fn check(scene: &Scene, settings: &Settings) -> Result<(), PipelineError> {
    settings.initial.check()?;
    settings.max_depth.check(scene.triangles.len())?;
    settings.adaptive.as_ref().map_or(Ok(()), check_settings)?;
    Ok(())
}

/// The scene in working coordinates.
fn working_triangles(scene: &Scene, device: &dyn Device) -> Vec<Triangle> {
    on_host(device, || SafeRange::of(&scene.triangles).apply(&scene.triangles))
}

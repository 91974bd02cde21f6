//! From a scene to its best tree: safe range, initial tree, optimiser, original boxes, validation, bound on the depth, adaptive leaves.
//!
//! Work of the host runs on the threads of the device if that is a CPU, else on those of the current rayon pool ([`Device::run_on_host`]).

mod hand_out;
mod host_tree;
mod initial;
mod on_host;
mod split;
mod tree;
mod wide;

pub use crate::settings::{FeatureOff, GivenTree, Initial, Optimizer, SettingError, Settings};
pub use host_tree::build_on_host;
pub use split::Splits;
pub use tree::{Leaves, OptimizedTree, optimize_tree};
pub use wide::WideTree;

use hand_out::{bounded, hand_out, hand_out_collapsed, upload_whole};
use initial::initial_tree;
use split::Start;
use wide::wide_tree;

use crate::build::DeviceTree;
#[cfg(feature = "files")]
use crate::build::TreeOfFileError;
use crate::bvh::{self, Bvh, DepthBound, EncodeError, Quality, SahModel, TooShallow, TreeFault};
use crate::collapse::CollapseError;
use crate::device::{Device, DeviceError, Lease, StoppableLoan, Timing, Watched, on_host};
use crate::fold::{unfold_rows, unfolded_row};
use crate::optimize::{
    CurrentTree, IterationRow, Limits, Outcome, StopReason, TreeAreas, measure_unchecked, prbvh_unchecked,
    rotations_unchecked,
};
use crate::plan::{Plan, PlanMismatch};
use crate::references::References;
use crate::scene::{SafeRange, Scene, SceneError};
use crate::wide::{WideFault, summary as wide_summary};
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
    /// Quality of the best tree with one reference per leaf, which is what was optimised, its depth bounded, in f64. A reference is a triangle, or with splits a
    /// piece of one.
    pub quality: Quality,
    /// What became of triangles that were split; none where each is one reference.
    pub splits: Option<Splits>,
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
    /// The wide tree of [`Settings::wide`].
    pub wide: Option<WideTree>,
    /// Times of what the device did for it.
    pub wide_timings: Vec<Timing>,
    /// Kernels that ran; [`Plan::unplanned`] has none of them.
    pub ran: BTreeSet<Kernel>,
}

impl Optimized {
    /// SAH cost of the best tree as the optimiser left it, before pieces of one triangle were merged and its depth was bounded, in f64.
    #[must_use]
    pub fn optimized_cost(&self) -> f64 {
        if let Some(splits) = &self.splits {
            return splits.cost_before;
        }
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
    /// A setting makes no sense.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The device refused or failed; [`DeviceError::Stopped`]: an end was asked for before there was a tree.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The tree to start from is none, or none over the scene.
    #[error("the tree given is not fit for it: {}", bvh::summary(.faults))]
    GivenTree {
        /// All faults.
        faults: Vec<TreeFault>,
    },
    /// There are too many references.
    #[error(transparent)]
    Scene(#[from] SceneError),
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
    /// The wide tree is none over the triangles.
    #[error("the wide tree is invalid: {}", wide_summary(.faults))]
    InvalidWideTree {
        /// All faults.
        faults: Vec<WideFault>,
    },
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
/// An end that is asked for by [`Limits::stop`](crate::optimize::Limits::stop) comes soon at any time: while the initial tree is built there is none, and so
/// an error, [`DeviceError::Stopped`]; afterwards it is the best tree so far. When [`Limits::max_time`](crate::optimize::Limits::max_time), which counts from
/// the beginning of this call, has passed by the time the initial tree is there, that is the tree that is returned.
///
/// Of an [`Initial::Tree`] in which a triangle is in several leaves comes such a tree: see [`bvh::validate_references`].
///
/// # Errors
/// If a setting makes no sense, the program lacks a method, the scene does not fit the device, the device fails, or a tree is invalid.
pub fn optimize(
    scene: &Scene,
    device: &mut dyn Device,
    settings: &Settings,
    observe: &mut dyn FnMut(&IterationRow) -> ControlFlow<()>,
) -> Result<Optimized, PipelineError> {
    check(scene, settings)?;
    let info = device.info();
    let plan = on_host(device, || Plan::of(scene, info, settings, &[]))?;
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
    let begin = Instant::now();
    let mut lease = Lease::new(device);
    let device = &mut Watched::new(&mut lease);
    let fold = plan.fold.clone();

    let start = Instant::now();
    let limits = settings.limits();
    let whole = scene;
    let Start { given, mut split, timings } = {
        let device = &mut StoppableLoan::new(device, limits.stop.clone());
        Start::of(whole, device, settings, &plan)?
    };
    // Where a triangle has several references, these are what is optimised.
    let scene = split.as_ref().map_or(whole, |split| &split.scene);
    let Built { mut tree, areas, timings: build_timings, build_s, handed_out: built, quality: initial, added } = {
        let device = &mut StoppableLoan::new(device, limits.stop.clone());
        build(scene, given.as_ref(), device, settings, &plan, start)?
    };
    let build_timings = [timings, build_timings].concat();
    let over = limits.used_up(0, begin.elapsed()).filter(|over| *over != StopReason::MaxIterations);
    // Only kept where nothing comes after it.
    let built = (over.is_some() || matches!(settings.optimizer, Optimizer::None)).then_some(built);

    let start = Instant::now();
    let mut observe = |row: &IterationRow, tree: CurrentTree<'_>| observe(&unfolded_row(row, added), tree);
    let left = |limits: &mut Limits| {
        limits.target_cost = limits.target_cost.map(|cost| cost - added);
        limits.max_time = limits.max_time.map(|limit| limit.saturating_sub(begin.elapsed()));
    };
    let mut outcome = match (&settings.optimizer, over) {
        (_, Some(over)) => on_host::nothing(&tree, device, initial.sah_cost - added, over, &mut observe),
        (Optimizer::Prbvh, None) => {
            let mut settings = settings.prbvh.clone();
            left(&mut settings.limits);
            if row_by_row {
                settings.news = Duration::ZERO;
            }
            let last_search = device.last_search();
            prbvh_unchecked(device, &tree, areas, &settings, &mut |row, tree, device| {
                observe(row, CurrentTree::Device(tree, device, last_search.borrow().clone()))
            })?
        }
        (Optimizer::Rbvh(settings), None) => {
            let mut settings = settings.clone();
            left(&mut settings.limits);
            let (optimized, outcome) = on_host::rbvh(tree, device, &settings, &mut observe)?;
            tree = optimized;
            outcome
        }
        (Optimizer::Rotations(settings), None) => {
            let mut settings = settings.clone();
            left(&mut settings.limits);
            rotations_unchecked(device, &tree, areas, &settings, &mut |row, tree, device| {
                observe(row, CurrentTree::Device(tree, device, None))
            })?
        }
        (Optimizer::None, None) => {
            on_host::nothing(&tree, device, initial.sah_cost, StopReason::NoOptimizer, &mut observe)
        }
    };
    let optimize_s = start.elapsed().as_secs_f64();
    let (best, quality) = match built {
        Some(built) => (built, initial),
        None => hand_out((&tree, fold.as_deref()), scene, device, ("optimiser", None))?,
    };
    let start = Instant::now();
    let (best, quality) = match &mut split {
        Some(split) => on_host(device, || split.merged((best, quality)))?,
        None => (best, quality),
    };
    let scene = split.as_ref().map_or(whole, |split| &split.scene);
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
            if fold.is_some() || bound.is_some() || split.as_ref().is_some_and(|split| split.has_merged()) {
                // The collapse counts triangles, and the device has not seen the bound, nor what was merged.
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
    let (handed_out, splits) = match split {
        Some(split) => split.given_back(handed_out, whole, device).map(|(tree, splits)| (tree, Some(splits)))?,
        None => (handed_out, None),
    };
    // A leaf may have had two pieces of one triangle.
    let adaptive = adaptive.map(|measured| match (splits, &settings.adaptive) {
        (Some(_), Some(settings)) => bvh::quality(&handed_out, &settings.sah),
        _ => measured,
    });
    let wide = settings.wide.as_ref().map(|wide| wide_tree(&handed_out, whole, device, wide)).transpose()?;
    let (wide, wide_timings) = wide.unzip();
    Ok(Optimized {
        tree: handed_out,
        initial,
        quality,
        splits,
        bound,
        adaptive,
        outcome,
        build_s,
        build_timings,
        optimize_s,
        collapse_timings,
        plan,
        wide,
        wide_timings: wide_timings.unwrap_or_default(),
        ran: device.kernels(),
    })
}

/// The initial tree, handed out.
struct Built {
    tree: DeviceTree,
    /// Measured where the optimiser on the device wants them.
    areas: Option<TreeAreas>,
    timings: Vec<Timing>,
    build_s: f64,
    handed_out: Bvh,
    quality: Quality,
    /// What unfolding adds to the cost.
    added: f64,
}

fn build(
    scene: &Scene,
    given: Option<&References>,
    device: &mut dyn Device,
    settings: &Settings,
    plan: &Plan,
    start: Instant,
) -> Result<Built, PipelineError> {
    let stop = settings.limits().stop.as_ref();
    let fold = plan.fold.as_deref();
    let mut references = working_triangles(scene, device);
    if let Some(fold) = fold {
        references = fold.references(&references);
    }
    let added = fold.map_or(0.0, |fold| fold.added_cost(&scene.triangles, &SahModel::default()));
    let (tree, mut timings) = initial_tree(scene, given, references, device, (settings, plan.codes))?;
    let areas = match settings.optimizer {
        Optimizer::Prbvh | Optimizer::Rotations(_) => {
            let (areas, measured) = measure_unchecked(device, &tree)?;
            timings.extend(measured);
            Some(areas)
        }
        Optimizer::Rbvh(_) | Optimizer::None => None,
    };
    let build_s = start.elapsed().as_secs_f64();
    let (handed_out, quality) = hand_out((&tree, fold), scene, device, ("builder", stop))?;
    Ok(Built { tree, areas, timings, build_s, handed_out, quality, added })
}

/// Refuses what cannot be done, before anything is.
fn check(scene: &Scene, settings: &Settings) -> Result<(), PipelineError> {
    settings.initial.check()?;
    settings.check()?;
    settings.max_depth.check(scene.triangles.len())?;
    Ok(())
}

/// The scene in working coordinates.
fn working_triangles(scene: &Scene, device: &dyn Device) -> Vec<Triangle> {
    on_host(device, || SafeRange::of(&scene.triangles).apply(&scene.triangles))
}

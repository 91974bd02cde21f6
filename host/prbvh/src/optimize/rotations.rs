//! Rotations on a device: hill climbing, after annealing if that is asked for (Kensler 2008, *Tree Rotations for Improving Bounding Volume
//! Hierarchies*), and a single pass in the refit of a frame (Kopta et al. 2012, *Fast, Effective BVH Updates for Animated Scenes*).

use super::areas::{Measure, TreeAreas};
use super::session::no_fault;
use super::{IterationRow, Limits, OptimizeError, Outcome, StopReason, set_relative_errors};
use crate::build::{DeviceTree, Scratch, UnfitTree};
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing};
use prbvh_kernel::Kernel;
use prbvh_kernel::kept::{Kept, RestoreParams};
use prbvh_kernel::rotations::{COUSINS, KEEPS, RotateParams, key};
use prbvh_kernel::status::{APPLIED, FAULTS, GREW, REPORT_WORDS, SHRUNK};
use prbvh_kernel::sum::{scale_of, to_f64};
use std::ops::ControlFlow;
use std::time::Instant;

/// Settings of the rotations.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct RotationSettings {
    /// Whether two grandchildren may change places, too (Kensler 2008); without, only a child with a grandchild on the other side (Kopta et al. 2012).
    pub cousins: bool,
    /// Passes of annealing before the hill climbing; 0 for none.
    pub annealing_passes: u32,
    /// Temperature of the first pass of annealing, in mean areas of an internal node; it falls to 0 by equal steps.
    pub temperature: f64,
    /// Seed of the annealing.
    pub seed: u32,
    /// A pass that lowers the cost by less than this part of it is the last.
    pub epsilon: f64,
    /// What ends it early. An iteration is a pass.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub limits: Limits,
}

impl Default for RotationSettings {
    fn default() -> Self {
        Self {
            cousins: true,
            annealing_passes: 0,
            temperature: 0.1,
            seed: 1,
            epsilon: 1e-4,
            limits: Limits::iterations(1000),
        }
    }
}

/// Optimises a tree in place by passes of rotations, each a climb from all leaves. `observe` sees the tree's every row and may break; the best tree so far is
/// kept in every case.
///
/// A pass of hill climbing makes at each node, from below, the best of its rotations if that makes the boxes between smaller: the cost falls or stays.
/// In a row `searched` are the internal nodes, `found`, `owned` and `applied` the rotations that were made; `visits` and `most_steps` are 0, and `mu` is 1.
///
/// # Errors
/// If a setting makes no sense or [`DeviceTree::check`] finds fault with the tree: then nothing has run. If the device fails: then the tree is not to be
/// used.
pub fn rotations(
    device: &mut dyn Device,
    tree: &DeviceTree,
    settings: &RotationSettings,
    observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
) -> Result<Outcome, OptimizeError> {
    settings.check()?;
    tree.check(device)?;
    Ok(rotations_unchecked(device, tree, None, settings, observe)?)
}

/// [`rotations`] of a tree that this library made, in working coordinates, by settings that were checked. Without areas the boxes are made anew first.
#[doc(hidden)]
pub fn rotations_unchecked(
    device: &mut dyn Device,
    tree: &DeviceTree,
    areas: Option<TreeAreas>,
    settings: &RotationSettings,
    observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
) -> Result<Outcome, DeviceError> {
    let device = &mut Lease::new(device);
    let mut run = Run::new(device, tree, settings)?;
    let stop = run.run(device, areas, observe)?;
    let outcome = run.finish(device, stop)?;
    // What the observer allocated is the observer's.
    device.keep();
    Ok(outcome)
}

/// Makes all boxes of internal nodes anew from those of the leaves, as [`DeviceTree::refit`] does, and rotates on the way up: what a tree over moving
/// triangles takes in each frame (Kopta et al. 2012). Returns how many rotations were made.
///
/// # Errors
/// If the device fails, or the links are no tree.
pub fn refit_rotating(device: &mut dyn Device, tree: &DeviceTree) -> Result<u32, UnfitTree> {
    if let Err(faults) = tree.decode(device, 0)? {
        return Err(UnfitTree::Broken { faults });
    }
    let device = &mut Lease::new(device);
    let mut recording = Recording::new();
    let pass = Pass::new(device, &mut Scratch::default(), tree, false)?;
    let arrivals = device.allocate("arrivals", crate::build::arrivals_length(tree.references), 4)?;
    recording.clear("rotate", &arrivals);
    pass.record(&mut recording, &arrivals, RotateParams { count: tree.references, ..bytemuck::Zeroable::zeroed() });
    device.run(&recording)?;
    Ok(pass.report(device)?[APPLIED])
}

/// Records a pass over arrivals that are clear; `kept` is not touched unless the flags say so.
pub(super) fn record_rotations(
    recording: &mut Recording,
    nodes: &Buffer,
    arrivals: &Buffer,
    (kept, report): (&Buffer, &Buffer),
    params: RotateParams,
) {
    recording.clear("rotate", report);
    recording.dispatch("rotate", Kernel::Rotations, params.count, &params, &[nodes, arrivals, kept, report]);
}

/// What a pass needs beside the tree.
#[derive(Debug)]
struct Pass {
    nodes: Buffer,
    kept: Buffer,
    report: Buffer,
}

impl Pass {
    /// `keeps`: with room for the best tree.
    fn new(
        device: &mut dyn Device,
        scratch: &mut Scratch,
        tree: &DeviceTree,
        keeps: bool,
    ) -> Result<Self, DeviceError> {
        let length = if keeps { tree.references as usize - 1 } else { 1 };
        Ok(Self {
            nodes: tree.nodes.clone(),
            kept: scratch.allocate(device, "best tree", length.max(1), size_of::<Kept>())?,
            report: scratch.allocate(device, "report", REPORT_WORDS as usize, 4)?,
        })
    }

    fn record(&self, recording: &mut Recording, arrivals: &Buffer, params: RotateParams) {
        record_rotations(recording, &self.nodes, arrivals, (&self.kept, &self.report), params);
    }

    fn report(&self, device: &mut dyn Device) -> Result<[u32; REPORT_WORDS as usize], DeviceError> {
        let mut report = [0u32; REPORT_WORDS as usize];
        device.download(&self.report, bytemuck::cast_slice_mut(&mut report))?;
        no_fault(device, report[FAULTS])?;
        Ok(report)
    }
}

#[derive(Debug)]
struct Run<'a> {
    tree: &'a DeviceTree,
    settings: &'a RotationSettings,
    scratch: Scratch,
    pass: Pass,
    measure: Measure,
    rows: Vec<IterationRow>,
    best_cost: f64,
    /// Whether the tree is the best one.
    is_best: bool,
    /// Number of the best tree, from 1 on.
    epoch: u32,
    timings: Vec<Timing>,
    device_s: f64,
    start: Instant,
    working_bytes: u64,
}

/// Two sums of the areas of a tree that differ by less than this part may be equal.
const ROUNDING: f64 = 1e-6;

/// A tree of fewer references has no grandchildren.
const FEWEST: u32 = 3;

impl<'a> Run<'a> {
    fn new(device: &mut dyn Device, tree: &'a DeviceTree, settings: &'a RotationSettings) -> Result<Self, DeviceError> {
        let start = Instant::now();
        let mut scratch = Scratch::default();
        let pass = Pass::new(device, &mut scratch, tree, settings.annealing_passes > 0)?;
        let measure = Measure::new(device, &mut scratch, tree, &pass.report)?;
        Ok(Self {
            tree,
            settings,
            scratch,
            pass,
            measure,
            rows: Vec::new(),
            best_cost: 0.0,
            is_best: true,
            epoch: 1,
            timings: Vec::new(),
            device_s: 0.0,
            start,
            working_bytes: device.memory().bytes,
        })
    }

    fn take_note(&mut self, timings: Vec<Timing>) {
        self.device_s += timings.iter().map(|timing| timing.seconds).sum::<f64>();
        self.timings.extend(timings);
    }

    fn push(&mut self, row: IterationRow) {
        let row = IterationRow {
            iteration: self.rows.len() as u32,
            mu: 1,
            time_s: self.start.elapsed().as_secs_f64(),
            device_s: self.device_s,
            ..row
        };
        self.rows.push(row);
    }

    fn run(
        &mut self,
        device: &mut dyn Device,
        areas: Option<TreeAreas>,
        observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
    ) -> Result<StopReason, DeviceError> {
        let settings = self.settings;
        let mut recording = Recording::new();
        recording.clear("rotate", &self.pass.report);
        recording.clear("rotate", &self.pass.kept);
        let timings = device.run(&recording)?;
        self.take_note(timings);
        let areas = match areas {
            Some(areas) => areas,
            None => {
                let (areas, timings) = self.measure.refitted_areas(device)?;
                self.take_note(timings);
                self.pass.report(device)?;
                areas
            }
        };
        self.best_cost = areas.cost(self.tree.references);
        self.push(IterationRow { cost: self.best_cost, ..IterationRow::default() });
        let scale = scale_of(areas.root);
        let mean_area = areas.internal / f64::from((self.tree.references - 1).max(1));
        for pass in 0u32.. {
            if observe(&self.rows[pass as usize], self.tree, device).is_break() {
                return Ok(StopReason::Cancelled);
            }
            let is_annealed = pass < settings.annealing_passes;
            let before = if pass > 0 { self.rows[pass as usize - 1].cost } else { f64::INFINITY };
            let row = self.rows[pass as usize];
            // The last pass of annealing is no measure.
            let climbed = pass > settings.annealing_passes;
            // Not if the cost is no number.
            let falls = row.applied > 0 && row.cost < before * (1.0 - settings.epsilon);
            if settings.limits.is_target(self.best_cost) {
                return Ok(StopReason::Target);
            }
            if (climbed && !falls) || self.tree.references < FEWEST {
                break;
            }
            if let Some(stop) = settings.limits.used_up(pass, self.start.elapsed()) {
                return Ok(stop);
            }
            let left = f64::from(settings.annealing_passes - pass.min(settings.annealing_passes));
            let temperature = match is_annealed {
                true => settings.temperature * mean_area * left / f64::from(settings.annealing_passes),
                false => 0.0,
            };
            self.rotate(device, areas, (pass, temperature as f32, scale))?;
        }
        Ok(StopReason::Converged)
    }

    /// Makes a pass and its row.
    fn rotate(
        &mut self,
        device: &mut dyn Device,
        areas: TreeAreas,
        (pass, temperature, scale): (u32, f32, f32),
    ) -> Result<(), DeviceError> {
        let cousins = if self.settings.cousins { COUSINS } else { 0 };
        let keeps = if self.settings.annealing_passes > 0 { KEEPS } else { 0 };
        let params = RotateParams {
            count: self.tree.references,
            flags: cousins | keeps,
            key: key(self.settings.seed, pass),
            temperature,
            scale,
            epoch: self.epoch,
            ..bytemuck::Zeroable::zeroed()
        };
        let mut recording = Recording::new();
        self.measure.record_no_arrivals(&mut recording);
        self.pass.record(&mut recording, &self.measure.arrivals, params);
        self.measure.is_climbed();
        let (after, timings) = self.measure.areas(device, recording)?;
        self.take_note(timings);
        let report = self.pass.report(device)?;
        let change = |word: usize| to_f64(report[word], report[word + 1], scale);
        let made = report[APPLIED];
        let cost = after.cost(self.tree.references);
        self.push(IterationRow {
            cost,
            predicted_decrease: areas.cost_of(change(SHRUNK) - change(GREW)),
            searched: self.tree.references - 1,
            found: made,
            owned: made,
            applied: made,
            ..IterationRow::default()
        });
        // A climb lowers the cost for sure; of other trees that is only known beyond the rounding of their sums.
        let has_climbed = temperature == 0.0 && self.is_best;
        if made > 0 {
            self.is_best = has_climbed || cost < self.best_cost * (1.0 - ROUNDING);
            if self.is_best {
                self.best_cost = self.best_cost.min(cost);
                self.epoch += 1;
            }
        }
        Ok(())
    }

    /// Brings the best tree back, if it is another, and gives the memory back.
    fn finish(mut self, device: &mut dyn Device, stop: StopReason) -> Result<Outcome, DeviceError> {
        if !self.is_best {
            let mut recording = Recording::new();
            let params = RestoreParams { count: self.tree.references - 1, epoch: self.epoch };
            let buffers = [&self.pass.kept, &self.tree.nodes];
            recording.dispatch("restore", Kernel::KeptRestore, params.count, &params, &buffers);
            self.measure.record_refit(&mut recording);
            let timings = device.run(&recording)?;
            self.take_note(timings);
        }
        self.scratch.free(device);
        set_relative_errors(&mut self.rows);
        Ok(Outcome { rows: self.rows, stop, timings: self.timings, working_bytes: self.working_bytes })
    }
}

//! The PRBVH iterations: search, lock, check, reinsert, refit, cost.

use super::dual::DualMoves;
use super::moves::Moves;
use super::schedule::Schedule;
use super::{IterationRow, MoveKind, PrbvhSettings, StopReason, set_relative_errors};
use crate::build::{DeviceTree, Scratch, arrivals_length, record_refit};
use crate::bvh::SahModel;
use crate::device::{Buffer, Device, DeviceError, Recording, Timing};
use prbvh_kernel::Kernel;
use prbvh_kernel::cost::{COST_CHUNK, CostParams};
use prbvh_kernel::prbvh::PrbvhParams;
use prbvh_kernel::prbvh::decrease::{DECREASE_CHUNK, DecreaseParams};
use prbvh_kernel::snapshot::{NodeLinks, SnapshotParams};
use prbvh_kernel::status::{APPLIED, FAULTS, FOUND, MOST_STEPS, OWNED, REPORT_WORDS};
use std::ops::ControlFlow;
use std::time::Instant;

/// What an optimiser did; the tree is the best one.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Row 0 is the initial tree.
    pub rows: Vec<IterationRow>,
    /// Why it stopped.
    pub stop: StopReason,
    /// Time of every command.
    pub timings: Vec<Timing>,
    /// Bytes of the device's buffers while the iterations ran; of the host's, if it was the host that optimised.
    pub working_bytes: u64,
}

impl Outcome {
    /// The row of the best tree.
    #[must_use]
    pub fn best(&self) -> &IterationRow {
        let better = |a: &&IterationRow, b: &&IterationRow| a.cost.total_cmp(&b.cost);
        self.rows.iter().min_by(better).unwrap_or(&self.rows[0])
    }
}

/// Optimises a tree in place. `observe` sees the tree's every row and may break; the best tree so far is kept in every case.
///
/// # Errors
/// If the device fails.
pub fn prbvh(
    device: &mut dyn Device,
    tree: &DeviceTree,
    settings: &PrbvhSettings,
    observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
) -> Result<Outcome, DeviceError> {
    let mut working_set = WorkingSet::new(device, tree, settings)?;
    let working_bytes = device.memory().bytes;
    let (rows, stop) = working_set.run(device, settings, observe)?;
    working_set.scratch.free(device);
    Ok(Outcome { rows, stop, timings: working_set.timings, working_bytes })
}

#[derive(Debug)]
struct WorkingSet<'a> {
    tree: &'a DeviceTree,
    internal: u32,
    node_count: u32,
    scratch: Scratch,
    moves: Moves,
    dual: Option<DualMoves>,
    arrivals: Buffer,
    /// Partial sums of areas, and from `area_chunks` on of decreases.
    partial: Buffer,
    report: Buffer,
    best_links: Buffer,
    timings: Vec<Timing>,
    device_s: f64,
}

impl<'a> WorkingSet<'a> {
    fn new(device: &mut dyn Device, tree: &'a DeviceTree, settings: &PrbvhSettings) -> Result<Self, DeviceError> {
        let node_count = DeviceTree::node_count(tree.references);
        let length = node_count as usize;
        let mut scratch = Scratch::default();
        let internal = tree.references - 1;
        let moves = Moves::new(device, &mut scratch, settings.strategy, length)?;
        let dual = match settings.moves {
            MoveKind::Single => None,
            MoveKind::Dual => Some(DualMoves::new(device, &mut scratch, internal)?),
        };
        let mut buffer = |label, length, bytes| scratch.allocate(device, label, length, bytes);
        let arrivals = buffer("arrivals", arrivals_length(tree.references), 4)?;
        let searched = if dual.is_some() { internal.div_ceil(DECREASE_CHUNK) } else { 0 };
        let chunks = node_count.div_ceil(COST_CHUNK) + node_count.div_ceil(DECREASE_CHUNK) + searched;
        let partial = buffer("partial sums", chunks as usize, 4)?;
        let report = buffer("report", REPORT_WORDS as usize, 4)?;
        let best_links = buffer("best links", length, size_of::<NodeLinks>())?;
        Ok(Self {
            tree,
            internal,
            node_count,
            scratch,
            moves,
            dual,
            arrivals,
            partial,
            report,
            best_links,
            timings: Vec::new(),
            device_s: 0.0,
        })
    }

    fn run(
        &mut self,
        device: &mut dyn Device,
        settings: &PrbvhSettings,
        observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
    ) -> Result<(Vec<IterationRow>, StopReason), DeviceError> {
        let start = Instant::now();
        let mut recording = Recording::new();
        record_refit(&mut recording, self.tree.references, &self.tree.nodes, &self.arrivals);
        self.submit(device, &recording)?;
        let root = self.area_sum(device, 0, 1)?;
        let leaves = self.area_sum(device, self.internal, self.tree.references)?;
        let references = self.tree.references;
        let cost_of = |internal| cost_of_areas(internal, leaves, root, references);
        let area_chunks = self.internal.div_ceil(COST_CHUNK) as usize;
        let internal = self.area_sum(device, 0, self.internal)?;
        let mut schedule = Schedule::new(settings, cost_of(internal));
        let mut rows = vec![IterationRow {
            iteration: 0,
            mu: schedule.mu(),
            time_s: start.elapsed().as_secs_f64(),
            device_s: self.device_s,
            cost: cost_of(internal),
            ..IterationRow::default()
        }];
        let mut best = rows[0].cost;
        let mut is_best = true;
        let faults = self.read_report(device)?[FAULTS];
        let stop = loop {
            let row = &rows[rows.len() - 1];
            let done = row.iteration;
            if faults != 0 {
                break StopReason::Fault(faults);
            }
            if observe(row, self.tree, device).is_break() {
                break StopReason::Cancelled;
            }
            if done > 0
                && let Some(stop) = schedule.note(&rows[rows.len() - 1])
            {
                break stop;
            }
            if let Some(stop) = schedule.limit(done, start.elapsed()) {
                break stop;
            }
            let mut recording = Recording::new();
            if is_best {
                self.record_save(&mut recording);
            }
            let mu = schedule.mu();
            let chunks = self.record_iteration(&mut recording, mu, done % mu);
            self.submit(device, &recording)?;
            let report = self.read_report(device)?;
            if report[FAULTS] != 0 {
                is_best = false;
                break StopReason::Fault(report[FAULTS]);
            }
            let partial = self.read_partial(device, area_chunks + chunks as usize)?;
            let (areas, decreases) = partial.split_at(area_chunks);
            let cost = cost_of(sum(areas));
            is_best = cost < best;
            if is_best {
                best = cost;
            }
            rows.push(IterationRow {
                iteration: done + 1,
                mu,
                time_s: start.elapsed().as_secs_f64(),
                device_s: self.device_s,
                cost,
                predicted_decrease: if root > 0.0 {
                    SahModel::default().c_traversal * sum(decreases) / root
                } else {
                    0.0
                },
                found: report[FOUND],
                owned: report[OWNED],
                applied: report[APPLIED],
                most_steps: report[MOST_STEPS],
                ..IterationRow::default()
            });
        };
        if !is_best {
            self.restore_best(device)?;
        }
        set_relative_errors(&mut rows);
        Ok((rows, stop))
    }

    fn submit(&mut self, device: &mut dyn Device, recording: &Recording) -> Result<(), DeviceError> {
        let timings = device.run(recording)?;
        self.device_s += timings.iter().map(|timing| timing.seconds).sum::<f64>();
        self.timings.extend(timings);
        Ok(())
    }

    fn record_save(&self, recording: &mut Recording) {
        let params = SnapshotParams { count: self.node_count };
        let buffers = [&self.tree.nodes, &self.best_links];
        recording.dispatch("keep best", Kernel::SnapshotSave, self.node_count, &params, &buffers);
    }

    fn restore_best(&mut self, device: &mut dyn Device) -> Result<(), DeviceError> {
        let mut recording = Recording::new();
        let params = SnapshotParams { count: self.node_count };
        let buffers = [&self.best_links, &self.tree.nodes];
        recording.dispatch("keep best", Kernel::SnapshotRestore, self.node_count, &params, &buffers);
        record_refit(&mut recording, self.tree.references, &self.tree.nodes, &self.arrivals);
        self.submit(device, &recording)
    }

    /// Records one iteration that searches every `mu`-th node from `first` on; returns how many partial sums of decreases it makes.
    fn record_iteration(&self, recording: &mut Recording, mu: u32, first: u32) -> u32 {
        let nodes = &self.tree.nodes;
        let report = &self.report;
        let params = |inputs: u32| {
            let count = inputs.saturating_sub(first).div_ceil(mu);
            PrbvhParams { count, mu, first, nodes: self.node_count }
        };
        recording.clear("search", report);
        let single = params(self.node_count);
        self.moves.record(recording, &single, nodes, report);
        let mut chunks = self.record_decreases(recording, single.count, 0);
        let buffers = [&self.moves.found, nodes, report];
        recording.dispatch("reinsert", Kernel::PrbvhReinsert, single.count, &single, &buffers);
        record_refit(recording, self.tree.references, nodes, &self.arrivals);
        if let Some(dual) = &self.dual {
            let params = params(self.internal);
            dual.record(recording, &params, &self.moves, nodes, report);
            chunks += self.record_decreases(recording, params.count, chunks);
            dual.record_reinsert(recording, &params, &self.moves, nodes, report);
            record_refit(recording, self.tree.references, nodes, &self.arrivals);
        }
        self.record_area_sum(recording, 0, self.internal);
        chunks
    }

    /// Sums what `found` reinsertions promise behind `before` other sums of that kind; returns how many sums it makes.
    fn record_decreases(&self, recording: &mut Recording, found: u32, before: u32) -> u32 {
        let count = found.div_ceil(DECREASE_CHUNK);
        let sums = DecreaseParams { count, found, first: self.internal.div_ceil(COST_CHUNK) + before };
        recording.dispatch("cost", Kernel::PrbvhDecrease, count, &sums, &[&self.moves.found, &self.partial]);
        count
    }

    fn record_area_sum(&self, recording: &mut Recording, first: u32, nodes: u32) {
        let count = nodes.div_ceil(COST_CHUNK);
        let params = CostParams { count, first, nodes, internal: self.internal };
        let buffers = [&self.tree.nodes, &self.arrivals, &self.partial, &self.report];
        recording.dispatch("cost", Kernel::Cost, count, &params, &buffers);
    }

    /// Sum of the half areas of `nodes` nodes from `first` on: f32 over fixed chunks, f64 over the chunks.
    fn area_sum(&mut self, device: &mut dyn Device, first: u32, nodes: u32) -> Result<f64, DeviceError> {
        let mut recording = Recording::new();
        self.record_area_sum(&mut recording, first, nodes);
        self.submit(device, &recording)?;
        Ok(sum(&self.read_partial(device, nodes.div_ceil(COST_CHUNK) as usize)?))
    }

    fn read_partial(&self, device: &mut dyn Device, chunks: usize) -> Result<Vec<f32>, DeviceError> {
        let mut partial = vec![0.0f32; chunks];
        device.download(&self.partial, bytemuck::cast_slice_mut(&mut partial))?;
        Ok(partial)
    }

    fn read_report(&self, device: &mut dyn Device) -> Result<[u32; REPORT_WORDS as usize], DeviceError> {
        let mut report = [0; REPORT_WORDS as usize];
        device.download(&self.report, bytemuck::cast_slice_mut(&mut report))?;
        Ok(report)
    }
}

/// Sum of partial sums, in f64.
fn sum(partial: &[f32]) -> f64 {
    partial.iter().copied().map(f64::from).sum()
}

/// SAH cost with one triangle per leaf, from sums of half areas. Where the root has no area every ratio counts as 1, as in
/// [`crate::bvh`].
pub(super) fn cost_of_areas(internal: f64, leaves: f64, root: f64, references: u32) -> f64 {
    let SahModel { c_traversal, c_intersect } = SahModel::default();
    if root > 0.0 {
        (c_traversal * internal + c_intersect * leaves) / root
    } else {
        c_traversal * f64::from(references - 1) + c_intersect * f64::from(references)
    }
}

//! The PRBVH iterations: search, lock, check, reinsert, refit, cost.

mod passes;

use super::descent::{Candidates, Descent};
use super::dual::DualMoves;
use super::moves::Moves;
use super::schedule::Schedule;
use super::{IterationRow, MoveKind, Order, PrbvhSettings, StopReason, set_relative_errors};
use crate::build::{DeviceTree, Scratch, arrivals_length, record_refit};
use crate::bvh::SahModel;
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing};
use passes::{TRIES, Work};
use prbvh_kernel::Kernel;
use prbvh_kernel::cost::{COST_CHUNK, CostParams};
use prbvh_kernel::prbvh::PrbvhParams;
use prbvh_kernel::prbvh::decrease::DECREASE_CHUNK;
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
    let device = &mut Lease::new(device);
    let mut working_set = WorkingSet::new(device, tree, settings)?;
    let working_bytes = device.memory().bytes;
    let (rows, stop) = working_set.run(device, settings, observe)?;
    working_set.scratch.free(device);
    // What the observer allocated is the observer's.
    device.keep();
    Ok(Outcome { rows, stop, timings: working_set.timings, working_bytes })
}

#[derive(Debug)]
struct WorkingSet<'a> {
    tree: &'a DeviceTree,
    internal: u32,
    node_count: u32,
    scratch: Scratch,
    moves: Moves,
    candidates: Option<Candidates>,
    dual: Option<DualMoves>,
    arrivals: Buffer,
    /// What the last refit left in `arrivals`.
    arrived: u32,
    /// Partial sums of areas, and from `area_chunks` on of decreases.
    partial: Buffer,
    report: Buffer,
    best_links: Buffer,
    timings: Vec<Timing>,
    device_s: f64,
    /// Nodes on the list of candidates.
    listed: u32,
}

impl<'a> WorkingSet<'a> {
    fn new(device: &mut dyn Device, tree: &'a DeviceTree, settings: &PrbvhSettings) -> Result<Self, DeviceError> {
        let node_count = DeviceTree::node_count(tree.references);
        let length = node_count as usize;
        let mut scratch = Scratch::default();
        let internal = tree.references - 1;
        let moves = Moves::new(device, &mut scratch, settings.strategy, length)?;
        let candidates = match settings.order {
            Order::Interleaved => None,
            Order::LargestFirst => Some(Candidates::new(&mut scratch, device, node_count)?),
        };
        let dual = match settings.moves {
            MoveKind::Single => None,
            MoveKind::Dual => Some(DualMoves::new(device, &mut scratch, internal)?),
        };
        let mut buffer = |label, length, bytes| scratch.allocate(device, label, length, bytes);
        let arrivals = buffer("arrivals", arrivals_length(tree.references), 4)?;
        let searched = if dual.is_some() { internal.div_ceil(DECREASE_CHUNK) } else { 0 };
        // The first sums are of the root, the leaves and the internal nodes.
        let chunks = node_count.div_ceil(COST_CHUNK) + 2 + TRIES * node_count.div_ceil(DECREASE_CHUNK) + searched;
        let partial = buffer("partial sums", chunks as usize, 4)?;
        let report = buffer("report", REPORT_WORDS as usize, 4)?;
        let best_links = buffer("best links", length, size_of::<NodeLinks>())?;
        Ok(Self {
            tree,
            internal,
            node_count,
            scratch,
            moves,
            candidates,
            dual,
            arrivals,
            arrived: 0,
            partial,
            report,
            best_links,
            timings: Vec::new(),
            device_s: 0.0,
            listed: 0,
        })
    }

    fn run(
        &mut self,
        device: &mut dyn Device,
        settings: &PrbvhSettings,
        observe: &mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>,
    ) -> Result<(Vec<IterationRow>, StopReason), DeviceError> {
        let start = Instant::now();
        let (root, leaves, internal) = self.first_areas(device)?;
        let faults = self.read_report(device)?[FAULTS];

        let references = self.tree.references;
        let cost_of = |internal| cost_of_areas(internal, leaves, root, references);
        let mut schedule = Schedule::new(settings, cost_of(internal));
        let mut descent = match settings.order {
            Order::Interleaved => Descent::over(),
            Order::LargestFirst => Descent::new(settings.mu),
        };
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
        let mut descended = 0;
        let stop = loop {
            let row = &rows[rows.len() - 1];
            let done = row.iteration;
            if faults != 0 {
                break StopReason::Fault(faults);
            }
            if observe(row, self.tree, device).is_break() {
                break StopReason::Cancelled;
            }
            if done > descended {
                if let Some(stop) = schedule.note(&rows[rows.len() - 1]) {
                    break stop;
                }
            } else {
                schedule.note_cost(row);
            }
            if let Some(stop) = schedule.limit(done, start.elapsed()) {
                break stop;
            }
            let mut recording = Recording::new();
            if is_best {
                self.record_save(&mut recording);
            }
            recording.clear("search", &self.report);
            let mut work = Work::default();
            if !descent.is_over() {
                descended = done + 1;
                work = self.descend(device, &mut recording, &mut descent, root)?;
            }
            if work.searched == 0 {
                descended = descended.min(done);
                let mu = schedule.mu();
                let first = (done - descended) % mu;
                let params = PrbvhParams {
                    count: self.node_count.saturating_sub(first).div_ceil(mu),
                    ..self.params(mu, first, 0.0)
                };
                work.mu = mu;
                self.pass(device, recording, &params, false, true, &mut work)?;
            }
            let report = self.read_report(device)?;
            if report[FAULTS] != 0 {
                is_best = false;
                break StopReason::Fault(report[FAULTS]);
            }
            let cost = cost_of(work.areas);
            is_best = cost < best;
            if is_best {
                best = cost;
            }
            rows.push(IterationRow {
                iteration: done + 1,
                mu: work.mu,
                time_s: start.elapsed().as_secs_f64(),
                device_s: self.device_s,
                cost,
                predicted_decrease: if root > 0.0 {
                    SahModel::default().c_traversal * work.decreases / root
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
        // Without an iteration the tree is as it was, and none is kept.
        let faults = if rows.len() > 1 { self.settle(device, is_best)? } else { None };
        let stop = faults.map_or(stop, StopReason::Fault);
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

    /// Leaves the best tree, with all boxes made anew; returns the faults if that shows that the last one is no tree.
    fn settle(&mut self, device: &mut dyn Device, is_best: bool) -> Result<Option<u32>, DeviceError> {
        if is_best {
            let mut recording = Recording::new();
            recording.clear("refit", &self.report);
            self.record_full_refit(&mut recording);
            self.submit(device, &recording)?;
            self.internal_areas(device)?;
            let faults = self.read_report(device)?[FAULTS];
            if faults == 0 {
                return Ok(None);
            }
            self.restore_best(device)?;
            return Ok(Some(faults));
        }
        self.restore_best(device)?;
        Ok(None)
    }

    fn restore_best(&mut self, device: &mut dyn Device) -> Result<(), DeviceError> {
        let mut recording = Recording::new();
        let params = SnapshotParams { count: self.node_count };
        let buffers = [&self.best_links, &self.tree.nodes];
        recording.dispatch("keep best", Kernel::SnapshotRestore, self.node_count, &params, &buffers);
        self.record_full_refit(&mut recording);
        self.submit(device, &recording)
    }

    fn record_full_refit(&mut self, recording: &mut Recording) {
        record_refit(recording, self.tree.references, &self.tree.nodes, &self.arrivals);
        self.arrived = 2;
    }

    /// Half areas of the root, the leaves and the internal nodes of the tree as it comes, refitted whole.
    fn first_areas(&mut self, device: &mut dyn Device) -> Result<(f64, f64, f64), DeviceError> {
        let (internal, leaves) = (self.internal, self.tree.references);
        let internal_chunks = internal.div_ceil(COST_CHUNK);
        let chunks = internal_chunks + leaves.div_ceil(COST_CHUNK);
        let mut recording = Recording::new();
        self.record_full_refit(&mut recording);
        self.record_area_sum(&mut recording, 0, internal, 0);
        self.record_area_sum(&mut recording, internal, leaves, internal_chunks);
        self.record_area_sum(&mut recording, 0, 1, chunks);
        // From here on only paths are refitted.
        recording.clear("refit", &self.arrivals);
        self.submit(device, &recording)?;
        self.arrived = 0;
        let partial = self.read_partial(device, chunks as usize + 1)?;
        let (internal, rest) = partial.split_at(internal_chunks as usize);
        let (leaves, root) = rest.split_at(rest.len() - 1);
        Ok((sum(root), sum(leaves), sum(internal)))
    }

    /// Records the sums of the half areas of `nodes` nodes from `first` on, for `partial` from `to` on.
    fn record_area_sum(&self, recording: &mut Recording, first: u32, nodes: u32, to: u32) {
        let count = nodes.div_ceil(COST_CHUNK);
        let params = CostParams { count, first, nodes, internal: self.internal, to, arrived: self.arrived };
        let buffers = [&self.tree.nodes, &self.arrivals, &self.partial, &self.report];
        recording.dispatch("cost", Kernel::Cost, count, &params, &buffers);
    }

    /// Sum of the half areas of the internal nodes: f32 over fixed chunks, f64 over the chunks.
    fn internal_areas(&mut self, device: &mut dyn Device) -> Result<f64, DeviceError> {
        let mut recording = Recording::new();
        self.record_area_sum(&mut recording, 0, self.internal, 0);
        self.submit(device, &recording)?;
        Ok(sum(&self.read_partial(device, self.internal.div_ceil(COST_CHUNK) as usize)?))
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

//! Sums of the areas of a tree, from which its SAH cost is made.

use super::OptimizeError;
use crate::build::{DeviceTree, Scratch, arrivals_length, record_refit};
use crate::bvh::SahModel;
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing};
use prbvh_kernel::cost::{COST_CHUNK, CostParams, NO_REFIT};
use prbvh_kernel::status::REPORT_WORDS;
use prbvh_kernel::{Kernel, grid};

/// Sums of half areas, scene units².
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TreeAreas {
    /// Of the root alone.
    pub root: f64,
    /// Of all leaves.
    pub leaves: f64,
    /// Of all internal nodes, the root among them.
    pub internal: f64,
}

impl TreeAreas {
    /// SAH cost with one triangle per leaf. Where the root has no area every ratio counts as 1, as in [`crate::bvh`].
    pub(super) fn cost(&self, references: u32) -> f64 {
        let SahModel { c_traversal, c_intersect } = SahModel::default();
        if self.root > 0.0 {
            (c_traversal * self.internal + c_intersect * self.leaves) / self.root
        } else {
            c_traversal * f64::from(references - 1) + c_intersect * f64::from(references)
        }
    }

    /// What `area` less is worth.
    pub(super) fn cost_of(&self, area: f64) -> f64 {
        if self.root > 0.0 { SahModel::default().c_traversal * area / self.root } else { 0.0 }
    }
}

/// The sums of the areas of a tree whose boxes are right, as its builder left them.
///
/// # Errors
/// If [`DeviceTree::check`] finds fault with the tree, or the device fails.
pub fn measure(device: &mut dyn Device, tree: &DeviceTree) -> Result<(TreeAreas, Vec<Timing>), OptimizeError> {
    tree.check(device)?;
    Ok(measure_unchecked(device, tree)?)
}

/// [`measure`] of a tree that this library made.
#[doc(hidden)]
pub fn measure_unchecked(device: &mut dyn Device, tree: &DeviceTree) -> Result<(TreeAreas, Vec<Timing>), DeviceError> {
    let device = &mut Lease::new(device);
    let mut scratch = Scratch::default();
    let report = scratch.allocate(device, "report", REPORT_WORDS as usize, 4)?;
    let mut measure = Measure::new(device, &mut scratch, tree, &report)?;
    measure.arrived = NO_REFIT;
    let measured = measure.areas(device, Recording::new())?;
    scratch.free(device);
    Ok(measured)
}

/// Measures a tree on its device.
#[derive(Debug)]
pub(super) struct Measure {
    nodes: Buffer,
    references: u32,
    pub(super) arrivals: Buffer,
    /// What the last refit left in `arrivals`.
    arrived: u32,
    partial: Buffer,
    report: Buffer,
}

impl Measure {
    /// `report` gets faults in its first row.
    pub(super) fn new(
        device: &mut dyn Device,
        scratch: &mut Scratch,
        tree: &DeviceTree,
        report: &Buffer,
    ) -> Result<Self, DeviceError> {
        // The first sums are of the root, the leaves and the internal nodes.
        let chunks = tree.nodes.length.div_ceil(COST_CHUNK as usize) + 2;
        Ok(Self {
            nodes: tree.nodes.clone(),
            references: tree.references,
            arrivals: scratch.allocate(device, "arrivals", arrivals_length(tree.references), 4)?,
            arrived: 0,
            partial: scratch.allocate(device, "partial sums", chunks, 4)?,
            report: report.clone(),
        })
    }

    fn internal(&self) -> u32 {
        self.references - 1
    }

    /// Records that all boxes are made anew.
    pub(super) fn record_refit(&mut self, recording: &mut Recording) {
        record_refit(recording, self.references, &self.nodes, &self.arrivals);
        self.arrived = 2;
    }

    /// Takes note that a climb that makes all boxes anew is recorded.
    pub(super) fn is_climbed(&mut self) {
        self.arrived = 2;
    }

    /// Partial sums of all nodes; that of the root alone comes after them.
    fn chunks(&self) -> u32 {
        self.internal().div_ceil(COST_CHUNK) + self.references.div_ceil(COST_CHUNK)
    }

    /// Records what [`Measure::read_areas`] reads, after a refit; from here on only paths are refitted.
    pub(super) fn record_areas(&mut self, recording: &mut Recording) {
        let (internal, leaves) = (self.internal(), self.references);
        let chunks = self.chunks();
        self.record_sum(recording, 0, internal, 0);
        self.record_sum(recording, internal, leaves, internal.div_ceil(COST_CHUNK));
        self.record_sum(recording, 0, 1, chunks);
        self.record_no_arrivals(recording);
        recording.fetch("cost", &self.partial, 4 * (chunks as usize + 1));
        recording.fetch("cost", &self.report, 4 * REPORT_WORDS as usize);
    }

    /// Records that nobody has come to a node, after a refit of all: as a refit of paths finds it.
    pub(super) fn record_no_arrivals(&mut self, recording: &mut Recording) {
        recording.clear("refit", &self.arrivals);
        self.arrived = 0;
    }

    /// All sums of the tree as it comes, refitted whole.
    pub(super) fn refitted_areas(&mut self, device: &mut dyn Device) -> Result<(TreeAreas, Vec<Timing>), DeviceError> {
        let mut recording = Recording::new();
        self.record_refit(&mut recording);
        self.areas(device, recording)
    }

    /// All sums of the tree after what is recorded.
    pub(super) fn areas(
        &mut self,
        device: &mut dyn Device,
        mut recording: Recording,
    ) -> Result<(TreeAreas, Vec<Timing>), DeviceError> {
        self.record_areas(&mut recording);
        let timings = device.run(&recording)?;
        Ok((self.read_areas(device)?, timings))
    }

    /// The sums that were recorded last.
    pub(super) fn read_areas(&self, device: &mut dyn Device) -> Result<TreeAreas, DeviceError> {
        let mut partial = vec![0.0f32; self.chunks() as usize + 1];
        device.download(&self.partial, bytemuck::cast_slice_mut(&mut partial))?;
        let (internal, rest) = partial.split_at(self.internal().div_ceil(COST_CHUNK) as usize);
        let (leaves, root) = rest.split_at(rest.len() - 1);
        Ok(TreeAreas { root: sum(root), leaves: sum(leaves), internal: sum(internal) })
    }

    /// Records a sum that looks, after a refit of all, whether it came to every node.
    pub(super) fn record_internal(&self, recording: &mut Recording) {
        self.record_sum(recording, 0, self.internal(), 0);
    }

    /// Records the sums of the half areas of `nodes` nodes from `first` on, for `partial` from `to` on.
    fn record_sum(&self, recording: &mut Recording, first: u32, nodes: u32, to: u32) {
        let count = grid::invocations(nodes.div_ceil(COST_CHUNK));
        let params = CostParams { count, first, nodes, internal: self.internal(), to, arrived: self.arrived };
        let buffers = [&self.nodes, &self.arrivals, &self.partial, &self.report];
        recording.dispatch("cost", Kernel::Cost, count, &params, &buffers);
    }
}

/// Sum of partial sums, in f64.
fn sum(partial: &[f32]) -> f64 {
    partial.iter().copied().map(f64::from).sum()
}

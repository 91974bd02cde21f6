//! PLOC: rounds of nearest neighbour search and merging over the Morton order (Meister & Bittner 2017).

use super::codes::Codes;
use super::order::MortonOrder;
use super::{DeviceTree, Input, Scratch};
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing};
use prbvh_kernel::ploc::merge::{MOST_GROUPS, MergeParams};
use prbvh_kernel::ploc::nearest::NearestParams;
use prbvh_kernel::ploc::{Cluster, ClustersParams, Progress};
use prbvh_kernel::{Kernel, grid};
use std::num::NonZeroU32;

/// Radius where none is asked for. Over ten scenes (1,000 to 330,000 triangles) the mean cost was 0.8 % higher with 10 and 0.7 % lower with
/// 50, which searches three times as many pairs.
pub const DEFAULT_RADIUS: NonZeroU32 = NonZeroU32::new(16).expect("not 0");

/// From so many clusters on the host asks after each round how many are left: the work of a round is then dearer than the question.
const ASK_EVERY_ROUND: u32 = 1 << 16;

/// Rounds between questions below that. A round does not know how many clusters the rounds before it left, so each of
/// them is dispatched for as many as there were at the last question.
const ROUNDS_UNASKED: u32 = 8;

/// Builds a tree over `triangles`, whose coordinates are in the safe range (`crate::scene::SafeRange`); a cluster looks for its
/// nearest neighbour `radius` places to the left and to the right. Returns the tree with the times of its stages and with the rounds it took.
/// Triangles that are handed over are freed as soon as the device has them.
///
/// # Errors
/// If there are no triangles, they do not fit the device or [are out of range](crate::scene::SafeRange::check), or the device fails.
pub fn ploc<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
    radius: NonZeroU32,
) -> Result<(DeviceTree, Vec<Timing>, Progress), DeviceError> {
    let device = &mut Lease::new(device);
    let mut recording = Recording::new();
    let (mut sorted, mut timings) = MortonOrder::record(&mut recording, device, triangles.into(), codes.into())?;
    timings.extend(device.run(&recording)?);
    sorted.free_codes(device);

    let n = sorted.references;
    let tree = DeviceTree::allocate(device, n)?;
    let mut recording = Recording::new();
    sorted.record_leaves(&mut recording, "leaves", &tree.nodes);
    let mut scratch = Scratch::default();
    let list = List::allocate(&mut scratch, device, n)?;
    let params = ClustersParams { count: n };
    let buffers = [&sorted.order, &sorted.boxes, &list.clusters, &list.progress];
    recording.dispatch("leaves", Kernel::PlocClusters, n, &params, &buffers);
    list.record_ask(&mut recording);
    timings.extend(device.run(&recording)?);
    let begun = list.ask(device)?;
    sorted.free(device);

    let mut rounds = Rounds {
        radius: radius.get(),
        nodes: tree.nodes.clone(),
        lists: [list, List::allocate(&mut scratch, device, n)?],
        neighbours: scratch.allocate(device, "neighbours", n as usize, 4)?,
        marks: scratch.allocate(device, "marks", n as usize, 4)?,
        groups: device.info().busy_workgroups().min(MOST_GROUPS),
        gone: scratch.allocate(device, "marks of chunks", MOST_GROUPS as usize, 4)?,
    };
    let progress = rounds.run(device, begun, &mut timings)?;
    tracing::debug!("PLOC: {} rounds, {} of them paired the list", progress.rounds, progress.paired_rounds);
    scratch.free(device);
    device.keep();
    Ok((tree, timings, progress))
}

/// The clusters between two rounds.
#[derive(Debug)]
struct List {
    clusters: Buffer,
    progress: Buffer,
}

impl List {
    fn allocate(scratch: &mut Scratch, device: &mut dyn Device, n: u32) -> Result<Self, DeviceError> {
        Ok(Self {
            clusters: scratch.allocate(device, "clusters", n as usize, size_of::<Cluster>())?,
            progress: scratch.allocate(device, "progress", 1, size_of::<Progress>())?,
        })
    }

    /// Records that the host will ask.
    fn record_ask(&self, recording: &mut Recording) {
        recording.fetch("merge", &self.progress, size_of::<Progress>());
    }

    fn ask(&self, device: &mut dyn Device) -> Result<Progress, DeviceError> {
        let mut progress = Progress::default();
        device.download(&self.progress, bytemuck::bytes_of_mut(&mut progress))?;
        Ok(progress)
    }
}

#[derive(Debug)]
struct Rounds {
    radius: u32,
    nodes: Buffer,
    /// Where the next round reads, and where it writes.
    lists: [List; 2],
    neighbours: Buffer,
    marks: Buffer,
    /// Most chunks of a round.
    groups: u32,
    gone: Buffer,
}

impl Rounds {
    fn run(
        &mut self,
        device: &mut dyn Device,
        begun: Progress,
        timings: &mut Vec<Timing>,
    ) -> Result<Progress, DeviceError> {
        let mut progress = begun;
        while progress.clusters > 1 {
            let most = progress.clusters;
            let mut recording = Recording::new();
            for _ in 0..if most < ASK_EVERY_ROUND { ROUNDS_UNASKED } else { 1 } {
                self.record_round(&mut recording, most);
            }
            self.lists[0].record_ask(&mut recording);
            timings.extend(device.run(&recording)?);
            progress = self.lists[0].ask(device)?;
            // Every round merges a pair; one that does not would be repeated for ever.
            if !(1..most).contains(&progress.clusters) {
                return Err(DeviceError::Kernel {
                    kernel: Kernel::PlocMerge.info().name,
                    problem: format!("a round made {} clusters out of {most}", progress.clusters),
                    device: device.info().name.clone(),
                });
            }
        }
        Ok(progress)
    }

    /// Records a round over at most `most` clusters.
    fn record_round(&mut self, recording: &mut Recording, most: u32) {
        let [list, next] = &self.lists;
        let (neighbours, marks, gone) = (&self.neighbours, &self.marks, &self.gone);
        let params = NearestParams { count: most, radius: self.radius };
        let buffers = [&list.clusters, &list.progress, neighbours];
        recording.dispatch("nearest", Kernel::PlocNearest, most, &params, &buffers);
        let chunk = most.div_ceil(self.groups).max(grid::WORKGROUP_SIZE);
        let chunks = most.div_ceil(chunk);
        let params = MergeParams { count: grid::invocations(chunks), chunk, chunks };
        let (clusters, progress) = (&list.clusters, &list.progress);
        let buffers = [neighbours, progress, marks, gone];
        recording.dispatch("merge", Kernel::PlocMark, params.count, &params, &buffers);
        let nodes = &self.nodes;
        let buffers = [neighbours, marks, gone, clusters, progress, nodes, &next.clusters, &next.progress];
        recording.dispatch("merge", Kernel::PlocMerge, params.count, &params, &buffers);
        self.lists.swap(0, 1);
    }
}

//! Passes over the treelets of a tree: which they are, and a dispatch for each level of them. What becomes of a treelet is a kernel's.

use super::sort::Sorter;
use super::{Codes, DeviceTree, Input, Scratch, lbvh};
use crate::device::{Buffer, Device, DeviceError, Recording, Timing};
use prbvh_kernel::Kernel;
use prbvh_kernel::atrbvh::{LevelsParams, RestructureParams};
use prbvh_kernel::status::{APPLIED, FAULTS, REPORT_WORDS};

/// What a pass over the tree did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Pass {
    /// Fewest references below a treelet root.
    pub gamma: u32,
    /// Treelets that were processed.
    pub treelets: u32,
    /// Dispatches that this took: the most treelet roots between the root and a leaf.
    pub levels: u32,
    /// Treelets that were replaced by cheaper ones.
    pub restructured: u32,
}

/// What the restructuring of a tree did.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Restructured {
    /// The passes in their order; none where the tree has only one shape.
    pub passes: Vec<Pass>,
    /// Time of every command.
    pub timings: Vec<Timing>,
}

/// Levels of one submission. A tree may be a chain, and a command buffer should stay small.
const LEVELS_AT_ONCE: usize = 512;

/// Fewest references that more than one tree is possible over.
const FEWEST: u32 = 3;

/// How treelets become better.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    /// For people.
    pub(super) name: &'static str,
    /// What is done with a treelet.
    pub(super) kernel: Kernel,
    /// Most leaves of a treelet.
    pub(super) treelet: u32,
    /// Most passes.
    pub(super) most_passes: u32,
}

/// An LBVH that is restructured, with the times of its stages and the passes.
pub(super) fn lbvh_by<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
    way: Way,
) -> Result<(DeviceTree, Vec<Timing>, Vec<Pass>), DeviceError> {
    let (tree, mut timings) = lbvh(device, triangles, codes)?;
    match restructure_by(device, &tree, way, &mut |_, _| {}) {
        Ok(restructured) => {
            timings.extend(restructured.timings);
            Ok((tree, timings, restructured.passes))
        }
        Err(error) => {
            tree.free(device);
            Err(error)
        }
    }
}

/// Restructures a tree in place: passes of which the first takes treelets below every node of at least as many references as a treelet has leaves, and
/// each further one doubles that bound (γ), until it is beyond the tree, a pass changed nothing, or enough were made.
pub(super) fn restructure_by(
    device: &mut dyn Device,
    tree: &DeviceTree,
    way: Way,
    observe: &mut dyn FnMut(&Pass, &mut dyn Device),
) -> Result<Restructured, DeviceError> {
    let mut result = Restructured::default();
    if tree.references < FEWEST {
        return Ok(result);
    }
    let mut scratch = Scratch::default();
    let done = Passes::new(&mut scratch, device, tree, way).and_then(|passes| {
        let mut gamma = passes.treelet;
        for _ in 0..way.most_passes {
            if gamma > tree.references {
                break;
            }
            let pass = passes.run(device, gamma, &mut result.timings)?;
            result.passes.push(pass);
            observe(&pass, device);
            tracing::debug!(
                "{}: γ {gamma}, {} of {} treelets restructured, {} levels",
                way.name,
                pass.restructured,
                pass.treelets,
                pass.levels
            );
            if pass.restructured == 0 {
                break;
            }
            gamma = gamma.saturating_mul(2);
        }
        Ok(())
    });
    scratch.free(device);
    done.map(|()| result)
}

#[derive(Debug)]
struct Passes<'a> {
    tree: &'a DeviceTree,
    kernel: Kernel,
    treelet: u32,
    sizes: Buffer,
    levels: Buffer,
    order: Buffer,
    counts: Buffer,
    arrivals: Buffer,
    report: Buffer,
    sorter: Sorter,
}

impl<'a> Passes<'a> {
    fn new(
        scratch: &mut Scratch,
        device: &mut dyn Device,
        tree: &'a DeviceTree,
        way: Way,
    ) -> Result<Self, DeviceError> {
        let internal = tree.references - 1;
        let mut words = |label, length| scratch.allocate(device, label, length as usize, 4);
        Ok(Self {
            tree,
            kernel: way.kernel,
            treelet: way.treelet.min(tree.references),
            sizes: words("sizes", internal)?,
            levels: words("levels", internal)?,
            order: words("treelet roots", internal)?,
            counts: words("treelets per level", tree.references)?,
            arrivals: words("arrivals", internal)?,
            report: words("report", REPORT_WORDS)?,
            sorter: Sorter::new(scratch, device, internal)?,
        })
    }

    fn run(&self, device: &mut dyn Device, gamma: u32, timings: &mut Vec<Timing>) -> Result<Pass, DeviceError> {
        let counts = self.find_levels(device, gamma, timings)?;
        let levels = u32::try_from(counts.len()).expect("fewer levels than nodes");
        let internal = self.tree.references - 1;
        let treelets: u32 = counts.iter().sum();

        let mut recording = Recording::new();
        let differing = u32::MAX >> levels.leading_zeros();
        self.sorter.record(&mut recording, &self.levels, &self.order, differing);
        recording.clear("restructure", &self.report);
        // The nodes that are no treelet roots have level 0 and come first.
        let mut first = internal - treelets;
        for some in counts.chunks(LEVELS_AT_ONCE) {
            for &count in some {
                let params = RestructureParams { count, first, treelet: self.treelet, internal };
                let buffers = [&self.order, &self.tree.nodes, &self.report];
                recording.dispatch("restructure", self.kernel, count, &params, &buffers);
                first += count;
            }
            recording.fetch("restructure", &self.report, 4 * REPORT_WORDS as usize);
            timings.extend(device.run(&std::mem::take(&mut recording))?);
        }
        let mut report = [0u32; REPORT_WORDS as usize];
        device.download(&self.report, bytemuck::cast_slice_mut(&mut report))?;
        if report[FAULTS] != 0 {
            let problem = "the device ended the work on a treelet before it was done".to_owned();
            return Err(fault(device, self.kernel, problem));
        }
        Ok(Pass { gamma, treelets, levels, restructured: report[APPLIED] })
    }

    /// Fills `levels` and `order`. Returns the treelets of each level from 1 on.
    fn find_levels(
        &self,
        device: &mut dyn Device,
        gamma: u32,
        timings: &mut Vec<Timing>,
    ) -> Result<Vec<u32>, DeviceError> {
        let n = self.tree.references;
        let mut recording = Recording::new();
        recording.clear("levels", &self.counts);
        recording.clear("levels", &self.arrivals);
        let params = LevelsParams { count: n, gamma };
        let buffers = [&self.tree.nodes, &self.sizes, &self.levels, &self.order, &self.counts, &self.arrivals];
        recording.dispatch("levels", Kernel::AtrbvhLevels, n, &params, &buffers);
        recording.fetch("levels", &self.counts, 4 * LEVELS_AT_ONCE.min(self.counts.length));
        timings.extend(device.run(&recording)?);
        let mut levels = 0u32;
        device.download(&self.counts, bytemuck::bytes_of_mut(&mut levels))?;
        if levels == 0 {
            let problem = "not every leaf reached the root: the nodes are no tree, or it is too deep for the device";
            return Err(fault(device, Kernel::AtrbvhLevels, problem.to_owned()));
        }
        let mut counts = vec![0u32; levels as usize + 1];
        device.download(&self.counts, bytemuck::cast_slice_mut(&mut counts))?;
        counts.remove(0);
        Ok(counts)
    }
}

fn fault(device: &dyn Device, kernel: Kernel, problem: String) -> DeviceError {
    DeviceError::Kernel { kernel: kernel.info().name, problem, device: device.info().name.clone() }
}

//! A device that does nothing but count: what a stage would allocate and run.

use super::{Omission, PhaseBytes};
use crate::build::{self, Codes, DeviceTree};
use crate::collapse;
use crate::device::{Buffer, Command, Device, DeviceError, DeviceInfo, Fill, MemoryUse, Recording, Timing, Traffic};
use crate::optimize::{
    Limits, Order, PrbvhSettings, RotationSettings, later_kernels, prbvh_unchecked, rotations_unchecked,
};
use crate::presplit;
use crate::settings::Initial;
use crate::trace::TraceScene;
use crate::wide::{self, Layout, WideSettings, Width};
use prbvh_kernel::Kernel;
use prbvh_kernel::setup::Triangle;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Runs the stages' own code, so that an estimate cannot differ from what they allocate. Nothing is computed: what is read back is 0.
#[derive(Debug)]
pub(super) struct DryDevice {
    info: DeviceInfo,
    memory: MemoryUse,
    largest: Option<Buffer>,
    dispatches: u64,
    iterations: u64,
    kernels: BTreeSet<Kernel>,
}

/// What a stage took.
#[derive(Clone, Debug, Default)]
pub(super) struct Taken {
    pub(super) peak_bytes: u64,
    pub(super) dispatches: u64,
    /// Iterations that were made: an optimiser ends early where it finds nothing to do.
    pub(super) iterations: u64,
    /// Those that it runs on some data are among them.
    pub(super) kernels: BTreeSet<Kernel>,
}

/// Kernels of stages that go on by what they read back, and nothing is to be read here.
const ROUNDS: [Kernel; 3] = [Kernel::PlocNearest, Kernel::PlocMark, Kernel::PlocMerge];
#[cfg(feature = "atrbvh")]
const TREELETS: [Kernel; 2] = [Kernel::AtrbvhLevels, Kernel::AtrbvhRestructure];
#[cfg(feature = "atrbvh")]
const OPTIMAL: [Kernel; 2] = [Kernel::AtrbvhLevels, Kernel::TrbvhRestructure];
const COLLAPSE: [Kernel; 4] =
    [Kernel::CollapseSizes, Kernel::CollapsePlaces, Kernel::CollapseJump, Kernel::CollapseEmit];
const PRESPLIT: [Kernel; 4] =
    [Kernel::PresplitPriorities, Kernel::PresplitSums, Kernel::PresplitPlaces, Kernel::PresplitPieces];

impl DryDevice {
    /// A device like the one with `info`, but without its limits.
    pub(super) fn new(info: &DeviceInfo) -> Self {
        let info = DeviceInfo { max_buffer_bytes: u64::MAX, memory_bytes: 0, ..info.clone() };
        Self {
            info,
            memory: MemoryUse::default(),
            largest: None,
            dispatches: 0,
            iterations: 0,
            kernels: BTreeSet::new(),
        }
    }

    pub(super) fn taken(&self) -> Taken {
        Taken {
            peak_bytes: self.memory.peak_bytes,
            dispatches: self.dispatches,
            iterations: self.iterations,
            kernels: self.kernels.clone(),
        }
    }

    pub(super) fn phase(&self, phase: String, runs: bool) -> PhaseBytes {
        let (label, bytes) = self.largest.as_ref().map_or(("", 0), |buffer| (buffer.label, buffer.bytes()));
        PhaseBytes {
            phase,
            runs,
            peak_bytes: self.memory.peak_bytes,
            largest_buffer: label,
            largest_buffer_bytes: bytes,
        }
    }

    /// Builds the initial tree.
    pub(super) fn build(&mut self, initial: &Initial, codes: Codes, triangles: &[Triangle]) -> Result<(), DeviceError> {
        let tree = match initial {
            Initial::Lbvh => build::lbvh(self, triangles, codes)?.0,
            Initial::Ploc { radius } => {
                let (tree, _, _) = build::ploc(self, triangles, codes, *radius)?;
                if triangles.len() > 1 {
                    self.kernels.extend(ROUNDS);
                }
                tree
            }
            #[cfg(feature = "atrbvh")]
            Initial::Atrbvh { treelet } => {
                let (tree, _) = build::lbvh(self, triangles, codes)?;
                // Ends as soon as it sees that nothing was computed, but all its buffers are there by then.
                if let Err(error @ (DeviceError::Limit { .. } | DeviceError::OutOfMemory { .. })) =
                    build::restructure_unchecked(self, &tree, *treelet, &mut |_, _| {})
                {
                    return Err(error);
                }
                if triangles.len() > 2 {
                    self.kernels.extend(TREELETS.into_iter().chain(build::sort_kernels(&self.info)));
                }
                tree
            }
            #[cfg(feature = "atrbvh")]
            Initial::Trbvh { passes } => {
                let (tree, _) = build::lbvh(self, triangles, codes)?;
                // As above.
                if let Err(error @ (DeviceError::Limit { .. } | DeviceError::OutOfMemory { .. })) =
                    build::restructure_optimally_unchecked(self, &tree, *passes, &mut |_, _| {})
                {
                    return Err(error);
                }
                if triangles.len() > 2 {
                    self.kernels.extend(OPTIMAL.into_iter().chain(build::sort_kernels(&self.info)));
                }
                tree
            }
            Initial::Hploc { radius } => build::hploc(self, triangles, codes, *radius)?.0,
            Initial::KMeans { kmeans } => build::kmeans_unchecked(self, triangles, codes, kmeans)?.0,
            _ => self.tree(triangles.len())?,
        };
        tree.free(self);
        Ok(())
    }

    /// Optimises by PRBVH, in so many iterations.
    pub(super) fn optimize(
        &mut self,
        triangles: usize,
        settings: PrbvhSettings,
        iterations: u32,
    ) -> Result<(), DeviceError> {
        let tree = self.tree(triangles)?;
        let settings = PrbvhSettings { limits: Limits::iterations(iterations), ..settings };
        if settings.order == Order::WorstFirst && iterations > 0 && tree.references > 1 {
            self.kernels.extend(later_kernels(&self.info, tree.references - 1, &settings.worst_first));
        }
        let outcome = prbvh_unchecked(self, &tree, None, &settings, &mut |_, _, _| ControlFlow::Continue(()))?;
        self.iterations = outcome.rows.len() as u64 - 1;
        tree.free(self);
        Ok(())
    }

    /// Optimises by rotations, in so many passes.
    pub(super) fn rotate(
        &mut self,
        triangles: usize,
        settings: &RotationSettings,
        passes: u32,
    ) -> Result<(), DeviceError> {
        let tree = self.tree(triangles)?;
        let settings = RotationSettings { limits: Limits::iterations(passes), ..settings.clone() };
        let outcome = rotations_unchecked(self, &tree, None, &settings, &mut |_, _, _| ControlFlow::Continue(()))?;
        self.iterations = outcome.rows.len() as u64 - 1;
        if settings.annealing_passes > 0 && triangles > 2 {
            self.kernels.insert(Kernel::KeptRestore);
        }
        tree.free(self);
        Ok(())
    }

    /// The tree alone.
    pub(super) fn hold_tree(&mut self, triangles: usize) -> Result<(), DeviceError> {
        let tree = self.tree(triangles)?;
        tree.free(self);
        Ok(())
    }

    pub(super) fn collapse(&mut self, triangles: usize) -> Result<(), DeviceError> {
        let tree = self.tree(triangles)?;
        collapse::reserve(self, tree.references)?;
        self.kernels.extend(COLLAPSE);
        tree.free(self);
        Ok(())
    }

    /// Makes nodes of several children of a tree of so many leaves at most.
    pub(super) fn widen(&mut self, leaves: usize, settings: &WideSettings) -> Result<(), DeviceError> {
        wide::reserve(self, leaves, settings)?;
        self.kernels.insert(Kernel::CollapseWiden);
        Ok(())
    }

    /// Splits triangles into so many references at most.
    pub(super) fn presplit(&mut self, triangles: usize, references: usize) -> Result<(), DeviceError> {
        presplit::reserve(self, triangles, references)?;
        self.kernels.extend(PRESPLIT);
        Ok(())
    }

    pub(super) fn trace(&mut self, triangles: usize) -> Result<(), DeviceError> {
        TraceScene::reserve(self, triangles)
    }

    pub(super) fn trace_wide(&mut self, triangles: usize, width: Width, layout: Layout) -> Result<(), DeviceError> {
        TraceScene::reserve_wide(self, triangles, width, layout)
    }

    fn tree(&mut self, triangles: usize) -> Result<DeviceTree, DeviceError> {
        build::check_limits(&self.info, triangles)?;
        DeviceTree::allocate(self, u32::try_from(triangles).expect("checked against the limit of indices"))
    }
}

impl Device for DryDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        let buffer = Buffer::new(label, length, element_bytes);
        self.memory.bytes += buffer.bytes();
        self.memory.peak_bytes = self.memory.peak_bytes.max(self.memory.bytes);
        if self.largest.as_ref().is_none_or(|largest| largest.bytes() < buffer.bytes()) {
            self.largest = Some(buffer.clone());
        }
        Ok(buffer)
    }

    fn free(&mut self, buffer: Buffer) {
        self.memory.bytes -= buffer.bytes();
    }

    fn upload(&mut self, _: &Buffer, _: &[u8]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn upload_with(&mut self, _: &Buffer, _: usize, _: Fill<'_>) -> Result<(), DeviceError> {
        Ok(())
    }

    fn download_from(&mut self, _: &Buffer, _: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        bytes.fill(0);
        Ok(())
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        for (_, command) in recording.commands() {
            if let Command::Dispatch(dispatch) = command {
                self.dispatches += 1;
                self.kernels.insert(dispatch.kernel);
            }
        }
        Ok(Vec::new())
    }

    fn memory(&self) -> MemoryUse {
        self.memory
    }

    fn traffic(&self) -> Traffic {
        Traffic { dispatches: self.dispatches, ..Traffic::default() }
    }
}

/// What `without` took beyond `with`.
pub(super) fn saving(without: &Taken, with: &Taken) -> super::Saving {
    super::Saving {
        bytes: without.peak_bytes.saturating_sub(with.peak_bytes),
        dispatches: without.dispatches.saturating_sub(with.dispatches),
        ..super::Saving::default()
    }
}

/// The codes that a run sorts by if these omissions are kept in.
pub(super) fn codes_with(enough: Codes, asked: Codes, keep: &[Omission]) -> Codes {
    let bits = if keep.contains(&Omission::LowerCodes) { asked.bits } else { enough.bits };
    if keep.contains(&Omission::EqualBits) { Codes { bits, ..asked } } else { Codes { bits, ..enough } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::MortonBits;
    use crate::device::DeviceKind;
    use bytemuck::Zeroable;

    const GIB: u64 = 1 << 30;

    /// A GPU as many have.
    fn of_8_gib() -> DeviceInfo {
        let info = DeviceInfo::new("of 8 GiB", DeviceKind::VulkanGpu);
        DeviceInfo {
            atomics_64: true,
            busy_invocations: 1 << 16,
            max_buffer_bytes: 2 * GIB - 1,
            max_buffer_limit: "maxStorageBufferRange",
            memory_bytes: 8 * GIB,
            ..info
        }
    }

    /// What stages take over so many triangles.
    fn phases(triangles: usize) -> Vec<PhaseBytes> {
        let info = of_8_gib();
        // Nobody reads them.
        let zeros = vec![Triangle::zeroed(); triangles];
        let phase = |name: &str, stage: &dyn Fn(&mut DryDevice) -> Result<(), DeviceError>| {
            let mut dry = DryDevice::new(&info);
            stage(&mut dry).unwrap();
            dry.phase(name.to_owned(), true)
        };
        let codes = Codes::from(MortonBits::Sixty);
        let initials = [
            Initial::Lbvh,
            Initial::Ploc { radius: build::DEFAULT_RADIUS },
            Initial::Hploc { radius: build::DEFAULT_HPLOC_RADIUS },
            #[cfg(feature = "atrbvh")]
            Initial::Atrbvh { treelet: build::TreeletSize::DEFAULT },
        ];
        let mut phases: Vec<PhaseBytes> =
            initials.iter().map(|initial| phase(&initial.method(), &|dry| dry.build(initial, codes, &zeros))).collect();
        for settings in [PrbvhSettings::default(), PrbvhSettings::published()] {
            let name = settings.order.to_string();
            phases.push(phase(&name, &|dry| dry.optimize(triangles, settings.clone(), 1)));
        }
        phases.push(phase("collapse", &|dry| dry.collapse(triangles)));
        phases.push(phase("trace", &|dry| dry.trace(triangles)));
        phases.push(phase("presplit", &|dry| dry.presplit(triangles, triangles + triangles / 5)));
        phases
    }

    #[test]
    fn twenty_million_triangles_fit_into_8_gib() {
        let triangles = 20_000_000;
        for phase in phases(triangles) {
            println!("{}: {} bytes a triangle", phase.phase, phase.peak_bytes / triangles as u64);
            phase.check(&of_8_gib(), triangles).unwrap();
            // The driver and a picture want some, too.
            assert!(2 * phase.peak_bytes < 8 * GIB, "{phase:?}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_by_the_name_of_the_limit() {
        let info = of_8_gib();
        let mut phases = phases(50_000_000);
        // Presplitting has no tree.
        phases.pop();
        let refused = |info: &DeviceInfo| -> Vec<String> {
            phases.iter().map(|phase| phase.check(info, 50_000_000).unwrap_err().to_string()).collect()
        };
        for error in refused(&info) {
            assert!(error.contains("needs maxStorageBufferRange of at least"), "{error}");
        }
        let large = DeviceInfo { max_buffer_bytes: 64 * GIB, memory_bytes: 4 * GIB, ..info };
        for error in refused(&large) {
            assert!(error.contains("needs device memory of at least"), "{error}");
        }
    }
}

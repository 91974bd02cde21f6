//! Turns a recording into one submission.

use super::buffers::Buffers;
use super::descriptors::{Bindings, DescriptorSets};
use super::fetched::Fetched;
use super::logical::LogicalDevice;
use super::memory::{Allocation, Range};
use super::pipeline::{Handles, Pipelines};
use super::submit::{Submitter, barrier_between};
use super::timestamps::Timestamps;
use crate::device::{Command, DeviceError, Dispatch, Recording, Timing};
use ash::vk;
use prbvh_kernel::{Kernel, grid};
use std::sync::Arc;

/// What recordings need beside their buffers.
pub(super) struct Runner {
    pipelines: Pipelines,
    sets: DescriptorSets,
    timestamps: Option<Timestamps>,
    fetched: Fetched,
}

/// A command with its handles, all alive until the run has ended.
enum Step<'a> {
    Dispatch { handles: Handles, set: usize, push: &'a [u8], groups: Groups },
    Clear(Range),
    Copy { from: vk::Buffer, to: vk::Buffer, region: vk::BufferCopy },
    Nothing,
}

/// How many workgroups there are.
#[derive(Clone, Copy)]
enum Groups {
    Of([u32; 3]),
    /// As three words of a buffer say, from a byte on.
    In(vk::Buffer, u64),
}

impl Runner {
    /// Nothing run yet.
    pub(super) fn new(
        device: &Arc<LogicalDevice>,
        pipelines: Pipelines,
        timestamps: bool,
    ) -> Result<Self, DeviceError> {
        let timestamps = if timestamps { Timestamps::new(device, 64)? } else { None };
        let sets = DescriptorSets::new(device)?;
        Ok(Self { pipelines, sets, timestamps, fetched: Fetched::new(device)? })
    }

    /// Bytes that the last run fetched, if nothing has changed since.
    pub(super) fn fetched(&mut self, from: Range, first: usize, bytes: usize) -> Option<&[u8]> {
        self.fetched.get(from, first, bytes)
    }

    /// Says that a buffer changes or ends without a run.
    pub(super) fn forget_fetched(&mut self) {
        self.fetched.forget();
    }

    /// The pipeline of a kernel, made if it was not.
    pub(super) fn pipeline(&mut self, kernel: Kernel) -> Result<Handles, DeviceError> {
        self.pipelines.get(kernel)
    }

    /// The pipelines made so far.
    #[cfg(test)]
    pub(super) fn pipelines(&self) -> &Pipelines {
        &self.pipelines
    }

    /// Runs the commands one after another. Returns how long they took: of those of one label in a row the last has the time of all, since a timestamp is one more
    /// thing for a GPU to do between two short dispatches.
    pub(super) fn run(
        &mut self,
        submitter: &mut Submitter,
        buffers: &Buffers,
        recording: &Recording,
    ) -> Result<Vec<Timing>, DeviceError> {
        let commands = recording.commands();
        if commands.is_empty() {
            return Ok(Vec::new());
        }
        self.pipelines.make(commands.iter().filter_map(|(_, command)| match command {
            Command::Dispatch(dispatch) if dispatch.count > 0 => Some(dispatch.kernel),
            _ => None,
        }))?;
        self.fetched.reserve(buffers, commands)?;
        let mut bindings = Vec::new();
        let steps: Vec<_> =
            commands.iter().map(|(_, command)| self.step(buffers, command, &mut bindings)).collect::<Result<_, _>>()?;
        let sets = self.sets.make(&bindings)?;
        let is_last = |k: usize| commands.get(k + 1).is_none_or(|(next, _)| *next != commands[k].0);
        let stamps = 1 + (0..steps.len()).filter(|&k| is_last(k)).count() as u32;
        if let Some(timestamps) = &mut self.timestamps {
            timestamps.reserve(stamps)?;
        }

        let timestamps = self.timestamps.as_ref();
        let ran = submitter.submit(|device, commands| {
            if let Some(timestamps) = timestamps {
                timestamps.begin(device, commands, stamps);
            }
            let mut stamp = 0;
            for (k, step) in steps.iter().enumerate() {
                if k > 0 && !matches!(step, Step::Nothing) {
                    barrier_between(device, commands);
                }
                step.record(device, commands, &sets);
                if is_last(k) {
                    stamp += 1;
                    if let Some(timestamps) = timestamps {
                        timestamps.take(device, commands, stamp);
                    }
                }
            }
        });
        if ran.is_err() {
            self.fetched.forget();
        }
        ran?;

        let seconds = match timestamps {
            Some(timestamps) => timestamps.seconds(stamps)?,
            None => Vec::new(),
        };
        let mut seconds = seconds.into_iter();
        let mut timing = |k: usize| is_last(k).then(|| seconds.next()).flatten().unwrap_or(0.0);
        Ok((0..commands.len()).map(|k| Timing { label: commands[k].0, seconds: timing(k) }).collect())
    }

    fn step<'a>(
        &mut self,
        buffers: &Buffers,
        command: &'a Command,
        bindings: &mut Vec<Bindings>,
    ) -> Result<Step<'a>, DeviceError> {
        Ok(match command {
            Command::Dispatch(dispatch) => self.dispatch(buffers, dispatch, bindings)?,
            Command::Clear(buffer) => Step::Clear(buffers.find(buffer)?.range()),
            Command::Copy { from, to } => {
                let (source, target) = (buffers.find(from)?, buffers.find(to)?);
                // Vulkan knows no copies of nothing or of a buffer to itself; neither would change a byte.
                if from == to || source.bytes() == 0 {
                    Step::Nothing
                } else {
                    let (from, to) = (source.range(), target.range());
                    let region = vk::BufferCopy { src_offset: from.offset, dst_offset: to.offset, size: from.bytes };
                    Step::Copy { from: from.buffer, to: to.buffer, region }
                }
            }
            Command::Fetch { from, bytes } => {
                let source = buffers.find(from)?;
                match self.fetched.place(source, *bytes) {
                    Some((to, region)) => Step::Copy { from: source.range().buffer, to, region },
                    None => Step::Nothing,
                }
            }
        })
    }

    fn dispatch<'a>(
        &mut self,
        buffers: &Buffers,
        dispatch: &'a Dispatch,
        bindings: &mut Vec<Bindings>,
    ) -> Result<Step<'a>, DeviceError> {
        let bound = dispatch
            .buffers
            .iter()
            .map(|buffer| buffers.find(buffer).map(Allocation::range))
            .collect::<Result<_, _>>()?;
        if dispatch.count == 0 {
            return Ok(Step::Nothing);
        }
        let handles = self.pipeline(dispatch.kernel)?;
        let own = Bindings { layout: handles.set_layout, buffers: bound };
        // The rounds of a submission bind the same again and again.
        let set = bindings.iter().position(|bindings| *bindings == own).unwrap_or(bindings.len());
        if set == bindings.len() {
            bindings.push(own);
        }
        let groups = match &dispatch.counted {
            None => Groups::Of(grid::workgroups(dispatch.count)),
            Some(counted) => {
                let Range { buffer, offset, .. } = buffers.find(&counted.buffer)?.range();
                Groups::In(buffer, offset + 4 * (counted.word as u64 + 1))
            }
        };
        Ok(Step::Dispatch { handles, set, push: &dispatch.push, groups })
    }
}

impl Step<'_> {
    fn record(&self, device: &ash::Device, commands: vk::CommandBuffer, sets: &[vk::DescriptorSet]) {
        match *self {
            Self::Dispatch { handles, set, push, groups } => {
                let point = vk::PipelineBindPoint::COMPUTE;
                // SAFETY: the command buffer is being recorded; the pipeline lives until the run has ended.
                unsafe { device.cmd_bind_pipeline(commands, point, handles.pipeline) };
                // SAFETY: the set has the layout of the pipeline, and its buffers live until the run has ended.
                unsafe { device.cmd_bind_descriptor_sets(commands, point, handles.layout, 0, &[sets[set]], &[]) };
                // SAFETY: `Recording::dispatch` checked that the push constants have the size of the kernel's.
                unsafe {
                    device.cmd_push_constants(commands, handles.layout, vk::ShaderStageFlags::COMPUTE, 0, push);
                };
                match groups {
                    Groups::Of([x, y, z]) => {
                        // SAFETY: pipeline, set and push constants are bound, and `open` checked the limits of the largest grid.
                        unsafe { device.cmd_dispatch(commands, x, y, z) };
                    }
                    Groups::In(buffer, byte) => {
                        // SAFETY: as above; `Recording::dispatch_counted` checked that the words are in the buffer, and kernels write no
                        // larger grid than `grid::workgroups` makes.
                        unsafe { device.cmd_dispatch_indirect(commands, buffer, byte) };
                    }
                }
            }
            Self::Clear(range) => {
                // SAFETY: the command buffer is being recorded; the buffer lives until the run has ended.
                unsafe { device.cmd_fill_buffer(commands, range.buffer, range.offset, range.padded(), 0) };
            }
            Self::Copy { from, to, region } => {
                // SAFETY: the region lies in two different buffers, which live until the run has ended.
                unsafe { device.cmd_copy_buffer(commands, from, to, &[region]) };
            }
            Self::Nothing => {}
        }
    }
}

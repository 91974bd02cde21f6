//! Hands work to the queue and waits for its end.
//!
//! What only has to be done before the next work, zeros and bytes from the host, waits for it and goes in front: a submission by itself costs more than
//! most of these take.

use super::commands::Commands;
use super::error::{Call, failed};
use super::logical::LogicalDevice;
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;
use std::time::Duration;

/// After this long work is given up on.
const TIMEOUT: Duration = Duration::from_mins(10);
/// How often a wait that takes long is mentioned.
const SLICE: Duration = Duration::from_secs(10);

const WAIT: &str = "vkWaitForFences";

/// One command buffer, submitted again and again.
pub(super) struct Submitter {
    device: Arc<LogicalDevice>,
    commands: Commands,
    first: Vec<First>,
    submissions: u64,
    /// Those that nobody waited for at once.
    ahead: u64,
    /// What the next submission waits for: semaphores of the caller, and values of those that have a timeline.
    waits: Vec<(vk::Semaphore, u64)>,
}

/// What goes in front of the next work.
#[derive(Clone, Copy)]
enum First {
    Zero(vk::Buffer),
    Copy { from: vk::Buffer, to: vk::Buffer, region: vk::BufferCopy },
}

impl First {
    fn target(self) -> vk::Buffer {
        match self {
            Self::Zero(buffer) | Self::Copy { to: buffer, .. } => buffer,
        }
    }
}

impl Submitter {
    /// A command buffer for the queue of the device.
    pub(super) fn new(device: &Arc<LogicalDevice>) -> Result<Self, DeviceError> {
        let (device, commands) = (Arc::clone(device), Commands::new(device)?);
        Ok(Self { device, commands, first: Vec::new(), submissions: 0, ahead: 0, waits: Vec::new() })
    }

    /// How many submissions there were, and how many ahead.
    pub(super) fn submissions(&self) -> [u64; 2] {
        [self.submissions, self.ahead]
    }

    /// Has a buffer zeroed before the next work. It must live until then or until [`Submitter::forget`].
    pub(super) fn zero_first(&mut self, buffer: vk::Buffer) -> Result<(), DeviceError> {
        self.put_first(First::Zero(buffer))
    }

    /// Has bytes copied before the next work. Both buffers must live until then, or the target until [`Submitter::forget`]; the region lies in both.
    pub(super) fn copy_first(
        &mut self,
        from: vk::Buffer,
        to: vk::Buffer,
        region: vk::BufferCopy,
    ) -> Result<(), DeviceError> {
        self.put_first(First::Copy { from, to, region })
    }

    fn put_first(&mut self, first: First) -> Result<(), DeviceError> {
        self.check()?;
        self.first.push(first);
        Ok(())
    }

    /// Whether anything can still be done.
    fn check(&self) -> Result<(), DeviceError> {
        if self.device.is_abandoned() { Err(failed(WAIT, vk::Result::TIMEOUT)) } else { Ok(()) }
    }

    /// Leaves out what was to be done first with a buffer that is about to end.
    pub(super) fn forget(&mut self, buffer: vk::Buffer) {
        self.first.retain(|first| first.target() != buffer);
    }

    /// Does what is to be done first.
    pub(super) fn flush(&mut self) -> Result<(), DeviceError> {
        if self.first.is_empty() { Ok(()) } else { self.submit(|_, _| {}) }
    }

    /// Records commands, runs them and returns after their end. They see what the host and earlier submissions wrote, and the
    /// host sees what they wrote.
    pub(super) fn submit(&mut self, record: impl FnOnce(&ash::Device, vk::CommandBuffer)) -> Result<(), DeviceError> {
        self.submit_and_signal(record, &[])
    }

    /// The next submission waits for a semaphore; a binary one has value 0.
    pub(super) fn wait_for(&mut self, semaphore: vk::Semaphore, value: u64) {
        self.waits.push((semaphore, value));
    }

    /// Signals a semaphore after all submissions so far; a binary one has value 0.
    pub(super) fn signal(&mut self, semaphore: vk::Semaphore, value: u64) -> Result<(), DeviceError> {
        self.submit_and_signal(|_, _| {}, &[(semaphore, value)])
    }

    fn submit_and_signal(
        &mut self,
        record: impl FnOnce(&ash::Device, vk::CommandBuffer),
        signals: &[(vk::Semaphore, u64)],
    ) -> Result<(), DeviceError> {
        self.check()?;
        self.submissions += 1;
        let before = self.before();
        // SAFETY: the last submission has ended: this returns after its end.
        unsafe { self.send(&self.commands, before, record, signals) }?;
        self.wait(&self.commands)
    }

    /// As [`Submitter::submit`], but does not wait for the end: [`Submitter::wait`] does. What comes next runs after it.
    ///
    /// # Safety
    /// The last submission of `commands` has ended. Nothing that this one needs ends or is touched by the host before its end.
    pub(super) unsafe fn submit_ahead(
        &mut self,
        commands: &Commands,
        record: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) -> Result<(), DeviceError> {
        self.check()?;
        self.ahead += 1;
        let before = self.before();
        // SAFETY: the caller's duty.
        unsafe { self.send(commands, before, record, &[]) }
    }

    /// What a submission does first and waits for. Whatever becomes of it: nothing is done twice.
    fn before(&mut self) -> (Vec<First>, Vec<(vk::Semaphore, u64)>) {
        (std::mem::take(&mut self.first), std::mem::take(&mut self.waits))
    }

    /// Hands commands to the queue.
    ///
    /// # Safety
    /// As [`Submitter::submit_ahead`].
    unsafe fn send(
        &self,
        commands: &Commands,
        (first, waits): (Vec<First>, Vec<(vk::Semaphore, u64)>),
        record: impl FnOnce(&ash::Device, vk::CommandBuffer),
        signals: &[(vk::Semaphore, u64)],
    ) -> Result<(), DeviceError> {
        let device = self.device.raw();
        let recorded = |buffer| {
            barrier(device, buffer, BEFORE_ALL);
            record_first(device, buffer, &first);
            record(device, buffer);
            barrier(device, buffer, AFTER_ALL);
        };
        // SAFETY: the caller's duty.
        unsafe { commands.record(device, recorded) }?;
        let buffers = [commands.buffer()];
        let (wait_for, wait_values): (Vec<_>, Vec<_>) = waits.into_iter().unzip();
        let (signalled, signal_values): (Vec<_>, Vec<_>) = signals.iter().copied().unzip();
        let stages = vec![vk::PipelineStageFlags::ALL_COMMANDS; wait_for.len()];
        let mut values = vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(&wait_values)
            .signal_semaphore_values(&signal_values);
        let mut info = vk::SubmitInfo::default()
            .command_buffers(&buffers)
            .wait_semaphores(&wait_for)
            .wait_dst_stage_mask(&stages)
            .signal_semaphores(&signalled);
        if wait_values.iter().chain(&signal_values).any(|&value| value > 0) {
            info = info.push_next(&mut values);
        }
        let submits = [info];
        // SAFETY: `&mut self` is the only user of the queue, and the objects of the commands live until they have ended.
        unsafe { device.queue_submit(self.device.queue(), &submits, commands.fence()) }.call("vkQueueSubmit")
    }

    /// Waits for the end of commands that were submitted.
    pub(super) fn wait(&self, commands: &Commands) -> Result<(), DeviceError> {
        self.check()?;
        let fences = [commands.fence()];
        let mut waited = Duration::ZERO;
        loop {
            // SAFETY: the fence was submitted with the commands.
            let result = unsafe { self.device.raw().wait_for_fences(&fences, true, SLICE.as_nanos() as u64) };
            waited += SLICE;
            match result {
                Err(vk::Result::TIMEOUT) if waited < TIMEOUT => {
                    tracing::warn!("the device has been at work for {} s", waited.as_secs());
                }
                // Nothing runs on a device that is lost.
                Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST) => return result.call(WAIT),
                Err(_) => {
                    self.device.abandon();
                    return result.call(WAIT);
                }
            }
        }
    }
}

/// In their order where they have the same target.
fn record_first(device: &ash::Device, commands: vk::CommandBuffer, all: &[First]) {
    let mut targets = Vec::new();
    for &first in all {
        if targets.contains(&first.target()) {
            barrier_between(device, commands);
            targets.clear();
        }
        targets.push(first.target());
        match first {
            First::Zero(buffer) => {
                // SAFETY: the command buffer is being recorded; the buffer is alive, as `zero_first` asks.
                unsafe { device.cmd_fill_buffer(commands, buffer, 0, vk::WHOLE_SIZE, 0) };
            }
            First::Copy { from, to, region } => {
                // SAFETY: the region lies in both buffers, which are alive, as `copy_first` asks.
                unsafe { device.cmd_copy_buffer(commands, from, to, &[region]) };
            }
        }
    }
    if !all.is_empty() {
        barrier_between(device, commands);
    }
}

/// Which accesses come after which.
struct Order {
    from: (vk::PipelineStageFlags, vk::AccessFlags),
    to: (vk::PipelineStageFlags, vk::AccessFlags),
}

const STAGES: vk::PipelineStageFlags = vk::PipelineStageFlags::from_raw(
    vk::PipelineStageFlags::COMPUTE_SHADER.as_raw()
        | vk::PipelineStageFlags::TRANSFER.as_raw()
        | vk::PipelineStageFlags::DRAW_INDIRECT.as_raw(),
);
const WRITES: vk::AccessFlags =
    vk::AccessFlags::from_raw(vk::AccessFlags::SHADER_WRITE.as_raw() | vk::AccessFlags::TRANSFER_WRITE.as_raw());
const ALL: vk::AccessFlags = vk::AccessFlags::from_raw(
    WRITES.as_raw()
        | vk::AccessFlags::SHADER_READ.as_raw()
        | vk::AccessFlags::TRANSFER_READ.as_raw()
        | vk::AccessFlags::INDIRECT_COMMAND_READ.as_raw(),
);

/// After earlier submissions, which reach to here: a barrier orders all that was submitted before it.
const BEFORE_ALL: Order = Order { from: (STAGES, WRITES), to: (STAGES, ALL) };
/// Before the host reads mapped memory.
const AFTER_ALL: Order =
    Order { from: (STAGES, WRITES), to: (vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ) };

/// What follows sees all that earlier commands wrote.
pub(super) fn barrier_between(device: &ash::Device, commands: vk::CommandBuffer) {
    barrier(device, commands, BEFORE_ALL);
}

fn barrier(device: &ash::Device, commands: vk::CommandBuffer, order: Order) {
    let memory = [vk::MemoryBarrier::default().src_access_mask(order.from.1).dst_access_mask(order.to.1)];
    // SAFETY: the command buffer is being recorded, and a queue that computes knows these stages.
    unsafe {
        device.cmd_pipeline_barrier(
            commands,
            order.from.0,
            order.to.0,
            vk::DependencyFlags::empty(),
            &memory,
            &[],
            &[],
        );
    }
}

//! Vulkan through ash: the only folder of the crate with `unsafe`.
//!
//! | file | what it owns |
//! |---|---|
//! | `instance`, `messages` | the library, the instances of the process, the reports of the validation layer |
//! | `limits`, `selection` | what a device is and lacks; which one to open |
//! | `logical`, `objects` | an opened device, and Vulkan objects that destroy themselves |
//! | `heap`, `memory`, `buffers`, `staging`, `ring` | blocks of memory, buffers in them, and bytes on their way to and from them |
//! | `shaders`, `pipeline`, `cache` | SPIR-V → pipelines, kept between runs of the program |
//! | `statistics` | what a driver made of the kernels: registers, spills, instructions |
//! | `external`, `features` | the Vulkan of the caller, and what it must be created with |
//! | `run`, `descriptors`, `timestamps`, `commands`, `submit`, `fetched` | a recording → one submission, with what goes before it and comes back with it |
//!
//! The device is at rest whenever no call of this module runs: every submission is waited for; only within a long upload the host goes on meanwhile.
#![allow(unsafe_code, reason = "every Vulkan call is unsafe; each block is one call and says why it is right")]

mod buffers;
mod cache;
mod commands;
mod descriptors;
mod error;
mod external;
mod features;
mod fetched;
mod heap;
mod instance;
mod limits;
mod logical;
mod memory;
mod messages;
mod objects;
mod pipeline;
mod ring;
mod run;
mod selection;
mod shaders;
mod staging;
mod statistics;
mod submit;
#[cfg(test)]
mod tests;
mod timestamps;

pub use ash;
pub use external::RawVulkan;
pub use features::KernelFeatures;
pub use limits::{DeviceSummary, Missing};
pub use prbvh_kernel::grid::{WORKGROUP_SIZE, workgroups};
pub use prbvh_kernel::native::{Access as KernelAccess, BindingInfo};
pub use prbvh_kernel::{Kernel, KernelInfo};
pub use shaders::needs_atomics_64;
pub use statistics::{Executable, KernelStatistics, Statistic, StatisticValue, kernel_statistics};

use super::Selection;
use super::{Buffer, Device, DeviceError, DeviceInfo, Fill, MemoryUse, Recording, Timing, Traffic};
use buffers::Buffers;
use cache::StoredCache;
use instance::Instance;
use limits::PhysicalDevice;
use logical::LogicalDevice;
use memory::{Access, Range};
use pipeline::Pipelines;
use run::Runner;
use selection::select;
use staging::Staging;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use submit::Submitter;

/// All Vulkan devices of this machine, those that prbvh cannot run on included.
///
/// # Errors
/// [`DeviceError::NoDevice`] if there is no Vulkan library, driver or device, [`DeviceError::Vulkan`] if a call fails.
pub fn list_devices() -> Result<Vec<DeviceSummary>, DeviceError> {
    let instance = Instance::shared(false)?;
    Ok(PhysicalDevice::all(instance)?.into_iter().map(|device| device.summary).collect())
}

/// A [`Device`] that runs the SPIR-V of the kernels through Vulkan.
pub struct VulkanDevice {
    info: DeviceInfo,
    runner: Runner,
    staging: Staging,
    buffers: Buffers,
    submitter: Submitter,
    traffic: Traffic,
    device: Arc<LogicalDevice>,
}

/// How to open a device; tests take ways that a device would not need.
struct Options {
    validate: bool,
    atomics_64: bool,
    access: Access,
    timestamps: bool,
    cache_folder: Option<PathBuf>,
}

impl VulkanDevice {
    /// Opens a device, under the validation layer if `validate`: then whatever the layer finds fails the call that
    /// caused it with [`DeviceError::Validation`].
    ///
    /// # Errors
    /// [`DeviceError::NoDevice`] if there is no such device, [`DeviceError::Feature`] or [`DeviceError::Limit`] with the name of
    /// what it lacks, [`DeviceError::Validation`] if the layer is not installed, [`DeviceError::Vulkan`] if a call fails.
    pub fn open(selection: Selection, validate: bool) -> Result<Self, DeviceError> {
        let (access, cache_folder) = (Access::WherePossible, cache::user_folder());
        Self::open_with(selection, Options { validate, atomics_64: true, access, timestamps: true, cache_folder })
    }

    fn open_with(selection: Selection, options: Options) -> Result<Self, DeviceError> {
        let instance = Instance::shared(options.validate)?;
        let physical = select(PhysicalDevice::all(instance)?, selection)?;
        let device = LogicalDevice::new(instance, physical, options.atomics_64)?;
        Self::over(device, options.access, options.timestamps, options.cache_folder.as_deref())
    }

    fn over(
        device: Arc<LogicalDevice>,
        access: Access,
        timestamps: bool,
        cache_folder: Option<&Path>,
    ) -> Result<Self, DeviceError> {
        let cache = StoredCache::open(&device, cache_folder)?;
        let opened = Self {
            info: device.physical().info(device.atomics_64()),
            runner: Runner::new(&device, Pipelines::new(&device, cache), timestamps)?,
            staging: Staging::new(&device)?,
            buffers: Buffers::new(&device, access),
            submitter: Submitter::new(&device)?,
            traffic: Traffic::default(),
            device,
        };
        opened.validated(Ok(()))?;
        Ok(opened)
    }

    /// Ends the device and reports what the validation layer finds at the end, such as objects left over.
    ///
    /// # Errors
    /// [`DeviceError::Validation`] with its text.
    pub fn close(self) -> Result<(), DeviceError> {
        drop(self);
        messages::check()
    }

    /// The result, unless the validation layer found fault with a call of this thread.
    fn validated<T>(&self, result: Result<T, DeviceError>) -> Result<T, DeviceError> {
        messages::check()?;
        result
    }

    fn allocate_zeroed(
        &mut self,
        label: &'static str,
        length: usize,
        element_bytes: usize,
    ) -> Result<Buffer, DeviceError> {
        let (buffer, allocation) = self.buffers.allocate(label, length, element_bytes)?;
        self.traffic.allocations += 1;
        if allocation.zero() {
            return Ok(buffer);
        }
        let zeroed = self.submitter.zero_first(allocation.buffer());
        if zeroed.is_err() {
            self.buffers.free(&buffer);
        }
        zeroed.map(|()| buffer)
    }

    /// Has `fill` write the first `bytes` bytes, in pieces of whole elements of so many bytes.
    fn copy_in(
        &mut self,
        buffer: &Buffer,
        (bytes, element): (usize, usize),
        fill: &mut dyn FnMut(usize, &mut [u8]),
    ) -> Result<(), DeviceError> {
        let allocation = self.buffers.find_mut(buffer, bytes)?;
        self.traffic.bytes_in += bytes as u64;
        self.runner.forget_fetched();
        if let Some(content) = allocation.mapped() {
            fill(0, &mut content[..bytes]);
            return Ok(());
        }
        if bytes == 0 {
            return Ok(());
        }
        let Range { buffer, offset, bytes: all } = allocation.range();
        // Nobody sees what was to be there before; the words of a buffer that ends within one are zeroed as a whole.
        let is_whole = allocation.is_own() && bytes as u64 == all && bytes.is_multiple_of(4);
        if is_whole {
            self.submitter.forget(buffer);
        }
        let done = self.staging.upload(&mut self.submitter, (buffer, offset), (bytes, element), fill);
        if is_whole && done.is_err() {
            self.submitter.zero_first(buffer)?;
        }
        done
    }

    fn copy_out(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        let allocation = self.buffers.find_mut(buffer, first.saturating_add(bytes.len()))?;
        self.traffic.bytes_out += bytes.len() as u64;
        if let Some(content) = allocation.mapped() {
            bytes.copy_from_slice(&content[first..][..bytes.len()]);
            return Ok(());
        }
        let range = allocation.range();
        if let Some(content) = self.runner.fetched(range, first, bytes.len()) {
            bytes.copy_from_slice(content);
            return Ok(());
        }
        self.staging.download(&mut self.submitter, (range.buffer, range.offset + first as u64), bytes)
    }
}

impl std::fmt::Debug for VulkanDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VulkanDevice")
            .field("info", &self.info)
            .field("memory", &self.memory())
            .field("is_abandoned", &self.device.is_abandoned())
            .finish_non_exhaustive()
    }
}

impl Device for VulkanDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        let buffer = self.allocate_zeroed(label, length, element_bytes);
        self.validated(buffer)
    }

    fn free(&mut self, buffer: Buffer) {
        if let Ok(allocation) = self.buffers.find(&buffer) {
            if allocation.is_own() {
                self.submitter.forget(allocation.buffer());
            } else {
                // The caller's may be gone before the next work. What fails here ends that, too.
                let _ = self.submitter.flush();
            }
            self.runner.forget_fetched();
        }
        self.buffers.free(&buffer);
    }

    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        let mut copy = |first: usize, piece: &mut [u8]| piece.copy_from_slice(&bytes[first..][..piece.len()]);
        let done = self.copy_in(buffer, (bytes.len(), 1), &mut copy);
        self.validated(done)
    }

    fn upload_with(&mut self, buffer: &Buffer, bytes: usize, fill: Fill<'_>) -> Result<(), DeviceError> {
        let done = self.copy_in(buffer, (bytes, buffer.element_bytes.max(1)), fill);
        self.validated(done)
    }

    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        let done = self.copy_out(buffer, first, bytes);
        self.validated(done)
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        self.traffic.note(recording);
        let timings = self.runner.run(&mut self.submitter, &self.buffers, recording);
        self.validated(timings)
    }

    fn memory(&self) -> MemoryUse {
        self.buffers.memory()
    }

    fn traffic(&self) -> Traffic {
        let [submissions, ahead] = self.submitter.submissions();
        Traffic { submissions, ahead, ..self.traffic }
    }
}

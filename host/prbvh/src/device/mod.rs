//! Where kernels run. An algorithm records dispatches ([`Recording`]) and hands them to a [`Device`]; it never knows which.
//!
//! Threads are started by [`cpu::CpuDevice::new`] alone, as many as it is asked for; [`cpu::CpuDevice::in_pool`] has those of a rayon pool of the caller's.
//! What is done on the host for a device runs on its threads ([`Device::run_on_host`]): those of a CPU device, of a GPU those of the current rayon pool.

mod choice;
pub mod cpu;
mod held;
mod layer;
mod lease;
mod meter;
mod open;
mod pieces;
pub mod record;
mod stoppable;
mod traffic;
#[cfg(feature = "vulkan")]
pub mod vulkan;
mod watched;

pub use choice::{DeviceChoice, NoSuchChoice, Selection};
pub use held::Held;
pub use layer::Layer;
pub(crate) use lease::Lease;
pub use meter::Meter;
pub use open::open;
pub(crate) use pieces::read_pieces;
pub use record::{Buffer, Command, Counted, Dispatch, Recording};
pub use stoppable::Stoppable;
pub(crate) use stoppable::StoppableLoan;
pub use traffic::Traffic;
pub(crate) use watched::Watched;

use crate::scene::OutOfRange;

/// What writes the bytes of a buffer, a piece of them at a time, from the byte on that is given ([`Device::upload_with`]).
pub type Fill<'a> = &'a mut (dyn FnMut(usize, &mut [u8]) + Send);

/// Runs recordings on buffers that it owns.
pub trait Device {
    /// What the device is and can do.
    fn info(&self) -> &DeviceInfo;

    /// A zeroed buffer of `length` elements of `element_bytes` bytes.
    ///
    /// # Errors
    /// [`DeviceError::Limit`] beyond a limit of the device, [`DeviceError::OutOfMemory`] if the memory is not to be had.
    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError>;

    /// Gives the memory of a buffer back.
    fn free(&mut self, buffer: Buffer);

    /// Copies `bytes` into the buffer, from its start.
    ///
    /// # Errors
    /// If the device fails.
    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError>;

    /// Has `fill` write the first `bytes` bytes of the buffer, a multiple of 4, on the threads that [`Device::run_on_host`] lends: without a copy of them in
    /// between where the device is the host, and while the device takes the piece before where it is not. Pieces come in order, all of whole elements and aligned to
    /// words; what `fill` finds there means nothing.
    ///
    /// # Errors
    /// If the device fails.
    fn upload_with(&mut self, buffer: &Buffer, bytes: usize, fill: Fill<'_>) -> Result<(), DeviceError> {
        let mut words = vec![0u32; bytes.div_ceil(4)];
        let written = &mut bytemuck::cast_slice_mut(&mut words)[..bytes];
        self.run_on_host(&mut || fill(0, &mut *written));
        self.upload(buffer, written)
    }

    /// Copies `bytes.len()` bytes of the buffer out, from byte `first` on.
    ///
    /// # Errors
    /// If the device fails.
    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError>;

    /// Copies the first `bytes.len()` bytes of the buffer out.
    ///
    /// # Errors
    /// If the device fails.
    fn download(&mut self, buffer: &Buffer, bytes: &mut [u8]) -> Result<(), DeviceError> {
        self.download_from(buffer, 0, bytes)
    }

    /// Runs the commands one after another, each seeing all that the earlier ones wrote. Returns how long each took.
    ///
    /// # Errors
    /// If the device fails.
    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError>;

    /// Bytes in buffers now, and the most there were.
    fn memory(&self) -> MemoryUse;

    /// How often it was spoken to since it was opened.
    fn traffic(&self) -> Traffic;

    /// Runs work of the host that uses rayon: on a CPU device with the threads that it was given, else with those of the current pool.
    /// [`on_host`] returns what the work makes.
    fn run_on_host(&self, work: &mut (dyn FnMut() + Send)) {
        work();
    }
}

/// Runs work of the host that uses rayon with as many threads as [`Device::run_on_host`] lends.
///
/// # Panics
/// If the device does not run it.
pub fn on_host<T: Send>(device: &dyn Device, work: impl FnOnce() -> T + Send) -> T {
    let (mut work, mut made) = (Some(work), None);
    device.run_on_host(&mut || made = work.take().map(|work| work()));
    made.expect("a device runs the work of the host")
}

/// What a device is and can do.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct DeviceInfo {
    /// Name as the driver or the system gives it.
    pub name: String,
    /// Kind of device.
    pub kind: DeviceKind,
    /// Driver, its version and the API version; for the CPU the number of threads.
    pub driver: String,
    /// Largest buffer, and the name of the limit behind it.
    pub max_buffer_bytes: u64,
    /// Name of the limit behind `max_buffer_bytes`.
    pub max_buffer_limit: &'static str,
    /// Memory of the device, bytes; 0 where it is not known.
    pub memory_bytes: u64,
    /// Whether 64-bit atomics on buffers work; else locks take two 32-bit words.
    pub atomics_64: bool,
    /// Invocations that keep the device busy: work is cut into about this many chunks where the cut is free.
    pub busy_invocations: u32,
    /// Buffers that a kernel may have at once; a kernel of more is left out, in favour of several of fewer.
    pub kernel_buffers: u32,
}

impl DeviceInfo {
    /// A device of 32-bit atomics without known limits, for who has a [`Device`] of their own; the fields say more.
    #[must_use]
    pub fn new(name: impl Into<String>, kind: DeviceKind) -> Self {
        Self {
            name: name.into(),
            kind,
            driver: String::new(),
            max_buffer_bytes: u64::MAX,
            max_buffer_limit: "address space",
            memory_bytes: 0,
            atomics_64: false,
            busy_invocations: 1,
            kernel_buffers: u32::MAX,
        }
    }

    /// Workgroups that keep the device busy: a thread of a CPU takes one at a time.
    pub(crate) fn busy_workgroups(&self) -> u32 {
        let one = if self.kind == DeviceKind::Cpu { 1 } else { prbvh_kernel::grid::WORKGROUP_SIZE };
        self.busy_invocations.div_ceil(one).max(1)
    }
}

/// Kind of device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum DeviceKind {
    /// The kernels compiled natively.
    Cpu,
    /// A GPU through Vulkan.
    VulkanGpu,
    /// A Vulkan driver that runs on the CPU, such as lavapipe.
    VulkanCpu,
}

/// How long a command took. Of commands of one label in a row a device may time the last one alone, for all of them.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// The command's label.
    pub label: &'static str,
    /// Seconds on the device; 0 where it keeps no time.
    pub seconds: f64,
}

/// Memory of a device in buffers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct MemoryUse {
    /// Bytes now.
    pub bytes: u64,
    /// Most bytes at any time.
    pub peak_bytes: u64,
}

/// Why a device refused or failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// A limit of the device is too small for the scene.
    #[error("{what} needs {name} of at least {need}, but {device} has {have}")]
    Limit {
        /// What needs it.
        what: String,
        /// Name of the limit.
        name: &'static str,
        /// What is needed.
        need: u64,
        /// What the device has.
        have: u64,
        /// Name of the device.
        device: String,
    },
    /// A feature is missing.
    #[error("{device} lacks {name}, which {what} needs")]
    Feature {
        /// What needs it.
        what: String,
        /// Name of the feature.
        name: &'static str,
        /// Name of the device.
        device: String,
    },
    /// The memory is not to be had.
    #[error("no memory for {what} ({bytes} bytes) on {device}")]
    OutOfMemory {
        /// What needs it.
        what: String,
        /// How much.
        bytes: u64,
        /// Name of the device.
        device: String,
    },
    /// A buffer is not of this device, or too small for the bytes: a mistake of the caller.
    #[error("buffer {label}: {problem}")]
    Buffer {
        /// Label of the buffer.
        label: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// Triangles with coordinates that are too small or too large.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// A kernel did not do what it must.
    #[error("{kernel} on {device}: {problem}")]
    Kernel {
        /// Name of the kernel.
        kernel: &'static str,
        /// What it did.
        problem: String,
        /// Name of the device.
        device: String,
    },
    /// The caller asked for an end ([`Stoppable`]).
    #[error("interrupted")]
    Stopped,
    /// There is no such device.
    #[error("{0}")]
    NoDevice(String),
    /// A Vulkan call failed.
    #[error("Vulkan: {call} failed: {meaning}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// The `VkResult` that it returned.
        code: i32,
        /// Its name and meaning.
        meaning: String,
    },
    /// The validation layer found fault.
    #[error("Vulkan validation: {0}")]
    Validation(String),
}

impl Buffer {
    /// What a device says that does not have it.
    fn not_here(&self) -> DeviceError {
        let problem = "it is not, or no longer, a buffer of this device".to_owned();
        DeviceError::Buffer { label: self.label, problem }
    }

    /// What a device says if it is to give or take more than it holds.
    fn too_short(&self, bytes: usize) -> DeviceError {
        let problem = format!("{bytes} bytes wanted, but it has {}", self.bytes());
        DeviceError::Buffer { label: self.label, problem }
    }
}

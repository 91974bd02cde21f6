//! The devices of the table.

use prbvh::device::cpu::CpuDevice;
use prbvh::device::vulkan::{self, DeviceSummary, VulkanDevice};
use prbvh::device::{self, Device, DeviceChoice, DeviceError, Selection, Stoppable};
use prbvh::stop::Stop;
use prbvh_cpu_sim::Order;

/// A device, and others that must give the same tree.
#[expect(missing_debug_implementations, reason = "devices are opaque")]
pub struct Lane {
    /// Name in the table.
    pub name: String,
    pub(super) device: Box<dyn Device>,
    pub(super) witnesses: Vec<(String, Box<dyn Device>)>,
}

impl Lane {
    /// A device alone.
    #[must_use]
    pub fn new(name: impl Into<String>, device: Box<dyn Device>) -> Self {
        Self { name: name.into(), device, witnesses: Vec::new() }
    }

    /// The CPU on `threads` threads (0: one per core), and as witnesses one thread and two other orders of the invocations.
    ///
    /// # Errors
    /// If the system refuses the threads.
    pub fn cpu(threads: usize) -> Result<Self, DeviceError> {
        let witness = |name: &str, order, threads| -> Result<(String, Box<dyn Device>), DeviceError> {
            Ok((name.to_owned(), Box::new(CpuDevice::with_order(order, threads)?)))
        };
        let witnesses = vec![
            witness("one thread", Order::Parallel, 1)?,
            witness("descending", Order::Descending, 1)?,
            witness("shuffled", Order::Shuffled(1), 1)?,
        ];
        Ok(Self { witnesses, ..Self::new("cpu", Box::new(CpuDevice::new(threads)?)) })
    }

    /// The device that a user named.
    ///
    /// # Errors
    /// If there is none or it lacks something.
    pub fn open(choice: DeviceChoice, threads: usize, validate: bool) -> Result<Self, DeviceError> {
        match choice {
            DeviceChoice::Cpu => Self::cpu(threads),
            _ => Ok(Self::new(choice.to_string(), device::open(choice, threads, validate)?)),
        }
    }

    /// The CPU and every Vulkan device that the kernels can run on, as `vulkan:N`; and for each that cannot be used, why.
    ///
    /// # Errors
    /// If the system refuses the threads, or a device that looked usable cannot be opened.
    pub fn all(threads: usize, validate: bool) -> Result<(Vec<Self>, Vec<String>), DeviceError> {
        let mut lanes = vec![Self::cpu(threads)?];
        let mut unusable = Vec::new();
        match vulkan::list_devices() {
            Err(error) => unusable.push(format!("no Vulkan device: {error}")),
            Ok(devices) => {
                for DeviceSummary { index, name, missing, .. } in devices {
                    if missing.is_empty() {
                        let device = VulkanDevice::open(Selection::Index(index), validate)?;
                        lanes.push(Self::new(format!("vulkan:{index}"), Box::new(device)));
                    } else {
                        let missing: Vec<String> = missing.iter().map(ToString::to_string).collect();
                        unusable.push(format!("vulkan:{index} ({name}) lacks {}", missing.join(", ")));
                    }
                }
            }
        }
        Ok((lanes, unusable))
    }

    /// The same, but its devices run nothing once an end is asked for.
    #[must_use]
    pub fn stoppable(self, stop: &Stop) -> Self {
        let stoppable = |device| -> Box<dyn Device> { Box::new(Stoppable::new(device, stop)) };
        let witnesses = self.witnesses.into_iter().map(|(name, device)| (name, stoppable(device)));
        Self { name: self.name, device: stoppable(self.device), witnesses: witnesses.collect() }
    }

    /// What the device is.
    #[must_use]
    pub fn info(&self) -> &device::DeviceInfo {
        self.device.info()
    }
}

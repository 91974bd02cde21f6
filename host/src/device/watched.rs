//! A device that takes note of the kernels that it runs.

use super::{Buffer, Command, Device, DeviceError, DeviceInfo, MemoryUse, Recording, Timing};
use prbvh_kernel::Kernel;
use std::collections::BTreeSet;

/// Hands everything on to another device.
pub(crate) struct Watched<'a> {
    device: &'a mut dyn Device,
    ran: BTreeSet<Kernel>,
}

impl<'a> Watched<'a> {
    pub(crate) fn new(device: &'a mut dyn Device) -> Self {
        Self { device, ran: BTreeSet::new() }
    }

    /// The kernels that ran.
    pub(crate) fn into_kernels(self) -> BTreeSet<Kernel> {
        self.ran
    }
}

impl Device for Watched<'_> {
    fn info(&self) -> &DeviceInfo {
        self.device.info()
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        self.device.allocate(label, length, element_bytes)
    }

    fn free(&mut self, buffer: Buffer) {
        self.device.free(buffer);
    }

    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        self.device.upload(buffer, bytes)
    }

    fn download(&mut self, buffer: &Buffer, bytes: &mut [u8]) -> Result<(), DeviceError> {
        self.device.download(buffer, bytes)
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        for (_, command) in recording.commands() {
            if let Command::Dispatch(dispatch) = command {
                self.ran.insert(dispatch.kernel);
            }
        }
        self.device.run(recording)
    }

    fn memory(&self) -> MemoryUse {
        self.device.memory()
    }

    fn run_on_host(&self, work: &mut (dyn FnMut() + Send)) {
        self.device.run_on_host(work);
    }
}

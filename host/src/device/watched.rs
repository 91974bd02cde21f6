//! A device that takes note of the kernels that it runs.

use super::{Command, Device, DeviceError, Recording, Timing};
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
    pub(crate) fn kernels(&self) -> BTreeSet<Kernel> {
        self.ran.clone()
    }
}

impl super::Layer for Watched<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        for (_, command) in recording.commands() {
            if let Command::Dispatch(dispatch) = command {
                self.ran.insert(dispatch.kernel);
            }
        }
        self.device.run(recording)
    }
}

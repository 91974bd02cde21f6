//! A device with a fault, or with another kernel in place of one: what it runs is looked at, and may be changed, after each dispatch.

use prbvh::device::{self, Buffer, Command, Device, DeviceError, Dispatch, Recording, Timing};

/// Runs everything on the device inside, one command at a time, and calls `after` with each dispatch that was run.
pub struct Planted<F> {
    device: Box<dyn Device>,
    after: F,
}

impl<F: FnMut(&Dispatch, &mut dyn Device) -> Result<(), DeviceError>> Planted<F> {
    /// A fault in a device.
    pub fn new(device: Box<dyn Device>, after: F) -> Self {
        Self { device, after }
    }
}

impl<F> std::fmt::Debug for Planted<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Planted").field(&self.device.info().name).finish()
    }
}

impl<F: FnMut(&Dispatch, &mut dyn Device) -> Result<(), DeviceError>> device::Layer for Planted<F> {
    fn inner(&self) -> &dyn Device {
        &*self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut *self.device
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        let mut timings = Vec::new();
        for (label, command) in recording.commands() {
            let mut one = Recording::new();
            one.add(label, command.clone());
            timings.extend(self.device.run(&one)?);
            if let Command::Dispatch(dispatch) = command {
                (self.after)(dispatch, &mut *self.device)?;
            }
        }
        Ok(timings)
    }
}

/// Changes the elements of a buffer in place.
///
/// # Errors
/// If the device fails.
pub fn change<T: bytemuck::Pod>(
    device: &mut dyn Device,
    buffer: &Buffer,
    change: impl FnOnce(&mut [T]),
) -> Result<(), DeviceError> {
    let mut elements = vec![T::zeroed(); buffer.length];
    device.download(buffer, bytemuck::cast_slice_mut(&mut elements))?;
    change(&mut elements);
    device.upload(buffer, bytemuck::cast_slice(&elements))
}

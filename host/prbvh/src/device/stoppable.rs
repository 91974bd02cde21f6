//! A device that refuses work once an end is asked for.

use super::{Device, DeviceError, Recording, Timing};
use crate::stop::Stop;

/// Passes everything on to a device, but runs nothing once somebody asked for an end: so work of many recordings ends with the one that runs, and whoever
/// made it gives back what it holds, as after any error. What is to end with a result asks by itself ([`crate::optimize::Limits::stop`]).
#[expect(missing_debug_implementations, reason = "devices are opaque")]
pub struct Stoppable {
    device: Box<dyn Device>,
    stop: Stop,
}

impl Stoppable {
    /// Runs everything until `stop` is asked.
    #[must_use]
    pub fn new(device: Box<dyn Device>, stop: &Stop) -> Self {
        Self { device, stop: stop.clone() }
    }
}

impl super::Layer for Stoppable {
    fn inner(&self) -> &dyn Device {
        &*self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut *self.device
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        if self.stop.is_asked() { Err(DeviceError::Stopped) } else { self.device.run(recording) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::cpu::CpuDevice;
    use super::*;

    #[test]
    fn nothing_runs_after_an_end_was_asked_for() {
        let stop = Stop::default();
        let mut device = Stoppable::new(Box::new(CpuDevice::new(1).unwrap()), &stop);
        let buffer = device.allocate("words", 2, 4).unwrap();
        device.upload(&buffer, &[7; 8]).unwrap();
        let mut recording = Recording::new();
        recording.clear("clear", &buffer);
        assert_eq!(device.run(&recording).unwrap().len(), 1);
        device.upload(&buffer, &[7; 8]).unwrap();
        stop.ask();
        assert!(matches!(device.run(&recording), Err(DeviceError::Stopped)));
        let mut bytes = [0; 8];
        device.download(&buffer, &mut bytes).unwrap();
        assert_eq!(bytes, [7; 8]);
        device.free(buffer);
        assert_eq!(device.memory().bytes, 0);
    }
}

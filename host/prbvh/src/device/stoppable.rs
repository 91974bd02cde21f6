//! A device that refuses work once an end is asked for.

use super::{Command, Device, DeviceError, DeviceKind, Recording, Timing};
use crate::stop::Stop;

/// Invocations between two looks at whether an end is asked for: less than that takes no time that anybody would notice, but each look ends a run.
const MOST_AT_ONCE: u32 = 1 << 18;

/// Runs a recording unless an end is asked for. Where a CPU runs it, that is asked again and again: a few commands may take as long as a GPU takes for the
/// whole.
fn run_until(device: &mut dyn Device, recording: &Recording, stop: &Stop) -> Result<Vec<Timing>, DeviceError> {
    let is_split = device.info().kind != DeviceKind::VulkanGpu;
    let (mut timings, mut piece, mut invocations) = (Vec::new(), Recording::new(), 0u32);
    let mut run = |piece: Recording| {
        if stop.is_asked() {
            return Err(DeviceError::Stopped);
        }
        timings.extend(device.run(&piece)?);
        Ok(())
    };
    for (label, command) in recording.commands() {
        if let Command::Dispatch(dispatch) = command {
            invocations = invocations.saturating_add(dispatch.count);
        }
        piece.add(label, command.clone());
        if is_split && invocations > MOST_AT_ONCE {
            run(std::mem::take(&mut piece))?;
            invocations = 0;
        }
    }
    run(piece)?;
    Ok(timings)
}

/// As [`Stoppable`] a device that is lent, for a stop that there may be.
pub(crate) struct StoppableLoan<'a> {
    device: &'a mut dyn Device,
    stop: Option<Stop>,
}

impl<'a> StoppableLoan<'a> {
    pub(crate) fn new(device: &'a mut dyn Device, stop: Option<Stop>) -> Self {
        Self { device, stop }
    }
}

impl super::Layer for StoppableLoan<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        match &self.stop {
            Some(stop) => run_until(self.device, recording, stop),
            None => self.device.run(recording),
        }
    }
}

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

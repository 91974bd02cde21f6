//! Where the time of a frame goes: the device's own times by label.

use prbvh::device::{Buffer, Device, DeviceError, Fill, Layer, Recording, Timing};
use std::collections::BTreeMap;
use std::time::Instant;

/// Adds up the times of what a device runs.
pub(crate) struct Stages<'a> {
    device: &'a mut dyn Device,
    seconds: BTreeMap<&'static str, f64>,
}

impl<'a> Stages<'a> {
    pub(crate) fn new(device: &'a mut dyn Device) -> Self {
        Self { device, seconds: BTreeMap::new() }
    }

    fn add(&mut self, label: &'static str, seconds: f64) {
        *self.seconds.entry(label).or_default() += seconds;
    }

    /// A line of all stages, in milliseconds of one of so many frames.
    pub(crate) fn line(&self, frames: usize) -> String {
        let of_a_frame = |(label, seconds): (&&str, &f64)| format!("{label} {:.3}", 1e3 * seconds / frames as f64);
        self.seconds.iter().map(of_a_frame).collect::<Vec<_>>().join(", ")
    }
}

impl Layer for Stages<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        let start = Instant::now();
        self.device.upload(buffer, bytes)?;
        self.add("upload", start.elapsed().as_secs_f64());
        Ok(())
    }

    fn upload_with(&mut self, buffer: &Buffer, bytes: usize, fill: Fill<'_>) -> Result<(), DeviceError> {
        let start = Instant::now();
        self.device.upload_with(buffer, bytes, fill)?;
        self.add("boxes", start.elapsed().as_secs_f64());
        Ok(())
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        let start = Instant::now();
        let timings = self.device.run(recording)?;
        let whole = start.elapsed().as_secs_f64();
        timings.iter().for_each(|timing| self.add(timing.label, timing.seconds));
        self.add("handing over", whole - timings.iter().map(|timing| timing.seconds).sum::<f64>());
        Ok(timings)
    }
}

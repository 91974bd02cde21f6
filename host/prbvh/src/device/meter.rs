//! A device that takes note of what a run needs of it.

use super::{Buffer, Device, DeviceError, Lease, MemoryUse, Recording, Timing};

/// Passes everything on to a device. Counts bytes and times from its own beginning, and gives back what a run that failed left there.
#[expect(missing_debug_implementations, reason = "devices are opaque")]
pub struct Meter<'a> {
    device: Lease<'a>,
    memory: MemoryUse,
    timings: Vec<Timing>,
}

impl<'a> Meter<'a> {
    /// Nothing is counted yet.
    pub fn new(device: &'a mut dyn Device) -> Self {
        Self { device: Lease::new(device), memory: MemoryUse::default(), timings: Vec::new() }
    }

    /// Time of every command so far.
    #[must_use]
    pub fn timings(&self) -> &[Timing] {
        &self.timings
    }

    /// Their sum, seconds.
    #[must_use]
    pub fn device_s(&self) -> f64 {
        self.timings.iter().map(|timing| timing.seconds).sum()
    }
}

impl super::Layer for Meter<'_> {
    fn inner(&self) -> &dyn Device {
        &self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.device
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        let buffer = Device::allocate(&mut self.device, label, length, element_bytes)?;
        self.memory.bytes += buffer.bytes();
        self.memory.peak_bytes = self.memory.peak_bytes.max(self.memory.bytes);
        Ok(buffer)
    }

    fn free(&mut self, buffer: Buffer) {
        if self.device.holds(&buffer) {
            self.memory.bytes -= buffer.bytes();
        }
        Device::free(&mut self.device, buffer);
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        let timings = Device::run(&mut self.device, recording)?;
        self.timings.extend_from_slice(&timings);
        Ok(timings)
    }

    fn memory(&self) -> MemoryUse {
        self.memory
    }
}

#[cfg(test)]
mod tests {
    use super::super::cpu::CpuDevice;
    use super::*;

    #[test]
    fn peaks_are_those_of_the_method_and_nothing_is_left() {
        let mut device = CpuDevice::new(1).unwrap();
        let large = device.allocate("large", 1000, 4).unwrap();
        device.free(large);
        let mut meter = Meter::new(&mut device);
        let one = meter.allocate("one", 10, 4).unwrap();
        let two = meter.allocate("two", 5, 4).unwrap();
        meter.free(one);
        assert_eq!(meter.memory(), MemoryUse { bytes: 20, peak_bytes: 60 });
        let mut recording = Recording::new();
        recording.clear("clear", &two);
        meter.run(&recording).unwrap();
        assert_eq!(meter.timings().len(), 1);
        assert!(meter.device_s() >= 0.0);
        drop(meter);
        assert_eq!(device.memory(), MemoryUse { bytes: 0, peak_bytes: 4000 });
    }
}

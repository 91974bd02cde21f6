//! Buffers that go back however the work on them ends.

use super::{Buffer, Device, DeviceError};

/// A device on loan: whatever was allocated through it and is neither freed nor kept goes back when it is dropped. So no error on the way
/// leaves a buffer behind.
pub(crate) struct Lease<'a> {
    device: &'a mut dyn Device,
    live: Vec<Buffer>,
}

impl<'a> Lease<'a> {
    /// Nothing is allocated yet.
    pub(crate) fn new(device: &'a mut dyn Device) -> Self {
        Self { device, live: Vec::new() }
    }

    /// Whether a buffer was allocated through it and is neither freed nor kept.
    pub(super) fn holds(&self, buffer: &Buffer) -> bool {
        self.live.contains(buffer)
    }

    /// Leaves what is allocated now to the caller.
    pub(crate) fn keep(&mut self) {
        self.live.clear();
    }
}

impl Drop for Lease<'_> {
    fn drop(&mut self) {
        for buffer in self.live.drain(..) {
            self.device.free(buffer);
        }
    }
}

impl super::Layer for Lease<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        let buffer = self.device.allocate(label, length, element_bytes)?;
        self.live.push(buffer.clone());
        Ok(buffer)
    }

    fn free(&mut self, buffer: Buffer) {
        if let Some(at) = self.live.iter().position(|live| *live == buffer) {
            self.live.swap_remove(at);
        }
        self.device.free(buffer);
    }
}

#[cfg(test)]
mod tests {
    use super::super::cpu::CpuDevice;
    use super::*;

    #[test]
    fn what_is_neither_freed_nor_kept_goes_back() {
        let mut device = CpuDevice::new(1).unwrap();
        let before = device.allocate("before", 1, 4).unwrap();
        let mut lease = Lease::new(&mut device);
        let kept = lease.allocate("kept", 10, 4).unwrap();
        let freed = lease.allocate("freed", 100, 4).unwrap();
        lease.free(freed);
        lease.keep();
        lease.allocate("left", 1000, 4).unwrap();
        assert_eq!(lease.memory().bytes, 4044);
        drop(lease);
        assert_eq!(device.memory().bytes, 44);
        device.free(kept);
        device.free(before);
        assert_eq!(device.memory().bytes, 0);
    }
}

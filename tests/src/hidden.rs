//! A device some of whose features or limits are hidden, so that whoever asks for them takes another way.

use prbvh::device::{self, Device, DeviceInfo};

/// Any other device that says something else of itself.
#[allow(missing_debug_implementations, reason = "a device need not be printable")]
pub struct Hidden<'a> {
    device: &'a mut dyn Device,
    info: DeviceInfo,
}

impl<'a> Hidden<'a> {
    /// `device`, of which `hide` changes what it says.
    pub fn new(device: &'a mut dyn Device, hide: impl FnOnce(&mut DeviceInfo)) -> Self {
        let mut info = device.info().clone();
        hide(&mut info);
        Self { device, info }
    }

    /// Without 64-bit atomics: its locks take two words.
    pub fn narrow(device: &'a mut dyn Device) -> Self {
        Self::new(device, |info| info.atomics_64 = false)
    }
}

impl device::Layer for Hidden<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn info(&self) -> &DeviceInfo {
        &self.info
    }
}

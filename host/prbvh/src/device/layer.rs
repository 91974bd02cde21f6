//! A device in front of another.

use super::{Buffer, Device, DeviceError, DeviceInfo, Fill, MemoryUse, Recording, Timing, Traffic};

/// A device that passes on to another what it does not do itself. Its methods are those of [`Device`], which every layer is: import one of
/// the two.
pub trait Layer {
    /// The device behind.
    fn inner(&self) -> &dyn Device;

    /// The device behind.
    fn inner_mut(&mut self) -> &mut dyn Device;

    /// [`Device::info`].
    fn info(&self) -> &DeviceInfo {
        self.inner().info()
    }

    /// [`Device::allocate`].
    ///
    /// # Errors
    /// As there.
    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        self.inner_mut().allocate(label, length, element_bytes)
    }

    /// [`Device::free`].
    fn free(&mut self, buffer: Buffer) {
        self.inner_mut().free(buffer);
    }

    /// [`Device::upload`].
    ///
    /// # Errors
    /// As there.
    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        self.inner_mut().upload(buffer, bytes)
    }

    /// [`Device::upload_with`].
    ///
    /// # Errors
    /// As there.
    fn upload_with(&mut self, buffer: &Buffer, bytes: usize, fill: Fill<'_>) -> Result<(), DeviceError> {
        self.inner_mut().upload_with(buffer, bytes, fill)
    }

    /// [`Device::download_from`], which [`Device::download`] is, too.
    ///
    /// # Errors
    /// As there.
    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        self.inner_mut().download_from(buffer, first, bytes)
    }

    /// [`Device::run`].
    ///
    /// # Errors
    /// As there.
    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        self.inner_mut().run(recording)
    }

    /// [`Device::memory`].
    fn memory(&self) -> MemoryUse {
        self.inner().memory()
    }

    /// [`Device::traffic`].
    fn traffic(&self) -> Traffic {
        self.inner().traffic()
    }

    /// [`Device::run_on_host`].
    fn run_on_host(&self, work: &mut (dyn FnMut() + Send)) {
        self.inner().run_on_host(work);
    }
}

impl<T: Layer> Device for T {
    fn info(&self) -> &DeviceInfo {
        Layer::info(self)
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        Layer::allocate(self, label, length, element_bytes)
    }

    fn free(&mut self, buffer: Buffer) {
        Layer::free(self, buffer);
    }

    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        Layer::upload(self, buffer, bytes)
    }

    fn upload_with(&mut self, buffer: &Buffer, bytes: usize, fill: Fill<'_>) -> Result<(), DeviceError> {
        Layer::upload_with(self, buffer, bytes, fill)
    }

    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        Layer::download_from(self, buffer, first, bytes)
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        Layer::run(self, recording)
    }

    fn memory(&self) -> MemoryUse {
        Layer::memory(self)
    }

    fn traffic(&self) -> Traffic {
        Layer::traffic(self)
    }

    fn run_on_host(&self, work: &mut (dyn FnMut() + Send)) {
        Layer::run_on_host(self, work);
    }
}

#[cfg(test)]
mod tests {
    use crate::device::cpu::CpuDevice;
    use crate::device::{self, Device, Recording, on_host};

    struct Plain(CpuDevice);

    impl device::Layer for Plain {
        fn inner(&self) -> &dyn Device {
            &self.0
        }

        fn inner_mut(&mut self) -> &mut dyn Device {
            &mut self.0
        }
    }

    #[test]
    fn a_layer_that_adds_nothing_is_the_device_behind() {
        let mut layer = Plain(CpuDevice::new(3).unwrap());
        assert_eq!(layer.info().name, layer.0.info().name);
        assert_eq!(on_host(&layer, rayon::current_num_threads), 3);
        let buffer = layer.allocate("words", 2, 4).unwrap();
        let mut bytes = [0; 8];
        layer.upload(&buffer, &[7; 8]).unwrap();
        layer.0.download(&buffer, &mut bytes).unwrap();
        assert_eq!(bytes, [7; 8]);
        layer.upload_with(&buffer, 4, &mut |_, bytes| bytes.fill(9)).unwrap();
        layer.download(&buffer, &mut bytes).unwrap();
        assert_eq!(bytes, [9, 9, 9, 9, 7, 7, 7, 7]);
        let mut recording = Recording::new();
        recording.clear("clear", &buffer);
        assert_eq!(layer.run(&recording).unwrap().len(), 1);
        layer.download(&buffer, &mut bytes).unwrap();
        assert_eq!(bytes, [0; 8]);
        layer.free(buffer);
        assert_eq!(layer.memory(), layer.0.memory());
        assert_eq!((layer.memory().bytes, layer.memory().peak_bytes), (0, 8));
    }
}

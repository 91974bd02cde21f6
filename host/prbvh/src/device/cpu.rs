//! The kernels on the CPU, behind the same interface as a GPU.

use super::{Buffer, Command, Device, DeviceError, DeviceInfo, DeviceKind, MemoryUse, Recording, Timing, Traffic};
use prbvh_cpu_sim::{BufferId, CpuSim, Order, Pages};
use prbvh_kernel::node::Node;
use std::time::Instant;

/// The CPU as a device.
#[derive(Debug)]
pub struct CpuDevice {
    sim: CpuSim,
    info: DeviceInfo,
    memory: MemoryUse,
    traffic: Traffic,
}

impl CpuDevice {
    /// The production device: `threads` threads, 0 for one per core.
    ///
    /// # Errors
    /// If the system refuses the threads.
    pub fn new(threads: usize) -> Result<Self, DeviceError> {
        Self::with_order(Order::Parallel, threads)
    }

    /// A device that runs the invocations of each dispatch in a given order.
    ///
    /// # Errors
    /// If the system refuses the threads.
    pub fn with_order(order: Order, threads: usize) -> Result<Self, DeviceError> {
        let sim = CpuSim::new(order, threads).map_err(|error| DeviceError::NoDevice(error.to_string()))?;
        let threads = sim.threads();
        let info = DeviceInfo {
            name: format!("CPU, {threads} thread{}", if threads == 1 { "" } else { "s" }),
            kind: DeviceKind::Cpu,
            driver: format!("native kernels, {} {}", std::env::consts::ARCH, std::env::consts::OS),
            max_buffer_bytes: isize::MAX as u64,
            max_buffer_limit: "address space",
            memory_bytes: 0,
            atomics_64: true,
            busy_invocations: u32::try_from(threads * 8).unwrap_or(u32::MAX),
        };
        Ok(Self { sim, info, memory: MemoryUse::default(), traffic: Traffic::default() })
    }
}

fn id(buffer: &Buffer) -> BufferId {
    BufferId(buffer.id)
}

impl Device for CpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        let refused = || DeviceError::OutOfMemory {
            what: label.to_owned(),
            bytes: length as u64 * element_bytes as u64,
            device: self.info.name.clone(),
        };
        let bytes = length.checked_mul(element_bytes).ok_or_else(refused)?;
        // Trees are walked; of other buffers an optimiser may touch little.
        let pages = if element_bytes == size_of::<Node>() { Pages::Large } else { Pages::Small };
        let BufferId(id) = self.sim.allocate(bytes, pages).map_err(|_| refused())?;
        self.traffic.allocations += 1;
        self.memory.bytes += bytes as u64;
        self.memory.peak_bytes = self.memory.peak_bytes.max(self.memory.bytes);
        Ok(Buffer { id, label, length, element_bytes })
    }

    fn free(&mut self, buffer: Buffer) {
        self.sim.free(id(&buffer));
        self.memory.bytes -= buffer.bytes();
    }

    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        self.traffic.bytes_in += bytes.len() as u64;
        self.sim.bytes_mut(id(buffer))[..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }

    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        self.traffic.bytes_out += bytes.len() as u64;
        bytes.copy_from_slice(&self.sim.bytes(id(buffer))[first..][..bytes.len()]);
        Ok(())
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        let timed = |sim: &mut CpuSim, (label, command): &(&'static str, Command)| {
            let start = Instant::now();
            match command {
                Command::Dispatch(dispatch) => {
                    let buffers: Vec<BufferId> = dispatch.buffers.iter().map(id).collect();
                    let count = dispatch.counted.as_ref().map_or(dispatch.count, |counted| {
                        let bytes = &sim.bytes(id(&counted.buffer))[4 * counted.word..][..4];
                        bytemuck::pod_read_unaligned::<u32>(bytes).min(dispatch.count)
                    });
                    sim.dispatch(dispatch.kernel, count, &dispatch.push, &buffers);
                }
                Command::Clear(buffer) => sim.clear(id(buffer)),
                Command::Copy { from, to } => {
                    sim.bytes_mut(id(to)).copy_from_slice(&sim.bytes(id(from)));
                }
                // It is where the host is.
                Command::Fetch { .. } => {}
            }
            Timing { label, seconds: start.elapsed().as_secs_f64() }
        };
        self.traffic.note(recording);
        Ok(self.sim.within(|sim| recording.commands().iter().map(|command| timed(sim, command)).collect()))
    }

    fn memory(&self) -> MemoryUse {
        self.memory
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn run_on_host(&self, work: &mut (dyn FnMut() + Send)) {
        self.sim.install(work);
    }
}

#[cfg(test)]
mod tests {
    use super::super::on_host;
    use super::*;

    #[test]
    fn work_of_the_host_has_the_threads_of_the_device() {
        for threads in [1, 3] {
            let device = CpuDevice::new(threads).unwrap();
            assert_eq!(on_host(&device, rayon::current_num_threads), threads);
        }
        let device = CpuDevice::with_order(Order::Descending, 0).unwrap();
        assert_eq!(on_host(&device, rayon::current_num_threads), rayon::current_num_threads());
    }
}

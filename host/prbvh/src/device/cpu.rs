//! The kernels on the CPU, behind the same interface as a GPU.

use super::{
    Buffer, Command, Device, DeviceError, DeviceInfo, DeviceKind, Fill, MemoryUse, Recording, Timing, Traffic,
};
use prbvh_cpu_sim::{BufferId, CpuSim, Order, Pages};
use prbvh_kernel::node::Node;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

/// The CPU as a device.
#[derive(Debug)]
pub struct CpuDevice {
    sim: CpuSim,
    info: DeviceInfo,
    memory: MemoryUse,
    traffic: Traffic,
    /// What the handles stand for.
    live: HashMap<u64, (Buffer, BufferId)>,
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
        Ok(Self::over(sim))
    }

    /// The production device on the threads of a pool that the caller has: no others are started.
    #[must_use]
    pub fn in_pool(pool: Arc<rayon::ThreadPool>) -> Self {
        Self::over(CpuSim::in_pool(pool))
    }

    /// A device on the threads of the pool from which it is asked.
    pub(crate) fn in_this_pool() -> Self {
        Self::over(CpuSim::in_this_pool())
    }

    fn over(sim: CpuSim) -> Self {
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
            kernel_buffers: u32::MAX,
        };
        Self { sim, info, memory: MemoryUse::default(), traffic: Traffic::default(), live: HashMap::new() }
    }

    /// What a handle stands for.
    fn find(&self, buffer: &Buffer) -> Result<BufferId, DeviceError> {
        match self.live.get(&buffer.id) {
            Some((own, id)) if own.is_same(buffer) => Ok(*id),
            _ => Err(buffer.not_here()),
        }
    }

    /// The same, if it has so many bytes.
    fn find_bytes(&self, buffer: &Buffer, bytes: usize) -> Result<BufferId, DeviceError> {
        let id = self.find(buffer)?;
        if bytes as u64 <= buffer.bytes() { Ok(id) } else { Err(buffer.too_short(bytes)) }
    }
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
        let id = self.sim.allocate(bytes, pages).map_err(|_| refused())?;
        self.traffic.allocations += 1;
        self.memory.bytes += bytes as u64;
        self.memory.peak_bytes = self.memory.peak_bytes.max(self.memory.bytes);
        let buffer = Buffer::new(label, length, element_bytes);
        self.live.insert(buffer.id, (buffer.clone(), id));
        Ok(buffer)
    }

    fn free(&mut self, buffer: Buffer) {
        if let Ok(id) = self.find(&buffer) {
            self.live.remove(&buffer.id);
            self.sim.free(id);
            self.memory.bytes -= buffer.bytes();
        }
    }

    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        let id = self.find_bytes(buffer, bytes.len())?;
        self.traffic.bytes_in += bytes.len() as u64;
        self.sim.bytes_mut(id)[..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }

    fn upload_with(&mut self, buffer: &Buffer, bytes: usize, fill: Fill<'_>) -> Result<(), DeviceError> {
        let id = self.find_bytes(buffer, bytes)?;
        self.traffic.bytes_in += bytes as u64;
        let mut whole = self.sim.bytes_mut(id);
        let written = &mut whole[..bytes];
        self.sim.install(|| fill(0, &mut *written));
        Ok(())
    }

    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        let id = self.find_bytes(buffer, first.saturating_add(bytes.len()))?;
        self.traffic.bytes_out += bytes.len() as u64;
        bytes.copy_from_slice(&self.sim.bytes(id)[first..][..bytes.len()]);
        Ok(())
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        for buffer in recording.commands().iter().flat_map(|(_, command)| command.buffers()) {
            self.find(buffer)?;
        }
        let live = &self.live;
        let id = |buffer: &Buffer| live[&buffer.id].1;
        let timed = |sim: &mut CpuSim, (label, command): &(&'static str, Command)| {
            let start = Instant::now();
            match command {
                Command::Dispatch(dispatch) => {
                    let buffers: Vec<BufferId> = dispatch.buffers.iter().map(&id).collect();
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
    fn buffers_of_others_are_refused_by_name() {
        let (mut device, mut other) = (CpuDevice::new(1).unwrap(), CpuDevice::new(1).unwrap());
        let own = device.allocate("own", 2, 4).unwrap();
        let foreign = other.allocate("foreign", 2, 4).unwrap();
        let is_refused = |error: DeviceError, name: &str| {
            assert_eq!(error.to_string(), format!("buffer {name}: it is not, or no longer, a buffer of this device"));
        };
        is_refused(device.upload(&foreign, &[7; 8]).unwrap_err(), "foreign");
        is_refused(device.download(&foreign, &mut [0; 8]).unwrap_err(), "foreign");
        let mut recording = Recording::new();
        recording.copy("copy", &own, &foreign);
        is_refused(device.run(&recording).unwrap_err(), "foreign");
        device.free(foreign.clone());
        assert_eq!((device.memory().bytes, other.memory().bytes), (8, 8));
        other.upload(&foreign, &[7; 8]).unwrap();
        assert_eq!(device.upload(&own, &[7; 9]).unwrap_err().to_string(), "buffer own: 9 bytes wanted, but it has 8");
        let error = device.upload_with(&own, 12, &mut |_, _| panic!("there is no room")).unwrap_err();
        assert_eq!(error.to_string(), "buffer own: 12 bytes wanted, but it has 8");
        assert!(device.download_from(&own, 5, &mut [0; 4]).is_err());
        device.free(own.clone());
        is_refused(device.upload(&own, &[7; 8]).unwrap_err(), "own");
        device.free(own);
        assert_eq!(device.memory().bytes, 0);
    }

    #[test]
    fn work_of_the_host_has_the_threads_of_the_device() {
        for threads in [1, 3] {
            let device = CpuDevice::new(threads).unwrap();
            assert_eq!(on_host(&device, rayon::current_num_threads), threads);
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).thread_name(|k| format!("mine {k}")).build().unwrap();
        let device = CpuDevice::in_pool(Arc::new(pool));
        let name = on_host(&device, || std::thread::current().name().map(str::to_owned));
        assert!(name.is_some_and(|name| name.starts_with("mine ")));
        assert_eq!(device.info().name, "CPU, 2 threads");
        let device = CpuDevice::with_order(Order::Descending, 0).unwrap();
        assert_eq!(on_host(&device, rayon::current_num_threads), rayon::current_num_threads());
    }
}

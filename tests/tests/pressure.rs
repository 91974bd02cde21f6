//! Memory that is refused, and calls that fail: at every place where they can, a clear error and nothing left behind.

use prbvh::bvh::{Bvh, tree_hash};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Buffer, Device, DeviceError, Recording, Timing};
use prbvh::pipeline::{Optimizer, PipelineError, Settings, optimize};
use prbvh::scene::Scene;
use prbvh::trace::TraceError;
use prbvh_lab::render::{Camera, RenderError, RenderSettings, render};
use prbvh_lab::stability::methods;
use prbvh_tests::devices::vulkan_devices;
use prbvh_tests::fixtures::soup;
use std::ops::ControlFlow;

const TRIANGLES: usize = 60;
const FAILED: &str = "this call was to fail";

/// A device of little memory, of which a call may fail.
struct Pressed<'a> {
    device: &'a mut dyn Device,
    /// Bytes that there are.
    most: u64,
    /// Calls that may fail, from now on; the one after them does.
    calls: usize,
    /// Label and total of each allocation that was granted.
    granted: Vec<(&'static str, u64)>,
}

impl<'a> Pressed<'a> {
    fn new(device: &'a mut dyn Device, most: u64, calls: usize) -> Self {
        Self { device, most, calls, granted: Vec::new() }
    }

    fn call(&mut self) -> Result<(), DeviceError> {
        match self.calls.checked_sub(1) {
            Some(left) => self.calls = left,
            None => return Err(DeviceError::NoDevice(FAILED.to_owned())),
        }
        Ok(())
    }
}

impl device::Layer for Pressed<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        self.call()?;
        let bytes = (length * element_bytes) as u64;
        let total = self.device.memory().bytes + bytes;
        if total > self.most {
            let device = self.device.info().name.clone();
            return Err(DeviceError::OutOfMemory { what: label.to_owned(), bytes, device });
        }
        self.granted.push((label, total));
        self.device.allocate(label, length, element_bytes)
    }

    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        self.call()?;
        self.device.upload(buffer, bytes)
    }

    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        self.call()?;
        self.device.download_from(buffer, first, bytes)
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        self.call()?;
        self.device.run(recording)
    }
}

fn initial_tree(scene: &Scene, device: &mut dyn Device) -> Result<Bvh, PipelineError> {
    let settings = Settings::default().with(|s| s.optimizer = Optimizer::None);
    Ok(optimize(scene, device, &settings, &mut |_| ControlFlow::Continue(()))?.tree)
}

/// Work on a device: what it makes, or the device's error and its text.
type Work<'a> = dyn Fn(&mut dyn Device) -> Result<String, (DeviceError, String)> + 'a;

fn of_pipeline(error: PipelineError) -> (DeviceError, String) {
    let text = error.to_string();
    match error {
        PipelineError::Device(error) | PipelineError::Collapse(prbvh::collapse::CollapseError::Device(error)) => {
            (error, text)
        }
        other => panic!("not the device's error: {other}"),
    }
}

/// The methods on `scene`, and a picture of it, by name.
fn works(scene: &Scene) -> Vec<(String, Box<Work<'_>>)> {
    let mut works: Vec<(String, Box<Work<'_>>)> = Vec::new();
    for method in methods() {
        let mut settings = method.settings;
        let limits = &mut settings.prbvh.limits;
        limits.max_iterations = limits.max_iterations.min(2);
        let work = move |device: &mut dyn Device| {
            optimize(scene, device, &settings, &mut |_| ControlFlow::Continue(()))
                .map(|made| tree_hash(&made.tree))
                .map_err(of_pipeline)
        };
        works.push((method.name.to_owned(), Box::new(work)));
    }
    works.push(("the initial tree alone".to_owned(), {
        Box::new(|device| Ok(tree_hash(&initial_tree(scene, device).map_err(of_pipeline)?)))
    }));
    let tree = initial_tree(scene, &mut CpuDevice::new(1).unwrap()).unwrap();
    let small = RenderSettings { width: 8, height: 8, samples: 1, bounces: 1, light_samples: 1 };
    let camera = Camera::view(0, &tree.nodes[0].aabb, 1).unwrap();
    let picture = move |device: &mut dyn Device| match render(device, scene, &tree, &camera, &small) {
        Ok(made) => Ok(format!("{:?}", made.radiance)),
        Err(error) => {
            let text = error.to_string();
            let RenderError::Trace(TraceError::Device(error)) = error else { panic!("not the device's error: {text}") };
            Err((error, text))
        }
    };
    works.push(("a picture".to_owned(), Box::new(picture)));
    works
}

fn scene() -> Scene {
    Scene::from_triangles("pressed", soup(TRIANGLES, 0.2, 8)).unwrap()
}

/// Refuses, at each allocation in turn, the last of its bytes. Returns how often an error came.
fn press(name: &str, device: &mut dyn Device, work: &Work<'_>) -> usize {
    let before = device.memory().bytes;
    let mut free = Pressed::new(device, u64::MAX, usize::MAX);
    let expected = work(&mut free).unwrap();
    let granted = free.granted;
    let mut totals: Vec<u64> = granted.iter().map(|&(_, total)| total).collect();
    totals.sort_unstable();
    totals.dedup();
    assert!(!totals.is_empty(), "{name}: nothing is allocated");
    for &total in &totals {
        let most = total - 1;
        let (label, _) = granted.iter().find(|(_, total)| *total > most).unwrap();
        let (error, text) = work(&mut Pressed::new(device, most, usize::MAX)).expect_err(name);
        assert!(matches!(&error, DeviceError::OutOfMemory { what, .. } if what == label), "{name}: {error}");
        assert!(text.starts_with(&format!("no memory for {label} (")) && text.contains(&device.info().name), "{text}");
        assert_eq!(device.memory().bytes, before, "{name}: what is left after {text}");
    }
    let most = *totals.last().unwrap();
    assert!(work(&mut Pressed::new(device, most, usize::MAX)).unwrap() == expected, "{name}: with just enough memory");
    assert_eq!(device.memory().bytes, before, "{name}: what is left after its end");
    totals.len()
}

/// Lets each call in turn fail. Returns how often an error came.
fn fail(name: &str, device: &mut dyn Device, work: &Work<'_>) -> usize {
    let before = device.memory().bytes;
    for calls in 0..10_000 {
        let result = work(&mut Pressed::new(device, u64::MAX, calls));
        assert_eq!(device.memory().bytes, before, "{name}: what is left when call {calls} failed");
        match result {
            Ok(_) => return calls,
            Err((_, text)) => assert_eq!(text, FAILED, "{name}, call {calls}"),
        }
    }
    panic!("{name} never ends")
}

#[test]
fn refused_memory_is_a_clear_error_that_leaves_nothing() {
    let scene = scene();
    let mut devices = vulkan_devices();
    devices.push(("CPU".to_owned(), Box::new(CpuDevice::new(2).unwrap())));
    for (on, device) in &mut devices {
        for (name, work) in works(&scene) {
            let refused = press(&format!("{name} on {on}"), &mut **device, &*work);
            println!("{name} on {on}: refused at {refused} sizes");
        }
    }
}

#[test]
fn calls_that_fail_leave_nothing() {
    let scene = scene();
    let mut device = CpuDevice::new(1).unwrap();
    for (name, work) in works(&scene) {
        let failed = fail(&name, &mut device, &*work);
        println!("{name}: {failed} calls failed");
        // An allocation, an upload, a dispatch and a download, at least.
        assert!(failed >= 4, "{name}");
    }
}

/// The comparer itself: work that keeps a buffer when it fails.
#[test]
#[should_panic(expected = "careless: what is left after no memory for second")]
fn a_buffer_left_behind_is_found() {
    let careless = |device: &mut dyn Device| {
        let refused = |error: DeviceError| {
            let text = error.to_string();
            (error, text)
        };
        let first = device.allocate("first", 10, 4).map_err(refused)?;
        let second = device.allocate("second", 10, 4).map_err(refused)?;
        device.free(first);
        device.free(second);
        Ok(String::new())
    };
    press("careless", &mut CpuDevice::new(1).unwrap(), &careless);
}

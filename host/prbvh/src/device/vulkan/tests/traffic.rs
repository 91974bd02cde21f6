//! How often the host speaks with a device whose memory it does not reach.

use super::*;
use crate::build::{self, DeviceTree, MortonBits};
use crate::collapse::{CollapseSettings, collapse_sound};
use crate::device::cpu::CpuDevice;
use crate::device::{Command, DeviceKind};
use crate::optimize::{Order, PrbvhSettings, measure_unchecked, prbvh_unchecked};
use crate::pipeline::{Settings, optimize};
use crate::presplit::{PresplitSettings, presplit};
use crate::scene::Scene;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Duration;

/// A GPU in all that is asked of it. Counts the dispatches of each kernel.
struct AsGpu(VulkanDevice, DeviceInfo, BTreeMap<Kernel, u32>);

impl crate::device::Layer for AsGpu {
    fn inner(&self) -> &dyn Device {
        &self.0
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.0
    }

    fn info(&self) -> &DeviceInfo {
        &self.1
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        for (_, command) in recording.commands() {
            if let Command::Dispatch(dispatch) = command {
                *self.2.entry(dispatch.kernel).or_default() += 1;
            }
        }
        self.0.run(recording)
    }
}

const HOUR: Duration = Duration::from_hours(1);
const TRIANGLES: usize = 20_000;

fn scene() -> Scene {
    crate::scene::built_in(TRIANGLES)
}

/// `news`: an hour is so long that the time that rounds take on this machine does not matter.
fn settings(order: Order, news: Duration) -> Settings {
    let prbvh = PrbvhSettings { order, news, ..PrbvhSettings::default() };
    Settings { prbvh, ..Settings::default() }
}

/// Tree, rows and traffic of a run.
fn run(device: &mut dyn Device, settings: &Settings) -> (String, usize, Traffic) {
    let before = device.traffic();
    let optimized = optimize(&scene(), device, settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let traffic = device.traffic().since(before);
    (crate::bvh::tree_hash(&optimized.tree), optimized.outcome.rows.len(), traffic)
}

#[test]
fn many_rounds_go_in_one_submission() {
    if left_out("many_rounds_go_in_one_submission") {
        return;
    }
    let mut cpu = CpuDevice::new(0).unwrap();
    let device = open(options(Access::Never));
    let info = DeviceInfo { kind: DeviceKind::VulkanGpu, ..Device::info(&device).clone() };
    let mut device = AsGpu(device, info, BTreeMap::new());
    for (order, most) in [(Order::Published, 12), (Order::WorstFirst, 14)] {
        let (expected, rows, _) = run(&mut cpu, &settings(order, HOUR));
        device.2.clear();
        let (hash, _, together) = run(&mut device, &settings(order, HOUR));
        println!("{order}: {rows} rows, {together:?}, {:?}", device.2);
        assert_eq!(hash, expected, "{order}");
        assert!(together.submissions <= most, "{order}: {} rows, {together:?}", rows);
        let (hash, _, alone) = run(&mut device, &settings(order, Duration::ZERO));
        assert_eq!(hash, expected, "{order}, row by row");
        assert!(alone.submissions > together.submissions + rows as u64 / 2, "{order}: {alone:?}");
    }
    device.0.close().unwrap();
}

/// A method by itself, from triangles or from an LBVH.
struct Method {
    name: &'static str,
    /// Most submissions.
    most: u64,
    run: fn(&mut AsGpu, &[Triangle], &DeviceTree),
}

const METHODS: &[Method] = &[
    Method {
        name: "lbvh",
        most: 1,
        run: |device, triangles, _| {
            let (tree, _) = build::lbvh(device, triangles, MortonBits::default()).unwrap();
            tree.free(device);
        },
    },
    Method {
        name: "ploc",
        most: 9,
        run: |device, triangles, _| {
            let (tree, _, _) = build::ploc(device, triangles, MortonBits::default(), build::DEFAULT_RADIUS).unwrap();
            tree.free(device);
        },
    },
    Method {
        name: "hploc",
        most: 3,
        run: |device, triangles, _| {
            let radius = build::DEFAULT_HPLOC_RADIUS;
            let (tree, _) = build::hploc(device, triangles, MortonBits::default(), radius).unwrap();
            tree.free(device);
        },
    },
    #[cfg(feature = "atrbvh")]
    Method {
        name: "atrbvh",
        most: 17,
        run: |device, triangles, _| {
            let size = build::TreeletSize::DEFAULT;
            let (tree, _, _) = build::atrbvh(device, triangles, MortonBits::default(), size).unwrap();
            tree.free(device);
        },
    },
    #[cfg(feature = "atrbvh")]
    Method {
        name: "trbvh",
        most: 11,
        run: |device, triangles, _| {
            let passes = build::DEFAULT_PASSES;
            let (tree, _, _) = build::trbvh(device, triangles, MortonBits::default(), passes).unwrap();
            tree.free(device);
        },
    },
    Method {
        name: "k-means",
        most: 11,
        run: |device, triangles, _| {
            let settings = build::KMeansSettings::default();
            let (tree, _) = build::kmeans(device, triangles, MortonBits::default(), &settings).unwrap();
            tree.free(device);
        },
    },
    Method {
        name: "presplit",
        most: 18,
        run: |device, triangles, _| drop(presplit(device, triangles, &PresplitSettings::default()).unwrap()),
    },
    Method { name: "worst first", most: 10, run: |device, _, tree| prbvh(device, tree, Order::WorstFirst) },
    Method { name: "published order", most: 6, run: |device, _, tree| prbvh(device, tree, Order::Published) },
    Method {
        name: "collapse",
        most: 8,
        run: |device, _, tree| {
            let collapsed = collapse_sound(device, tree, &CollapseSettings::default()).unwrap();
            collapsed.free(device);
        },
    },
];

fn prbvh(device: &mut AsGpu, tree: &DeviceTree, order: Order) {
    let (areas, _) = measure_unchecked(device, tree).unwrap();
    let settings = settings(order, HOUR).prbvh;
    prbvh_unchecked(device, tree, Some(areas), &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap();
}

#[test]
fn no_method_speaks_often_with_a_gpu() {
    if left_out("no_method_speaks_often_with_a_gpu") {
        return;
    }
    let mut device = large_gpu(options(Access::Never));
    for (method, traffic) in table(&mut device, TRIANGLES) {
        assert!(traffic.submissions <= method.most, "{}: {traffic:?}", method.name);
    }
    device.0.close().unwrap();
}

/// The tables of docs/performance.md that this test does not check: `cargo test -p prbvh --lib -- --ignored --nocapture tables_of_traffic`.
#[test]
#[ignore = "prints tables; minutes"]
fn tables_of_traffic() {
    let mut device = large_gpu(Options { validate: false, ..options(Access::Never) });
    for triangles in [TRIANGLES, 250_000] {
        println!("\nbuilt-in scene, {triangles} triangles\n");
        table(&mut device, triangles);
    }
    println!("\ndispatches by kernel, {TRIANGLES} triangles\n");
    for order in [Order::WorstFirst, Order::Published] {
        let (tree, _) = build::lbvh(&mut device, &scene().triangles, MortonBits::default()).unwrap();
        device.2.clear();
        prbvh(&mut device, &tree, order);
        tree.free(&mut device);
        let mut kernels: Vec<_> = device.2.iter().map(|(kernel, count)| (*count, kernel.info().name)).collect();
        kernels.sort_by(|a, b| b.cmp(a));
        let list: Vec<_> = kernels.iter().map(|(count, name)| format!("`{name}` {count}")).collect();
        println!("| {order} | {} |", list.join(", "));
    }
}

/// A GPU of many invocations.
fn large_gpu(options: Options) -> AsGpu {
    let device = open(options);
    let info = DeviceInfo { kind: DeviceKind::VulkanGpu, busy_invocations: 1 << 18, ..Device::info(&device).clone() };
    AsGpu(device, info, BTreeMap::new())
}

/// Prints what each method asks of a device, and returns it.
fn table(device: &mut AsGpu, triangles: usize) -> Vec<(&'static Method, Traffic)> {
    let triangles = crate::scene::built_in(triangles).triangles;
    println!("| | submissions | pieces ahead | dispatches | KB in | KB out |");
    println!("|---|--:|--:|--:|--:|--:|");
    let count = |method: &'static Method| {
        let (tree, _) = build::lbvh(device, &triangles, MortonBits::default()).unwrap();
        let before = device.traffic();
        (method.run)(device, &triangles, &tree);
        let traffic = device.traffic().since(before);
        let Traffic { submissions, ahead, dispatches, bytes_in, bytes_out, .. } = traffic;
        let (kb_in, kb_out) = (bytes_in / 1000, bytes_out / 1000);
        println!("| {} | {submissions} | {ahead} | {dispatches} | {kb_in} | {kb_out} |", method.name);
        tree.free(device);
        (method, traffic)
    };
    METHODS.iter().map(count).collect()
}

#[test]
fn memory_is_used_again() {
    if left_out("memory_is_used_again") {
        return;
    }
    let mut device = open(options(Access::Never));
    let first = buffer_of(&mut device, "first", &[7u32; 1000]);
    device.free(first.clone());
    let again = device.allocate("again", 1000, 4).unwrap();
    assert_eq!(content::<u32>(&mut device, &again), vec![0; 1000], "the memory, not the content");
    assert!(device.upload(&first, &[0; 4]).is_err(), "the handle has ended");
    device.free(again);

    let settings = settings(Order::WorstFirst, HOUR);
    let (first, _, _) = run(&mut device, &settings);
    let held = device.device.heap().bytes();
    let (second, _, traffic) = run(&mut device, &settings);
    assert_eq!((first, device.device.heap().bytes()), (second, held), "a second run of the same size");
    assert!(traffic.allocations > 20 && held < 100 << 20, "{traffic:?} in {held} bytes");
    device.close().unwrap();
}

#[test]
fn bytes_and_zeros_wait_for_the_next_work() {
    if left_out("bytes_and_zeros_wait_for_the_next_work") {
        return;
    }
    let mut device = open(options(Access::Never));
    let before = device.traffic();
    let gone = buffer_of(&mut device, "gone before it is filled", &[1u32; 1000]);
    device.free(gone);
    let words = buffer_of(&mut device, "words", &[1u32, 2, 3]);
    device.upload(&words, bytemuck::cast_slice(&[7u32, 8])).unwrap();
    let zeros = device.allocate("zeros", 3, 4).unwrap();
    assert_eq!(device.traffic().since(before).submissions, 0);
    assert_eq!(content::<u32>(&mut device, &words), [7, 8, 3]);
    assert_eq!(content::<u32>(&mut device, &zeros), [0; 3]);
    let traffic = device.traffic().since(before);
    assert_eq!((traffic.submissions, traffic.bytes_in, traffic.bytes_out), (2, 4020, 24));
    device.close().unwrap();
}

#[test]
fn what_is_fetched_comes_along_until_something_changes() {
    if left_out("what_is_fetched_comes_along_until_something_changes") {
        return;
    }
    on_each_access(|device| {
        let from = buffer_of(device, "from", &[1u32, 2, 3, 4]);
        let to = device.allocate("to", 4, 4).unwrap();
        let other = buffer_of(device, "other", &[9u32; 2]);
        let mut recording = Recording::new();
        recording.fetch("early", &to, 8);
        recording.copy("copy", &from, &to);
        recording.fetch("late", &to, 12);
        recording.fetch("late", &other, 8);
        assert_eq!(device.run(&recording).unwrap().len(), 4);
        let before = device.traffic().submissions;
        let read = |device: &mut VulkanDevice, buffer: &Buffer, first: usize, words: usize| {
            let mut read = vec![0u32; words];
            device.download_from(buffer, first, bytemuck::cast_slice_mut(&mut read)).unwrap();
            read
        };
        assert_eq!(read(device, &to, 0, 3), [1, 2, 3], "the later of two");
        assert_eq!(read(device, &to, 4, 2), [2, 3]);
        assert_eq!(read(device, &other, 0, 2), [9, 9]);
        assert_eq!(device.traffic().submissions, before);
        assert_eq!(read(device, &to, 0, 4), [1, 2, 3, 4], "more than was fetched");
        device.upload(&to, bytemuck::cast_slice(&[5u32])).unwrap();
        assert_eq!(read(device, &to, 0, 2), [5, 2], "changed by the host");
        device.run(&recording).unwrap();
        let mut again = Recording::new();
        again.clear("clear", &to);
        device.run(&again).unwrap();
        assert_eq!(read(device, &to, 0, 2), [0, 0], "changed by the device");
        device.run(&recording).unwrap();
        device.free(to);
        let to = device.allocate("to", 4, 4).unwrap();
        assert_eq!(read(device, &to, 0, 2), [0, 0], "another buffer");
    });
}

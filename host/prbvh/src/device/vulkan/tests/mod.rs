//! The device itself, on the best Vulkan device of this machine and under the validation layer.

mod external;
mod pipeline;
mod ring;
mod traffic;

use super::*;
use ash::vk;
use bytemuck::Zeroable;
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::grid;
use prbvh_kernel::mem::Slot;
use prbvh_kernel::native::Alone;
use prbvh_kernel::prbvh::PrbvhParams;
use prbvh_kernel::setup::{self, BOUNDS_CHUNK, BoundsParams, BoxesParams, Triangle};
use prbvh_kernel::sort::GatherParams;

/// Words of a 2-D grid with a ragged end; 65,535 workgroups hold 4,194,240.
const MANY_WORDS: u32 = 5_000_001;

fn options(access: Access) -> Options {
    Options { validate: true, atomics_64: true, access, timestamps: true, cache_folder: None }
}

fn open(options: Options) -> VulkanDevice {
    VulkanDevice::open_with(Selection::Automatic, options).unwrap_or_else(|error| {
        panic!(
            "{error}\nThe Vulkan tests need a driver and the validation layer; PRBVH_WITHOUT_VULKAN=1 leaves them out."
        )
    })
}

/// Runs a test on a device as users open it, and on one whose bytes all go through the staging buffer.
fn on_each_access(test: impl Fn(&mut VulkanDevice)) {
    for access in [Access::WherePossible, Access::Never] {
        let mut device = open(options(access));
        test(&mut device);
        device.close().unwrap();
    }
}

/// Whether Vulkan was asked to be left out; says so under the name of the test.
pub(super) fn left_out(test: &str) -> bool {
    let left_out = std::env::var_os("PRBVH_WITHOUT_VULKAN").is_some_and(|value| value == "1");
    if left_out {
        println!("not run: {test} (PRBVH_WITHOUT_VULKAN=1)");
    }
    left_out
}

/// `splitmix64`.
fn random(seed: u64) -> impl FnMut() -> u32 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 32) as u32
    }
}

fn random_triangles(count: usize) -> Vec<Triangle> {
    let mut random = random(7);
    let mut corner = || [(); 3].map(|()| (random() as f32 / u32::MAX as f32 - 0.3) * 1e3);
    (0..count).map(|_| Triangle { a: corner(), b: corner(), c: corner() }).collect()
}

/// Allocates a buffer and fills it.
fn buffer_of<T: bytemuck::Pod>(device: &mut VulkanDevice, label: &'static str, content: &[T]) -> Buffer {
    let buffer = device.allocate(label, content.len(), size_of::<T>()).unwrap();
    device.upload(&buffer, bytemuck::cast_slice(content)).unwrap();
    buffer
}

fn content<T: bytemuck::Pod>(device: &mut VulkanDevice, buffer: &Buffer) -> Vec<T> {
    let mut content = vec![T::zeroed(); buffer.length];
    device.download(buffer, bytemuck::cast_slice_mut(&mut content)).unwrap();
    content
}

#[test]
fn bytes_come_back_as_they_went() {
    if left_out("bytes_come_back_as_they_went") {
        return;
    }
    on_each_access(|device| {
        let mut random = random(1);
        // The last is longer than all that is kept for bytes on their way.
        for length in [0, 1, 3, 4, 5, 63, 65_537, (64 << 20) + 5] {
            let buffer = device.allocate("bytes", length, 1).unwrap();
            assert!(content::<u8>(device, &buffer).iter().all(|&byte| byte == 0), "{length} bytes are not zeroed");
            let bytes: Vec<u8> = (0..length).map(|_| random() as u8).collect();
            device.upload(&buffer, &bytes).unwrap();
            assert!(content::<u8>(device, &buffer) == bytes, "{length} bytes differ");

            // A part of the buffer leaves the rest alone.
            let half = length / 2;
            device.upload(&buffer, &vec![9; half]).unwrap();
            let mut after = vec![0; length];
            device.download(&buffer, &mut after).unwrap();
            assert!(after[..half].iter().all(|&byte| byte == 9) && after[half..] == bytes[half..]);
            for first in [half / 3, half, length] {
                let mut part = vec![0; (length - first).div_ceil(2)];
                device.download_from(&buffer, first, &mut part).unwrap();
                assert!(part == after[first..][..part.len()], "{} bytes from {first} on differ", part.len());
            }
            device.free(buffer);
        }
    });
}

#[test]
fn boxes_and_bounds_have_the_bits_of_the_native_functions() {
    if left_out("boxes_and_bounds_have_the_bits_of_the_native_functions") {
        return;
    }
    let triangles = random_triangles(100_000);
    let count = triangles.len() as u32;
    let chunks = count.div_ceil(BOUNDS_CHUNK);
    let boxes_params = BoxesParams { count };
    let bounds_params = BoundsParams { count: grid::invocations(chunks), boxes: count };

    let mut native_boxes = vec![Aabb::zeroed(); triangles.len()];
    let slots = Slot::from_mut_slice(&mut native_boxes);
    (0..count).for_each(|i| setup::boxes(i, &triangles, slots));
    let mut native_united = vec![Aabb::zeroed(); chunks as usize];
    let slots = Slot::from_mut_slice(&mut native_united);
    for group in (0..chunks).map(|group| Alone { group }) {
        setup::bounds(&group, &bounds_params, &native_boxes, slots, &group.memory());
    }

    on_each_access(|device| {
        let input = buffer_of(device, "triangles", &triangles);
        let boxes = device.allocate("boxes", triangles.len(), size_of::<Aabb>()).unwrap();
        let united = device.allocate("united", chunks as usize, size_of::<Aabb>()).unwrap();
        let mut recording = Recording::new();
        recording.dispatch("boxes", Kernel::SetupBoxes, count, &boxes_params, &[&input, &boxes]);
        recording.dispatch("bounds", Kernel::SetupBounds, bounds_params.count, &bounds_params, &[&boxes, &united]);
        let timings = device.run(&recording).unwrap();

        let labels: Vec<_> = timings.iter().map(|timing| timing.label).collect();
        assert_eq!(labels, ["boxes", "bounds"]);
        let keeps_time = device.device.physical().timestamp_bits > 0;
        assert!(timings.iter().all(|timing| (timing.seconds > 0.0) == keeps_time && timing.seconds < 60.0));
        let same = |device: &mut VulkanDevice, buffer: &Buffer, native: &[Aabb]| {
            bytemuck::cast_slice::<Aabb, u8>(&content(device, buffer)) == bytemuck::cast_slice::<Aabb, u8>(native)
        };
        assert!(same(device, &boxes, &native_boxes), "boxes differ");
        assert!(same(device, &united, &native_united), "bounds differ");
    });
}

#[test]
fn a_dispatch_may_have_more_workgroups_than_fit_one_axis() {
    if left_out("a_dispatch_may_have_more_workgroups_than_fit_one_axis") {
        return;
    }
    assert!(workgroups(MANY_WORDS)[1] > 1, "not enough words for a grid of two dimensions");
    let words: Vec<u32> = (0..MANY_WORDS).map(|k| k.wrapping_mul(0x9e37_79b9)).collect();
    let order: Vec<u32> = (0..MANY_WORDS).rev().collect();
    let mut device = open(options(Access::WherePossible));
    let [order, source] =
        [("order", &order), ("words", &words)].map(|(label, data)| buffer_of(&mut device, label, data));
    let gathered = device.allocate("gathered", words.len(), 4).unwrap();
    let mut recording = Recording::new();
    let params = GatherParams { count: MANY_WORDS };
    recording.dispatch("gather", Kernel::SortGather, MANY_WORDS, &params, &[&order, &source, &gathered]);
    device.run(&recording).unwrap();
    assert!(content::<u32>(&mut device, &gathered).iter().eq(words.iter().rev()));
    device.close().unwrap();
}

#[test]
fn commands_run_in_order() {
    if left_out("commands_run_in_order") {
        return;
    }
    on_each_access(|device| {
        let words: Vec<u32> = (1..=1000).collect();
        let order: Vec<u32> = (0..1000).map(|k| (k + 1) % 1000).collect();
        let [order, mut from] =
            [("order", order), ("from", words)].map(|(label, data)| buffer_of(device, label, &data));
        let mut to = device.allocate("to", 1000, 4).unwrap();
        let [copy, cleared, empty] =
            [("copy", 1000), ("cleared", 1000), ("empty", 0)].map(|(label, n)| device.allocate(label, n, 4).unwrap());
        device.upload(&cleared, &[7; 4000]).unwrap();

        let mut recording = Recording::new();
        // More commands than the first pools of sets and timestamps hold.
        for k in 0..300 {
            let label = ["there", "there", "back"][k % 3];
            recording.dispatch(label, Kernel::SortGather, 1000, &GatherParams { count: 1000 }, &[&order, &from, &to]);
            std::mem::swap(&mut from, &mut to);
        }
        recording.copy("copy", &from, &copy);
        recording.clear("clear", &from);
        recording.copy("to itself", &copy, &copy);
        recording.copy("nothing", &empty, &empty.clone());
        recording.clear("clear", &cleared);
        recording.dispatch("none", Kernel::SortGather, 0, &GatherParams { count: 0 }, &[&order, &copy, &cleared]);
        let params = GatherParams { count: 1 };
        recording.dispatch("out of bounds", Kernel::SortGather, 1, &params, &[&empty, &copy, &cleared]);
        // The second run takes the pools of the first.
        for turns in [300, 600] {
            let timings = device.run(&recording).unwrap();
            assert_eq!(timings.len(), 307);
            assert_eq!(timings[305].label, "none");
            // Two of one label in a row are timed together.
            let [first, second, third] = [0, 1, 2].map(|k| timings[k].seconds);
            let keeps_time = device.device.physical().timestamp_bits > 0;
            assert!(first == 0.0 && [second, third].map(|s| s > 0.0) == [keeps_time; 2], "{first} {second} {third}");
            let expected: Vec<u32> = (0..1000).map(|k| (k + turns) % 1000 + 1).collect();
            assert!(content::<u32>(device, &copy) == expected, "after {turns} turns");
            for zero in [&from, &cleared] {
                assert!(content::<u32>(device, zero).iter().all(|&word| word == 0), "{}", zero.label);
            }
            device.upload(&from, bytemuck::cast_slice(&expected)).unwrap();
        }
        assert!(device.run(&Recording::new()).unwrap().is_empty());
    });
}

#[test]
fn memory_is_counted() {
    if left_out("memory_is_counted") {
        return;
    }
    let mut device = open(options(Access::Never));
    assert_eq!(device.memory(), MemoryUse::default());
    let first = device.allocate("first", 5, 3).unwrap();
    let second = device.allocate("second", 100, 4).unwrap();
    assert_eq!(device.memory(), MemoryUse { bytes: 415, peak_bytes: 415 });
    device.free(second.clone());
    device.free(second);
    assert_eq!(device.memory(), MemoryUse { bytes: 15, peak_bytes: 415 });
    device.free(first);
    assert_eq!(device.memory(), MemoryUse { bytes: 0, peak_bytes: 415 });
    device.close().unwrap();
}

#[test]
fn a_buffer_beyond_a_limit_is_refused_by_name() {
    if left_out("a_buffer_beyond_a_limit_is_refused_by_name") {
        return;
    }
    let mut device = open(options(Access::WherePossible));
    let (have, limit) = (device.info().max_buffer_bytes, device.info().max_buffer_limit);
    let length = usize::try_from(have / 4 + 1).unwrap();
    match device.allocate("nodes", length, 4) {
        Err(DeviceError::Limit { what, name, need, have: reported, .. }) => {
            assert_eq!((what.as_str(), name, need, reported), ("buffer nodes", limit, 4 * length as u64, have));
        }
        result => panic!("{result:?}"),
    }
    assert!(matches!(device.allocate("all", usize::MAX, 32), Err(DeviceError::Limit { need: u64::MAX, .. })));
    assert_eq!(device.memory(), MemoryUse::default());
    device.close().unwrap();
}

#[test]
fn a_wrong_index_is_refused_with_the_devices_there_are() {
    if left_out("a_wrong_index_is_refused_with_the_devices_there_are") {
        return;
    }
    let devices = list_devices().unwrap();
    assert!(devices.iter().enumerate().all(|(k, device)| device.index == k));
    match VulkanDevice::open(Selection::Index(devices.len()), false) {
        Err(DeviceError::NoDevice(text)) => {
            assert!(text.contains(&format!("no Vulkan device {}", devices.len())), "{text}");
            assert!(devices.iter().all(|device| text.contains(&device.name)), "{text}");
        }
        result => panic!("{:?}", result.map(|device| device.info().clone())),
    }
    for device in devices.iter().filter(|device| device.is_usable()) {
        let opened = VulkanDevice::open(Selection::Index(device.index), false).unwrap();
        assert_eq!(opened.info().name, device.name);
        assert!(opened.info().max_buffer_bytes >= 128 << 20, "Vulkan promises 2^27 bytes");
    }
}

#[test]
fn buffers_of_nobody_are_refused() {
    if left_out("buffers_of_nobody_are_refused") {
        return;
    }
    let mut device = open(options(Access::WherePossible));
    let buffer = device.allocate("words", 10, 4).unwrap();
    let too_long = device.upload(&buffer, &[0; 41]).unwrap_err();
    assert_eq!(too_long.to_string(), "buffer words: 41 bytes wanted, but it has 40");
    assert!(device.download(&buffer, &mut [0; 41]).is_err());
    assert!(device.download_from(&buffer, 30, &mut [0; 11]).is_err());

    let foreign = Buffer { label: "foreign", ..buffer.clone() };
    device.free(foreign.clone());
    device.upload(&buffer, &[0; 40]).unwrap();
    let mut recording = Recording::new();
    recording.copy("copy", &foreign, &buffer);
    assert!(matches!(device.run(&recording), Err(DeviceError::Buffer { label: "foreign", .. })));

    let mut recording = Recording::new();
    recording.clear("clear", &buffer);
    device.free(buffer);
    let freed = device.run(&recording).unwrap_err();
    assert_eq!(freed.to_string(), "buffer words: it is not, or no longer, a buffer of this device");
    device.close().unwrap();
}

#[test]
fn a_kernel_with_64_bit_atomics_needs_the_feature() {
    if left_out("a_kernel_with_64_bit_atomics_needs_the_feature") {
        return;
    }
    let mut device = open(Options { atomics_64: false, ..options(Access::WherePossible) });
    assert!(!device.info().atomics_64);
    let info = Kernel::PrbvhLock.info();
    let buffers: Vec<_> =
        info.bindings.iter().map(|binding| device.allocate(binding.name, 1, binding.element_bytes).unwrap()).collect();
    let mut recording = Recording::new();
    let buffers: Vec<_> = buffers.iter().collect();
    recording.dispatch("lock", Kernel::PrbvhLock, 1, &PrbvhParams::zeroed(), &buffers);
    let error = device.run(&recording).unwrap_err();
    assert!(matches!(error, DeviceError::Feature { .. }) && error.to_string().contains("shaderBufferInt64Atomics"));
    device.close().unwrap();
}

#[test]
fn every_kernel_has_a_pipeline() {
    if left_out("every_kernel_has_a_pipeline") {
        return;
    }
    let mut device = open(options(Access::WherePossible));
    for &kernel in Kernel::ALL {
        let needs_atomics_64 = needs_atomics_64(kernel);
        if device.info().atomics_64 || !needs_atomics_64 {
            device.runner.pipeline(kernel).unwrap();
        }
    }
    device.close().unwrap();
}

#[test]
fn pipelines_are_kept_in_a_file_that_may_be_damaged() {
    if left_out("pipelines_are_kept_in_a_file_that_may_be_damaged") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let use_pipeline = || {
        let cache_folder = Some(folder.path().join("prbvh"));
        let mut device = open(Options { cache_folder, ..options(Access::WherePossible) });
        device.runner.pipeline(Kernel::SortGather).unwrap();
        device.close().unwrap();
        let files: Vec<_> = std::fs::read_dir(folder.path().join("prbvh")).unwrap().collect();
        assert_eq!(files.len(), 1);
        files[0].as_ref().unwrap().path()
    };
    let file = use_pipeline();
    let good = std::fs::read(&file).unwrap();
    assert!(!good.is_empty());
    std::fs::write(&file, b"damaged").unwrap();
    assert_eq!(use_pipeline(), file);
    assert_eq!(std::fs::read(&file).unwrap().len(), good.len(), "a damaged file is replaced");
    assert_eq!(use_pipeline(), file);
}

#[test]
fn the_validation_layer_finds_a_missing_barrier() {
    if left_out("the_validation_layer_finds_a_missing_barrier") {
        return;
    }
    let mut device = open(options(Access::WherePossible));
    let buffer = device.allocate("words", 10, 4).unwrap();
    let raw = device.buffers.find(&buffer).unwrap().buffer();
    let result = device.submitter.submit(|device, commands| {
        for word in [1, 2] {
            // SAFETY: the buffer is alive; the second write without a barrier is the fault that must be found.
            unsafe { device.cmd_fill_buffer(commands, raw, 0, vk::WHOLE_SIZE, word) };
        }
    });
    match device.validated(result) {
        Err(DeviceError::Validation(text)) => {
            assert!(text.contains("SYNC-HAZARD-WRITE-AFTER-WRITE") && text.contains("buffer words"), "{text}");
        }
        result => panic!("{result:?}"),
    }
    device.close().unwrap();
}

#[test]
fn work_that_was_given_up_on_ends_the_device() {
    if left_out("work_that_was_given_up_on_ends_the_device") {
        return;
    }
    let mut device = open(options(Access::Never));
    let buffer = device.allocate("words", 10, 4).unwrap();
    device.device.abandon();
    let error = device.upload(&buffer, &[0; 40]).unwrap_err();
    assert!(matches!(error, DeviceError::Vulkan { code: 2, .. }), "{error}");
    device.close().unwrap();
}

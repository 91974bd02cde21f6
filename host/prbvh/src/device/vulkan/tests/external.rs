//! A device of a caller, under the validation layer: the caller is this test, which has an instance of its own module's making.

use super::super::instance::Instance;
use super::super::limits::PhysicalDevice;
use super::super::*;
use super::{left_out, random_triangles};
use crate::build::{DeviceTree, Input, MortonBits, lbvh};
use crate::bvh::{Bvh, tree_hash};
use crate::device::cpu::CpuDevice;
use crate::optimize::{PrbvhSettings, Reoptimizer, prbvh};
use crate::scene::SafeRange;
use ash::vk;
use prbvh_kernel::setup::Triangle;
use std::ops::ControlFlow;

/// What a caller has.
struct Caller {
    raw: RawVulkan,
}

impl Caller {
    fn new() -> Self {
        let instance = Instance::shared(true).unwrap();
        let physical = PhysicalDevice::all(instance).unwrap().into_iter().find(|device| device.summary.is_usable());
        let physical = physical.expect("a usable device");
        // SAFETY: the instance lives to the end of the process.
        let mut features = unsafe { KernelFeatures::of(instance.raw(), physical.raw) }.unwrap();
        let atomics_64 = features.atomics_64();
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(physical.queue_family).queue_priorities(&[0.5])];
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut timeline);
        // SAFETY: the chain was just made.
        let info = unsafe { features.add_to(info) };
        // SAFETY: everything of it lives through the call.
        let device = unsafe { instance.raw().create_device(physical.raw, &info, None) }.unwrap();
        // SAFETY: the device has a queue of this family.
        let queue = unsafe { device.get_device_queue(physical.queue_family, 0) };
        let raw = RawVulkan {
            instance: instance.raw().clone(),
            physical_device: physical.raw,
            device,
            queue,
            queue_family: physical.queue_family,
            atomics_64,
            cache_folder: None,
        };
        Self { raw }
    }

    /// A buffer with memory of its own.
    fn buffer(&self, bytes: u64) -> (vk::Buffer, vk::DeviceMemory) {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let device = &self.raw.device;
        // SAFETY: a size above 0 and a usage of core Vulkan.
        let buffer =
            unsafe { device.create_buffer(&vk::BufferCreateInfo::default().size(bytes).usage(usage), None) }.unwrap();
        // SAFETY: the buffer is of this device.
        let needs = unsafe { device.get_buffer_memory_requirements(buffer) };
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(needs.memory_type_bits.trailing_zeros());
        // SAFETY: size and type are what the buffer demands.
        let memory = unsafe { device.allocate_memory(&info, None) }.unwrap();
        // SAFETY: both are new.
        unsafe { device.bind_buffer_memory(buffer, memory, 0) }.unwrap();
        (buffer, memory)
    }

    /// A timeline semaphore at 0.
    fn semaphore(&self) -> vk::Semaphore {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        // SAFETY: the device has timeline semaphores.
        unsafe { self.raw.device.create_semaphore(&vk::SemaphoreCreateInfo::default().push_next(&mut kind), None) }
            .unwrap()
    }
}

#[test]
fn a_tree_is_made_better_where_the_caller_has_it() {
    if left_out("a_tree_is_made_better_where_the_caller_has_it") {
        return;
    }
    let caller = Caller::new();
    let triangles = random_triangles(2_000);
    let working = SafeRange::of(&triangles).apply(&triangles);
    let (settings, goes_on) = (PrbvhSettings::default(), ControlFlow::Continue(()));
    let (nodes, native) = {
        let mut cpu = CpuDevice::new(0).unwrap();
        let (tree, _) = lbvh(&mut cpu, &working, MortonBits::default()).unwrap();
        let nodes = tree.download(&mut cpu).unwrap();
        prbvh(&mut cpu, &tree, &settings, &mut |_, _, _| goes_on).unwrap();
        (nodes, tree.download(&mut cpu).unwrap())
    };

    // The caller's buffer begins with something else, which stays, and ends with something else.
    let offset = 256;
    let bytes = size_of_val(&nodes[..]) as u64;
    let (buffer, memory) = caller.buffer(offset + bytes + 64);
    let semaphore = caller.semaphore();
    // SAFETY: the handles are what they say and outlive the device; nobody else uses the queue.
    let mut device = unsafe { VulkanDevice::from_raw(caller.raw.clone()) }.unwrap();
    // SAFETY: the buffer is as long, and used here only.
    let whole = unsafe { device.adopt("whole", (buffer, 0), (offset + bytes + 64) as usize / 4, 4) }.unwrap();
    device.upload(&whole, &vec![7; (offset + bytes + 64) as usize]).unwrap();
    // SAFETY: as above.
    let adopted = unsafe { device.adopt("nodes", (buffer, offset), nodes.len(), 32) }.unwrap();
    let mut recording = Recording::new();
    recording.clear("clear", &adopted);
    device.run(&recording).unwrap();
    let mut content = vec![0; (offset + bytes + 64) as usize];
    device.download(&whole, &mut content).unwrap();
    let (before, rest) = content.split_at(offset as usize);
    let (inside, after) = rest.split_at(bytes as usize);
    assert!(inside.iter().all(|&byte| byte == 0) && before.iter().chain(after).all(|&byte| byte == 7));

    // Waits for a signal of the caller's host, and signals.
    // SAFETY: the device has timeline semaphores; this one is signalled next.
    unsafe { device.wait_for(semaphore, 1) };
    // SAFETY: the semaphore is at 0.
    unsafe { caller.raw.device.signal_semaphore(&vk::SemaphoreSignalInfo::default().semaphore(semaphore).value(1)) }
        .unwrap();
    device.upload(&adopted, bytemuck::cast_slice(&nodes)).unwrap();
    let tree = DeviceTree { references: 2_000, nodes: adopted.clone() };
    prbvh(&mut device, &tree, &settings, &mut |_, _, _| goes_on).unwrap();
    // SAFETY: nobody else signals it.
    unsafe { device.signal(semaphore, 2) }.unwrap();
    // A driver may tell the host of the semaphore a little later than of the end of the work.
    let (semaphores, values) = ([semaphore], [2]);
    let reached = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
    // SAFETY: the semaphore is of this device.
    unsafe { caller.raw.device.wait_semaphores(&reached, 10_000_000_000) }.unwrap();

    let optimized = tree.download(&mut device).unwrap();
    let hash = |nodes: &[_]| tree_hash(&Bvh::from_device(nodes).unwrap().with_boxes_of(&triangles));
    assert_eq!(hash(&optimized), hash(&native));
    assert_ne!(hash(&optimized), hash(&nodes));
    assert_eq!(device.memory().bytes, 0, "buffers of the caller do not count, and nothing else is left");
    device.free(adopted.clone());
    assert!(matches!(device.upload(&adopted, &[0; 4]), Err(DeviceError::Buffer { .. })));
    device.close().unwrap();

    // The caller's are still there.
    let raw = &caller.raw.device;
    // SAFETY: all are of this device, at rest, and used no more.
    unsafe {
        raw.device_wait_idle().unwrap();
        raw.destroy_semaphore(semaphore, None);
        raw.destroy_buffer(buffer, None);
        raw.free_memory(memory, None);
        raw.destroy_device(None);
    }
    messages::check().unwrap();
}

/// Triangles of the caller's on the device: a tree over them, made better, and followed from frame to frame, and nothing of them passes through the host.
#[test]
fn a_tree_is_made_over_triangles_where_the_caller_has_them() {
    if left_out("a_tree_is_made_over_triangles_where_the_caller_has_them") {
        return;
    }
    let caller = Caller::new();
    let (n, settings) = (2_000, PrbvhSettings::default());
    let frames = [random_triangles(n), random_triangles(n).into_iter().rev().collect::<Vec<_>>()];
    let made = |device: &mut dyn Device, input: Input<'_>| {
        let (tree, _) = lbvh(device, input, MortonBits::default()).unwrap();
        prbvh(device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap();
        let nodes = tree.download(device).unwrap();
        tree.free(device);
        Bvh::from_device(&nodes).unwrap()
    };
    let mut cpu = CpuDevice::new(0).unwrap();
    let native = made(&mut cpu, Input::from(&frames[0]));
    let mut moving = Reoptimizer::new(&mut cpu, &native, &frames[0]).unwrap();
    moving.refit(&frames[1]).unwrap();
    let native_moved = tree_hash(&moving.tree().unwrap());
    drop(moving);

    let bytes = size_of_val(&frames[0][..]) as u64;
    let (buffer, memory) = caller.buffer(bytes);
    // SAFETY: the handles are what they say and outlive the device; nobody else uses the queue.
    let mut device = unsafe { VulkanDevice::from_raw(caller.raw.clone()) }.unwrap();
    // SAFETY: the buffer is as long, and used here only.
    let triangles = unsafe { device.adopt("of the caller", (buffer, 0), n, size_of::<Triangle>()) }.unwrap();
    device.upload(&triangles, bytemuck::cast_slice(&frames[0])).unwrap();
    let before = device.traffic();
    let (tree, _) = lbvh(&mut device, &triangles, MortonBits::default()).unwrap();
    let traffic = device.traffic().since(before);
    assert_eq!((traffic.submissions, traffic.bytes_in), (2, 0));
    tree.free(&mut device);
    let found = made(&mut device, Input::from(&triangles));
    assert_eq!(tree_hash(&found), tree_hash(&native));
    assert_eq!(device.memory().bytes, 0, "what the builder had is gone, what the caller has does not count");

    let mut moving = Reoptimizer::new(&mut device as &mut dyn Device, &found, &frames[0]).unwrap();
    moving.device().upload(&triangles, bytemuck::cast_slice(&frames[1])).unwrap();
    let before = moving.device().traffic();
    moving.refit_on_device(&triangles).unwrap();
    let traffic = moving.device().traffic().since(before);
    assert_eq!((traffic.submissions, traffic.bytes_in), (1, 0));
    assert_eq!(tree_hash(&moving.tree().unwrap()), native_moved);

    // What is no good is named, and is still there.
    let far = Triangle { a: [1e30; 3], ..frames[1][0] };
    moving.device().upload(&triangles, bytemuck::bytes_of(&far)).unwrap();
    assert!(moving.refit_on_device(&triangles).unwrap_err().to_string().contains("out of the range"));
    drop(moving);
    let refused = |device: &mut VulkanDevice, buffer: &Buffer| {
        lbvh(device, buffer, MortonBits::default()).unwrap_err().to_string()
    };
    assert!(refused(&mut device, &triangles).contains("out of the range"));
    // SAFETY: as above.
    let words = unsafe { device.adopt("words", (buffer, 0), n, 4) }.unwrap();
    assert_eq!(refused(&mut device, &words), "buffer words: its elements have 4 bytes, but triangles have 36");
    device.free(triangles.clone());
    assert!(refused(&mut device, &triangles).contains("no longer, a buffer of this device"));
    assert_eq!(device.memory().bytes, 0);
    device.close().unwrap();
    // SAFETY: all are of this device, at rest, and used no more.
    unsafe {
        caller.raw.device.destroy_buffer(buffer, None);
        caller.raw.device.free_memory(memory, None);
        caller.raw.device.destroy_device(None);
    }
    messages::check().unwrap();
}

#[test]
fn what_the_caller_gives_wrongly_is_named() {
    if left_out("what_the_caller_gives_wrongly_is_named") {
        return;
    }
    let caller = Caller::new();
    // SAFETY: the handles are what they say, but for the family, which is looked up before anything is used.
    let error = unsafe { VulkanDevice::from_raw(RawVulkan { queue_family: 1_000, ..caller.raw.clone() }) }.unwrap_err();
    assert!(error.to_string().contains("compute in the family of the queue"), "{error}");
    let (buffer, memory) = caller.buffer(4096);
    // SAFETY: as it should be.
    let mut device = unsafe { VulkanDevice::from_raw(caller.raw.clone()) }.unwrap();
    for (offset, length, element_bytes) in [(2, 8, 4), (0, 0, 4), (0, 3, 1)] {
        // SAFETY: refused.
        let error = unsafe { device.adopt("wrong", (buffer, offset), length, element_bytes) }.unwrap_err();
        assert!(error.to_string().contains("minStorageBufferOffsetAlignment"), "{error}");
    }
    // SAFETY: refused.
    let error = unsafe { device.adopt("long", (buffer, 0), usize::MAX / 32, 32) }.unwrap_err();
    assert!(matches!(error, DeviceError::Limit { .. }), "{error}");
    device.close().unwrap();
    // SAFETY: all are of this device, at rest, and used no more.
    unsafe {
        caller.raw.device.destroy_buffer(buffer, None);
        caller.raw.device.free_memory(memory, None);
        caller.raw.device.destroy_device(None);
    }
}

#[test]
fn features_go_where_the_chain_has_them_already() {
    if left_out("features_go_where_the_chain_has_them_already") {
        return;
    }
    let instance = Instance::shared(true).unwrap();
    let physical = PhysicalDevice::all(instance).unwrap().into_iter().find(|device| device.summary.is_usable());
    let physical = physical.expect("a usable device").raw;
    // SAFETY: the instance lives to the end of the process.
    let features = || unsafe { KernelFeatures::of(instance.raw(), physical) }.unwrap();
    let on = |atomics_64| if atomics_64 { vk::TRUE } else { vk::FALSE };

    let mut ours = features();
    let atomics_64 = ours.atomics_64();
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
    let mut v10 = vk::PhysicalDeviceFeatures2::default();
    // SAFETY: the chain was just made.
    let info = unsafe { ours.add_to(vk::DeviceCreateInfo::default().push_next(&mut v12).push_next(&mut v10)) };
    assert!(info.p_enabled_features.is_null());
    assert_eq!(v10.features.shader_int64, on(atomics_64));
    let has = (v12.vulkan_memory_model, v12.shader_buffer_int64_atomics, v12.timeline_semaphore);
    assert_eq!(has, (vk::TRUE, on(atomics_64), vk::TRUE));

    let mut ours = features();
    let theirs = vk::PhysicalDeviceFeatures::default().geometry_shader(true);
    let mut model = vk::PhysicalDeviceVulkanMemoryModelFeatures::default();
    let info = vk::DeviceCreateInfo::default().enabled_features(&theirs).push_next(&mut model);
    // SAFETY: as above.
    let info = unsafe { ours.add_to(info) };
    // SAFETY: set by `add_to`.
    let enabled = unsafe { &*info.p_enabled_features };
    assert_eq!((enabled.geometry_shader, enabled.shader_int64), (vk::TRUE, on(atomics_64)));
    assert_eq!(model.vulkan_memory_model, vk::TRUE);
    assert_eq!(theirs.shader_int64, vk::FALSE, "what the caller only lent stays as it is");
}

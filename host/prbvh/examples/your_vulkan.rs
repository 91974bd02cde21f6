//! Your Vulkan: your instance, device and queue, triangles in a buffer of yours, the tree in another, semaphores between your work and ours.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, reason = "calls of Vulkan, and promises about its objects")]

use prbvh::bvh::{FlatNode, FlatTree};
use prbvh::device::Device;
use prbvh::device::vulkan::ash::{self, vk};
use prbvh::device::vulkan::{KernelFeatures, RawVulkan, VulkanDevice};
use prbvh::pipeline::{self, Settings};
use prbvh::scene::{Scene, Triangle, built_in};
use std::ops::ControlFlow;

/// A buffer that kernels use and the host reaches.
struct Mapped {
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    content: *mut u8,
}

/// What an engine has.
struct Engine {
    _entry: ash::Entry,
    raw: RawVulkan,
}

impl Engine {
    fn new() -> Result<Self, Box<dyn std::error::Error>> {
        let entry = unsafe { ash::Entry::load() }?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        let instance = unsafe { entry.create_instance(&info, None) }?;
        let all = unsafe { instance.enumerate_physical_devices() }?;
        // The first that the kernels run on.
        let usable =
            all.into_iter().find_map(|device| Some((device, unsafe { KernelFeatures::of(&instance, device) }.ok()?)));
        let (physical_device, mut features) = usable.ok_or("no device that the kernels run on")?;
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical_device) };
        let computes = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
        let queue_family = families.iter().position(computes).ok_or("no queue that computes")? as u32;

        // Your features and queues, then what prbvh needs.
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut timeline);
        let atomics_64 = features.atomics_64();
        let info = unsafe { features.add_to(info) };
        let device = unsafe { instance.create_device(physical_device, &info, None) }?;
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let raw = RawVulkan { instance, physical_device, device, queue, queue_family, atomics_64, cache_folder: None };
        Ok(Self { _entry: entry, raw })
    }

    fn buffer(&self, bytes: usize) -> Result<Mapped, Box<dyn std::error::Error>> {
        let RawVulkan { instance, physical_device, device, .. } = &self.raw;
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let info = vk::BufferCreateInfo::default().size(bytes as u64).usage(usage);
        let buffer = unsafe { device.create_buffer(&info, None) }?;
        let needs = unsafe { device.get_buffer_memory_requirements(buffer) };
        let kinds = unsafe { instance.get_physical_device_memory_properties(*physical_device) };
        let host = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let fits = |&k: &u32| {
            needs.memory_type_bits & (1 << k) != 0 && kinds.memory_types[k as usize].property_flags.contains(host)
        };
        let kind = (0..kinds.memory_type_count).find(fits).ok_or("no memory that the host reaches")?;
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
        let memory = unsafe { device.allocate_memory(&info, None) }?;
        unsafe { device.bind_buffer_memory(buffer, memory, 0) }?;
        let content = unsafe { device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()) }?;
        Ok(Mapped { buffer, memory, content: content.cast() })
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Loader and instance stay to the end of the process: some drivers leave threads behind.
    let engine: &'static Engine = Box::leak(Box::new(Engine::new()?));
    let device = &engine.raw.device;
    let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
    let semaphore = unsafe { device.create_semaphore(&vk::SemaphoreCreateInfo::default().push_next(&mut kind), None) }?;

    // Your triangles, in a buffer of yours; a vertex shader or a copy may have made them.
    let triangles = built_in(2_000).triangles;
    let n = triangles.len();
    let input = engine.buffer(n * size_of::<Triangle>())?;
    let output = engine.buffer((2 * n - 1) * size_of::<FlatNode>())?;
    let bytes: &[u8] = bytemuck::cast_slice(&triangles);
    unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), input.content, bytes.len()) };

    let mut prbvh = unsafe { VulkanDevice::from_raw(engine.raw.clone()) }?;
    let triangles = unsafe { prbvh.adopt("triangles", (input.buffer, 0), n, size_of::<Triangle>()) }?;
    let nodes = unsafe { prbvh.adopt("tree", (output.buffer, 0), 2 * n - 1, size_of::<FlatNode>()) }?;

    // Ours after yours: value 1 is what your work signals, here the host in its place.
    unsafe { prbvh.wait_for(semaphore, 1) };
    unsafe { device.signal_semaphore(&vk::SemaphoreSignalInfo::default().semaphore(semaphore).value(1)) }?;

    let mut read: Vec<Triangle> = vec![bytemuck::Zeroable::zeroed(); n];
    prbvh.download(&triangles, bytemuck::cast_slice_mut(&mut read))?;
    let scene = Scene::from_triangles("yours", read)?;
    let done = pipeline::optimize(&scene, &mut prbvh, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;
    let tree = FlatTree::new(&done.tree);
    prbvh.upload(&nodes, tree.bytes()[0])?;

    // Yours after ours: value 2 is for your work to wait for.
    unsafe { prbvh.signal(semaphore, 2) }?;
    let (semaphores, values) = ([semaphore], [2]);
    let wait = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
    unsafe { device.wait_semaphores(&wait, u64::MAX) }?;
    let root: FlatNode = unsafe { output.content.cast::<FlatNode>().read() };
    assert_eq!(root, tree.nodes[0]);
    println!(
        "{}: {} nodes in a buffer of yours, SAH cost {:.2} instead of {:.2}",
        prbvh.info().name,
        tree.nodes.len(),
        done.quality.sah_cost,
        done.initial.sah_cost
    );

    // What was ours goes first; what is yours is still there.
    drop(prbvh);
    unsafe {
        device.destroy_semaphore(semaphore, None);
        for Mapped { buffer, memory, .. } in [input, output] {
            device.destroy_buffer(buffer, None);
            device.free_memory(memory, None);
        }
        device.destroy_device(None);
    }
    Ok(())
}

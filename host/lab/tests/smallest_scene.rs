//! Every kernel once, on a scene so small that Miri can follow it: `cargo xtask miri`.

use prbvh::build::{DeviceTree, Input, MortonBits, lbvh};
use prbvh::bvh::{Bvh, BvhNode, Content, NO_NODE, tree_hash};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Command, Device, DeviceError, DeviceInfo, DeviceKind, Recording, Timing};
use prbvh::optimize::Reoptimizer;
use prbvh::pipeline::{Initial, Settings, optimize};
use prbvh::presplit::PresplitSettings;
use prbvh::scene::{SafeRange, Scene};
use prbvh::trace::{NO_TRIANGLE, Query, Ray, TraceScene, trace};
use prbvh::wide::{Layout, PackedTree, WideSettings, Width, collapse};
use prbvh_cpu_sim::Order;
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::kept::{Kept, RestoreParams};
use prbvh_kernel::node::RIGHT;
use prbvh_kernel::setup::Triangle;
use prbvh_lab::render::{Camera, RenderSettings, render};
use prbvh_lab::stability::methods;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

/// Orders of the invocations. Miri takes minutes for each, and one of them on two threads is what it can tell something about.
const ORDERS: &[Order] = if cfg!(miri) {
    &[Order::Ascending, Order::Parallel]
} else {
    &[Order::Ascending, Order::Descending, Order::Shuffled(1), Order::Parallel]
};

/// Triangles of the combs: the kernel with a stack of 32, 64, 128 words, and with stacks in a buffer of 64 MiB, which is more than Miri can hold.
const COMBS: &[usize] = if cfg!(miri) { &[7, 40, 80] } else { &[7, 40, 80, 140] };

/// A CPU that notes which kernels it ran, and may do without 64-bit atomics, as one behind Vulkan.
struct Noting {
    device: CpuDevice,
    order: Order,
    info: DeviceInfo,
    ran: BTreeSet<&'static str>,
}

impl Noting {
    fn new(order: Order, atomics_64: bool) -> Self {
        let device = CpuDevice::with_order(order, 2).unwrap();
        let mut info = device.info().clone();
        info.atomics_64 = atomics_64;
        // Sorts have another scatter there.
        if !atomics_64 {
            info.kind = DeviceKind::VulkanCpu;
        }
        Self { device, order, info, ran: BTreeSet::new() }
    }
}

impl device::Layer for Noting {
    fn inner(&self) -> &dyn Device {
        &self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.device
    }

    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        for (_, command) in recording.commands() {
            if let Command::Dispatch(dispatch) = command {
                self.ran.insert(dispatch.kernel.info().name);
            }
        }
        self.device.run(recording)
    }
}

/// A triangle of size 1 at `x` and as far to either side.
fn at(x: f32) -> Triangle {
    Triangle { a: [x, -x, 0.5], b: [x + 1.0, -x, 0.0], c: [x, 1.0 - x, 0.25 * x] }
}

/// Seven triangles; two are so near to each other that only the long Morton codes tell them apart.
fn smallest() -> Scene {
    let triangles = [40.0, 3.0, 3.0001, 97.0, 0.0, 12.0, 64.0].map(at).to_vec();
    Scene::from_triangles("smallest", triangles).unwrap()
}

/// A tree with a leaf beside every internal node, so deep as there are triangles but one.
fn comb(triangles: &[Triangle]) -> Bvh {
    let n = triangles.len() as u32;
    let leaf = |first: u32, parent: u32| BvhNode {
        aabb: triangles[first as usize].aabb(),
        parent,
        content: Content::Leaf { first, count: 1 },
    };
    // Internal node k is node 2k; its children are 2k + 1, the leaf of triangle k, and 2k + 2.
    let mut nodes = Vec::new();
    for k in 0..n {
        let parent = if k == 0 { NO_NODE } else { 2 * (k - 1) };
        if k + 1 == n {
            nodes.push(leaf(k, parent));
        } else {
            let aabb = triangles[k as usize..].iter().map(Triangle::aabb).fold(Aabb::EMPTY, Aabb::union);
            nodes.push(BvhNode { aabb, parent, content: Content::Internal { left: 2 * k + 1, right: 2 * k + 2 } });
            nodes.push(leaf(k, 2 * k));
        }
    }
    Bvh { nodes, triangle_order: (0..n).collect() }
}

/// Whether the method runs under Miri, which takes a minute for each: one of those with the same kernels, and on two threads, which take it
/// several, one with climbs and locks.
fn is_followed(name: &str, order: Order, atomics_64: bool) -> bool {
    if order == Order::Parallel {
        return atomics_64 && name == "worst-first+adaptive";
    }
    let locks = ["worst-first", "prbvh-9", "conservative-9"].contains(&name);
    let others = ["atrbvh", "trbvh", "hploc", "ploc", "rotations-annealed", "worst-first+adaptive"];
    locks || atomics_64 && others.contains(&name)
}

/// The methods on the smallest scene; the hashes of their trees by method.
fn trees(device: &mut Noting) -> BTreeMap<String, String> {
    let scene = smallest();
    let mut hashes = BTreeMap::new();
    for method in methods() {
        if cfg!(miri) && !is_followed(method.name, device.order, device.info.atomics_64) {
            continue;
        }
        for morton_bits in [MortonBits::Sixty, MortonBits::Thirty] {
            let settings = method.settings.clone().with(|s| s.morton_bits = morton_bits);
            let made = optimize(&scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
            println!("{}: {}, {morton_bits:?}", device.info.name, method.name);
            hashes.insert(format!("{}, {morton_bits:?}", method.name), tree_hash(&made.tree));
            if cfg!(miri) && method.name != "worst-first" {
                break;
            }
        }
    }
    if !cfg!(miri) || (device.order == Order::Ascending && device.info.atomics_64) {
        let large = Triangle { a: [0.0, -100.0, 0.0], b: [100.0, 0.0, 100.0], c: [100.0, 0.0, 101.0] };
        let scene =
            Scene::from_triangles("a large one", (0..12).map(|k| at(8.0 * k as f32)).chain([large]).collect()).unwrap();
        let settings = Settings::default().with(|s| s.presplit = Some(PresplitSettings::default()));
        let made = optimize(&scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        assert!(made.splits.is_some_and(|splits| splits.built > 13));
        hashes.insert("a large one, presplit".to_owned(), tree_hash(&made.tree));

        // Clusters of more references than a part may have, and rounds that one workgroup does not do.
        let settings = Settings::default().with(|s| {
            s.initial = Initial::of_name("kmeans:k=2,p=2,i=1").unwrap().unwrap();
            s.prbvh.worst_first.first = 100;
        });
        let made = optimize(&scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        hashes.insert("a large one, from clusters, large rounds".to_owned(), tree_hash(&made.tree));
    }
    if !cfg!(miri) {
        let scene = prbvh::scene::built_in(3000);
        let made = optimize(&scene, device, &Settings::default(), &mut |_| ControlFlow::Continue(())).unwrap();
        hashes.insert("large enough for new tops".to_owned(), tree_hash(&made.tree));
    }
    hashes
}

/// The children of the root of a comb, which had changed places and come back: no run on the smallest scene ends with a tree that is not its best.
fn restored(device: &mut Noting) -> [u32; 2] {
    let mut nodes = comb(&smallest().triangles).to_device().unwrap();
    let (left, right) = (nodes[0].down, nodes[nodes[0].down as usize].up);
    (nodes[0].down, nodes[right as usize].up, nodes[left as usize].up) = (right, left, RIGHT);
    let internal = nodes.len() / 2;
    let tree = DeviceTree::upload(device, &nodes).unwrap();
    let kept = Device::allocate(device, "kept", internal, size_of::<Kept>()).unwrap();
    Device::upload(device, &kept, bytemuck::bytes_of(&Kept { epoch: 1, left, right })).unwrap();
    let mut recording = Recording::new();
    let params = RestoreParams { count: internal as u32, epoch: 1 };
    recording.dispatch("restore", Kernel::KeptRestore, params.count, &params, &[&kept, &tree.nodes]);
    Device::run(device, &recording).unwrap();
    let nodes = tree.download(device).unwrap();
    Device::free(device, kept);
    tree.free(device);
    assert_eq!([nodes[0].down, nodes[left as usize].up, nodes[right as usize].up], [left, right, RIGHT]);
    [left, right]
}

/// A tree over triangles that are on the device already: that over those of the host.
fn resident(device: &mut Noting) -> String {
    let triangles = smallest().triangles;
    let working = SafeRange::of(&triangles).apply(&triangles);
    let buffer = Device::allocate(device, "of the caller", working.len(), size_of::<Triangle>()).unwrap();
    Device::upload(device, &buffer, bytemuck::cast_slice(&working)).unwrap();
    let [there, here] = [Input::from(&buffer), Input::from(&working)].map(|input| {
        let (tree, _) = lbvh(device, input, MortonBits::Sixty).unwrap();
        let hash = tree_hash(&Bvh::from_device(&tree.download(device).unwrap()).unwrap());
        tree.free(device);
        hash
    });
    Device::free(device, buffer);
    assert_eq!(there, here);
    there
}

/// The smallest scene in motion, which the CPU device follows by subtrees and others by a climb.
fn followed(device: &mut Noting) -> String {
    let triangles = smallest().triangles;
    let mut moving = Reoptimizer::new(&mut *device as &mut dyn Device, &comb(&triangles), &triangles).unwrap();
    for frame in 1..4 {
        let later: Vec<Triangle> = (0..7u32).map(|k| at(((k * (4 + frame)) % 7) as f32)).collect();
        moving.refit(&later).unwrap();
    }
    tree_hash(&moving.tree().unwrap())
}

/// Pixels of a picture, and the first triangle that a ray meets in combs of every kind of stack.
fn rays(device: &mut Noting) -> Vec<u32> {
    let scene = smallest();
    let tree = comb(&scene.triangles);
    let camera = Camera::view(0, &tree.nodes[0].aabb, 1).unwrap();
    let settings = RenderSettings { width: 3, height: 2, samples: 1, bounces: 1, light_samples: 1 };
    let picture = render(device, &scene, &tree, &camera, &settings).unwrap();
    let mut found: Vec<u32> = picture.radiance.iter().flatten().map(|x| x.to_bits()).collect();
    for &n in COMBS {
        let triangles: Vec<Triangle> = (0..n).map(|k| at(2.0 * k as f32)).collect();
        let mut scene = TraceScene::new(device, &comb(&triangles), &triangles, &[[-5.0, -5.0, -1.0]]).unwrap();
        let ray = |k: usize| {
            let corner = triangles[k].a;
            Ray {
                origin: [corner[0] + 0.25, corner[1] + 0.25, -1.0],
                t_min: 0.0,
                direction: [0.0, 0.0, 1.0],
                t_max: 1e6,
            }
        };
        let miss = Ray { origin: [-5.0, -5.0, -1.0], ..ray(0) };
        let (hits, _) = trace(device, &mut scene, &[ray(0), ray(n - 1), miss], Query::Closest).unwrap();
        let hits: Vec<u32> = hits.iter().map(|hit| hit.triangle).collect();
        assert_eq!(hits, [0, n as u32 - 1, NO_TRIANGLE]);
        found.extend(hits);
        scene.free(device);
    }
    found.extend(wide_rays(device));
    found
}

/// The triangles that rays meet in wide combs of every layout, with either stack.
fn wide_rays(device: &mut Noting) -> Vec<u32> {
    let triangles: Vec<Triangle> = (0..6).map(|k| at(2.0 * k as f32)).collect();
    let ray = |t: &Triangle| Ray {
        origin: [t.a[0] + 0.25, t.a[1] + 0.25, -1.0],
        t_min: 0.0,
        direction: [0.0, 0.0, 1.0],
        t_max: 1e6,
    };
    let mut found = Vec::new();
    for (width, layout) in [(Width::Four, Layout::Soa), (Width::Eight, Layout::Soa), (Width::Eight, Layout::Cwbvh)] {
        let settings = WideSettings::default().with(|s| {
            s.width = width;
            s.layout = layout;
            s.max_leaf = Some(1);
        });
        let tree = PackedTree::new(&collapse(&comb(&triangles), &settings).unwrap(), layout).unwrap();
        let mut scene = TraceScene::of_wide(device, &tree, &triangles, &[[-5.0, -5.0, -1.0]]).unwrap();
        for _ in 0..2 {
            let rays = [ray(&triangles[0]), ray(&triangles[5])];
            let (hits, _) = trace(device, &mut scene, &rays, Query::Closest).unwrap();
            let hits: Vec<u32> = hits.iter().map(|hit| hit.triangle).collect();
            assert_eq!(hits, [0, 5]);
            found.extend(hits);
            scene.go_deep(device).unwrap();
        }
        scene.free(device);
    }
    found
}

#[test]
fn every_kernel_runs_and_every_order_gives_the_same() {
    let mut expected = BTreeMap::new();
    let mut ran = BTreeSet::new();
    for &order in ORDERS {
        for atomics_64 in [true, false] {
            let mut device = Noting::new(order, atomics_64);
            let mut made = trees(&mut device);
            // Rays meet no locks.
            if atomics_64 && !(cfg!(miri) && order == Order::Parallel) {
                made.insert("rays".to_owned(), format!("{:?}", rays(&mut device)));
            }
            made.insert("resident".to_owned(), resident(&mut device));
            made.insert("followed".to_owned(), followed(&mut device));
            made.insert("restored".to_owned(), format!("{:?}", restored(&mut device)));
            assert_eq!(device.memory().bytes, 0);
            for (what, new) in made {
                let first = expected.entry(what.clone()).or_insert_with(|| new.clone());
                assert_eq!(*first, new, "{what}: {order:?}, 64-bit atomics: {atomics_64}");
            }
            ran.extend(device.ran);
        }
    }
    let missing: Vec<&str> =
        Kernel::ALL.iter().map(|kernel| kernel.info().name).filter(|name| !ran.contains(name)).collect();
    let expected: &[&str] = if cfg!(miri) { &["worst_top", "kept_graft", Kernel::TraceDeep.info().name] } else { &[] };
    assert_eq!(missing, expected, "not run");
}

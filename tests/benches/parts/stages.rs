//! The parts, one by one.

use crate::rays;
use prbvh::build::{self, DEFAULT_RADIUS, DeviceTree, MortonBits, TreeletSize};
use prbvh::bvh::{self, Bvh, ROOT, SahModel, quality, tree_hash};
use prbvh::collapse::{CollapseSettings, collapse};
use prbvh::device::{Device, Timing};
use prbvh::scene::{SafeRange, Scene};
use prbvh::trace::{Hit, Query, TraceScene, trace};
use prbvh_kernel::node::Node;
use prbvh_lab::compare::median;
use serde::Serialize;
use std::num::NonZeroU32;
use std::time::Instant;

/// A part; times are medians.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measured {
    pub(crate) part: String,
    /// Wall time, seconds.
    pub(crate) seconds: f64,
    /// Time on the device, seconds.
    pub(crate) device_s: f64,
    /// Triangles or rays.
    pub(crate) items: usize,
    pub(crate) cost: Option<f64>,
    /// What all repetitions and devices must agree on.
    pub(crate) answer: String,
}

/// Builders that may be asked for.
const RADII: [NonZeroU32; 2] = [DEFAULT_RADIUS, NonZeroU32::new(100).unwrap()];

/// Every part on one device.
pub(crate) fn measure(device: &mut dyn Device, scene: &Scene, repetitions: usize, rays: usize) -> Vec<Measured> {
    let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let n = working.len();
    let bits = MortonBits::Sixty;
    let mut rows = Vec::new();
    rows.push(builder("lbvh", device, scene, repetitions, &mut |device| {
        build::lbvh(device, &working, bits).expect("it fits")
    }));
    for radius in RADII {
        rows.push(builder(&format!("ploc r={radius}"), device, scene, repetitions, &mut |device| {
            let (tree, timings, _) = build::ploc(device, &working, bits, radius).expect("it fits");
            (tree, timings)
        }));
    }
    let treelet = TreeletSize::DEFAULT;
    rows.push(builder(&format!("atrbvh treelet={treelet}"), device, scene, repetitions, &mut |device| {
        let (tree, timings, _) = build::atrbvh(device, &working, bits, treelet).expect("it fits");
        (tree, timings)
    }));
    rows.push(on_host("sah-sweep", scene, repetitions, &mut || build::sah_sweep(&working)));
    rows.push(on_host("sah-binned", scene, repetitions, &mut || build::sah_binned(&working)));
    let (tree, _) = build::lbvh(device, &working, bits).expect("it fits");
    let settings = CollapseSettings::default();
    let mut collapsed = None;
    rows.push(repeated("collapse of lbvh", n, repetitions, &mut || {
        let start = Instant::now();
        let mut made = collapse(device, &tree, &settings).expect("it fits");
        let seconds = start.elapsed().as_secs_f64();
        let timings = std::mem::take(&mut made.timings);
        let made = made.free(device).with_boxes_of(&scene.triangles);
        let cost = valid_cost(&made, scene);
        let hash = tree_hash(&made);
        collapsed = Some(made);
        (seconds, timings, Some(cost), hash)
    }));
    tree.free(device);
    let collapsed = collapsed.expect("it was made at least once");
    let bounds = &collapsed.nodes[ROOT as usize].aabb;
    let rays = rays::through(bounds, rays);
    let starts: Vec<[f32; 3]> = rays.iter().map(|ray| ray.origin).collect();
    for (part, query) in [("closest hits", Query::Closest), ("any hits", Query::Any)] {
        let mut traced = TraceScene::new(device, &collapsed, &scene.triangles, &starts).expect("it fits");
        rows.push(repeated(part, rays.len(), repetitions, &mut || {
            let start = Instant::now();
            let (hits, timings) = trace(device, &mut traced, &rays, query).expect("the rays are good");
            (start.elapsed().as_secs_f64(), timings, None, summary(&hits))
        }));
        traced.free(device);
    }
    rows
}

fn builder(name: &str, device: &mut dyn Device, scene: &Scene, repetitions: usize, build: &mut Build<'_>) -> Measured {
    repeated(name, scene.triangles.len(), repetitions, &mut || {
        let start = Instant::now();
        let (tree, timings) = build(device);
        let seconds = start.elapsed().as_secs_f64();
        let nodes = tree.download(device).expect("the device works");
        tree.free(device);
        let (cost, hash) = checked(&nodes, scene);
        (seconds, timings, Some(cost), hash)
    })
}

/// A builder that runs on no device.
fn on_host(name: &str, scene: &Scene, repetitions: usize, build: &mut dyn FnMut() -> Vec<Node>) -> Measured {
    repeated(name, scene.triangles.len(), repetitions, &mut || {
        let start = Instant::now();
        let nodes = build();
        let seconds = start.elapsed().as_secs_f64();
        let (cost, hash) = checked(&nodes, scene);
        (seconds, Vec::new(), Some(cost), hash)
    })
}

/// A builder that runs on a device: the tree and the times of its stages.
type Build<'a> = dyn FnMut(&mut dyn Device) -> (DeviceTree, Vec<Timing>) + 'a;

/// What one run of a part gave: wall time in seconds, times on the device, cost, answer.
type Run = (f64, Vec<Timing>, Option<f64>, String);

/// Runs `part` once to warm up and then `repetitions` times; its answers must agree.
fn repeated(name: &str, items: usize, repetitions: usize, part: &mut dyn FnMut() -> Run) -> Measured {
    let (_, _, cost, answer) = part();
    let (mut wall, mut on_device) = (Vec::new(), Vec::new());
    for repetition in 0..repetitions.max(1) {
        let (seconds, timings, _, again) = part();
        assert_eq!(again, answer, "{name}: another answer in repetition {repetition}");
        wall.push(seconds);
        on_device.push(timings.iter().map(|timing| timing.seconds).sum());
    }
    let (seconds, device_s) = (median(&wall).unwrap_or(f64::NAN), median(&on_device).unwrap_or(f64::NAN));
    Measured { part: name.to_owned(), seconds, device_s, items, cost, answer }
}

/// Cost and hash of a tree in the form of the devices.
fn checked(nodes: &[Node], scene: &Scene) -> (f64, String) {
    let tree = Bvh::from_device(nodes).unwrap_or_else(|faults| panic!("{}", bvh::summary(&faults)));
    let tree = tree.with_boxes_of(&scene.triangles);
    (valid_cost(&tree, scene), tree_hash(&tree))
}

fn valid_cost(tree: &Bvh, scene: &Scene) -> f64 {
    bvh::validate(tree, Some(&scene.triangles)).unwrap_or_else(|faults| panic!("{}", bvh::summary(&faults)));
    quality(tree, &SahModel::default()).sah_cost
}

/// Hits, and a checksum of all that was found.
fn summary(hits: &[Hit]) -> String {
    let found = hits.iter().filter(|hit| hit.triangle != prbvh::trace::NO_TRIANGLE).count();
    // FNV-1a.
    let hash = bytemuck::cast_slice::<Hit, u8>(hits)
        .iter()
        .fold(0xcbf2_9ce4_8422_2325u64, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    format!("{found} hits, {hash:016x}")
}

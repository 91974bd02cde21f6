//! What limits the search: nodes visited, bytes read, and what the memory of this machine gives.

use prbvh::build::{self, DeviceTree, MortonBits};
use prbvh::device::{Device, on_host};
use prbvh::optimize::{Limits, PrbvhSettings, prbvh};
use prbvh::scene::{SafeRange, Scene};
use prbvh_kernel::node::Node;
use prbvh_tests::bench::chase::{bandwidth, cycle, read_times};
use prbvh_tests::bench::stats::median;
use prbvh_tests::bench::visits::{self, Visits};
use serde::Serialize;
use std::ops::ControlFlow;

/// Working sets, bytes: from within the first cache to far beyond the last.
const WORKING_SETS: std::ops::RangeInclusive<u32> = 14..=28;
const READS: usize = 4 << 20;

/// Reads of 32-byte nodes in a working set, all threads at once.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Memory {
    pub(crate) bytes: usize,
    /// Seconds per read and thread, each read needing the one before.
    pub(crate) dependent_s: f64,
    /// The same with places known beforehand.
    pub(crate) independent_s: f64,
    /// Bytes per second of all threads, from front to back.
    pub(crate) sequential: f64,
}

/// Measures the machine with the threads of the device.
pub(crate) fn memory(device: &dyn Device, repetitions: usize) -> Vec<Memory> {
    let of_set = |exponent: u32| {
        let bytes = 1usize << exponent;
        let cells = cycle(bytes / 32);
        let mut samples = [Vec::new(), Vec::new(), Vec::new()];
        for _ in 0..repetitions.max(1) {
            let times = read_times(&cells, READS);
            samples[0].push(times.dependent_s);
            samples[1].push(times.independent_s);
            samples[2].push(bandwidth(&cells, (1 << 29) / bytes));
        }
        let [dependent_s, independent_s, sequential] = samples.map(|samples| median(&samples));
        Memory { bytes, dependent_s, independent_s, sequential }
    };
    on_host(device, || WORKING_SETS.map(of_set).collect())
}

/// One search of every node of a tree.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Search {
    pub(crate) scene: String,
    /// `initial` or `optimised`.
    pub(crate) tree: &'static str,
    pub(crate) tree_bytes: usize,
    pub(crate) threads: usize,
    pub(crate) searches: u64,
    pub(crate) found: u64,
    pub(crate) steps: u64,
    pub(crate) most_steps: u32,
    /// Device time of the search stage of one iteration with µ = 1, seconds.
    pub(crate) search_s: f64,
    /// The least that the steps take by [`Memory`] at the size of the tree, if each loads one node: by latency, by random reads, by bandwidth.
    pub(crate) bounds_s: [f64; 3],
}

/// Measures the search on the LBVH of a scene, and on what PRBVH makes of it.
pub(crate) fn searches(scene: &Scene, device: &mut dyn Device, memory: &[Memory], repetitions: usize) -> Vec<Search> {
    let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let failed = |error: &dyn std::error::Error| -> ! { panic!("{}: {error}", scene.name) };
    let (tree, _) = build::lbvh(device, &working, MortonBits::default()).unwrap_or_else(|error| failed(&error));
    let initial = tree.download(device).unwrap_or_else(|error| failed(&error));
    let run = |device: &mut dyn Device, tree: &DeviceTree, settings: &PrbvhSettings| {
        prbvh(device, tree, settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap_or_else(|error| failed(&error))
    };
    run(device, &tree, &PrbvhSettings::default());
    let optimised = tree.download(device).unwrap_or_else(|error| failed(&error));
    tree.free(device);
    let once = PrbvhSettings::default().with(|s| {
        s.mu = 1;
        s.limits = Limits::iterations(1);
    });
    let of_tree = |(name, nodes): (&'static str, &Vec<Node>)| {
        let mut seconds = Vec::new();
        for repetition in 0..=repetitions.max(1) {
            let tree = DeviceTree::upload(device, nodes).unwrap_or_else(|error| failed(&error));
            let outcome = run(device, &tree, &once);
            tree.free(device);
            if repetition > 0 {
                let search = outcome.timings.iter().filter(|timing| timing.label == "search");
                seconds.push(search.map(|timing| timing.seconds).sum());
            }
        }
        let (visits, threads) = on_host(device, || (visits::count(nodes), rayon::current_num_threads()));
        summed_up(scene, (name, nodes), visits, threads, median(&seconds), memory)
    };
    [("initial", &initial), ("optimised", &optimised)].map(of_tree).into()
}

fn summed_up(
    scene: &Scene,
    (tree, nodes): (&'static str, &[Node]),
    visits: Visits,
    threads: usize,
    search_s: f64,
    memory: &[Memory],
) -> Search {
    let tree_bytes = size_of_val(nodes);
    let at =
        memory.iter().find(|memory| memory.bytes >= tree_bytes).or(memory.last()).expect("the machine was measured");
    let steps = visits.steps as f64;
    let per_thread = steps / threads as f64;
    Search {
        scene: scene.name.clone(),
        tree,
        tree_bytes,
        threads,
        searches: visits.searches,
        found: visits.found,
        steps: visits.steps,
        most_steps: visits.most,
        search_s,
        bounds_s: [
            per_thread * at.dependent_s,
            per_thread * at.independent_s,
            steps * size_of::<Node>() as f64 / at.sequential,
        ],
    }
}

//! The same runs on one thread and on more.

use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::Settings;
use prbvh::scene::Scene;
use prbvh_tests::bench::runs::{Measured, Runs};
use serde::Serialize;

/// A scene with some number of threads.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    pub(crate) scene: String,
    pub(crate) scene_hash: String,
    pub(crate) triangles: usize,
    pub(crate) is_built_in: bool,
    pub(crate) threads: usize,
    /// Most bytes of the process of one run; none where the system does not tell, and for scenes of files.
    pub(crate) process_bytes: Option<u64>,
    #[serde(flatten)]
    pub(crate) measured: Measured,
}

/// 1, 2, 4 and so on, and as many as there are cores.
pub(crate) fn thread_counts(cores: usize) -> Vec<usize> {
    let mut counts: Vec<usize> = std::iter::successors(Some(1), |k| Some(2 * k)).take_while(|&k| k < cores).collect();
    counts.push(cores);
    counts
}

/// Runs in turn with each number of threads. The trees must be the same.
pub(crate) fn measure(
    scene: &Scene,
    settings: &Settings,
    threads: &[usize],
    repetitions: usize,
) -> Vec<(usize, Measured)> {
    let mut devices: Vec<CpuDevice> =
        threads.iter().map(|&threads| CpuDevice::new(threads).unwrap_or_else(|error| panic!("{error}"))).collect();
    let mut runs: Vec<Runs> = devices.iter().map(|_| Runs::default()).collect();
    for _ in 0..=repetitions {
        for (device, runs) in devices.iter_mut().zip(&mut runs) {
            runs.run(device, scene, settings);
        }
    }
    let measured: Vec<Measured> = runs.iter().map(Runs::measured).collect();
    for (device, other) in devices.iter().zip(&measured) {
        assert_eq!(measured[0].tree_hash, other.tree_hash, "{} on {}", scene.name, device.info().name);
    }
    threads.iter().copied().zip(measured).collect()
}

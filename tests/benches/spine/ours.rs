//! prbvh on one device.

use prbvh::build::check_limits;
use prbvh::bvh::tree_hash;
use prbvh::compare::median;
use prbvh::device::{Device, DeviceError, Timing};
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene::Scene;
use serde::Serialize;
use std::ops::ControlFlow;

/// Medians over the repetitions.
#[derive(Debug, Serialize)]
pub(crate) struct Measured {
    pub(crate) device: String,
    pub(crate) repetitions: usize,
    pub(crate) build_s: f64,
    pub(crate) optimize_s: f64,
    pub(crate) iterations: u32,
    pub(crate) initial_cost: f64,
    pub(crate) final_cost: f64,
    pub(crate) tree_hash: String,
    pub(crate) working_bytes: u64,
    pub(crate) peak_bytes: u64,
    /// Device seconds by stage, of the last repetition.
    pub(crate) phases: Vec<(String, f64)>,
}

/// Whether the scene fits the device.
pub(crate) fn fits(device: &dyn Device, scene: &Scene) -> Result<(), DeviceError> {
    check_limits(device.info(), scene.triangles.len())
}

/// Runs the whole pipeline `repetitions` times after a warm-up.
pub(crate) fn measure(device: &mut dyn Device, scene: &Scene, repetitions: usize) -> Measured {
    let settings = Settings::default();
    let mut builds = Vec::new();
    let mut runs = Vec::new();
    let mut last: Option<Measured> = None;
    for repetition in 0..=repetitions {
        let result = optimize(scene, device, &settings, &mut |_| ControlFlow::Continue(()))
            .unwrap_or_else(|error| panic!("{}: {error}", scene.name));
        let best = result.outcome.best();
        let error = best.cost / result.quality.sah_cost - 1.0;
        assert!(error.abs() < 1e-4, "{}: the device's cost is off by {error:e}", scene.name);
        let hash = tree_hash(&result.tree);
        if let Some(last) = &last {
            assert_eq!(last.tree_hash, hash, "{}: another tree in repetition {repetition}", scene.name);
        }
        if repetition > 0 {
            builds.push(result.build_s);
            runs.push(result.optimize_s);
        }
        let mut phases: Vec<(String, f64)> = Vec::new();
        for Timing { label, seconds } in result.build_timings.iter().chain(&result.outcome.timings) {
            match phases.iter_mut().find(|(have, _)| have == label) {
                Some((_, sum)) => *sum += seconds,
                None => phases.push(((*label).to_owned(), *seconds)),
            }
        }
        last = Some(Measured {
            device: device.info().name.clone(),
            repetitions,
            build_s: 0.0,
            optimize_s: 0.0,
            iterations: result.outcome.rows.last().map_or(0, |row| row.iteration),
            initial_cost: result.initial.sah_cost,
            final_cost: result.quality.sah_cost,
            tree_hash: hash,
            working_bytes: result.outcome.working_bytes,
            peak_bytes: device.memory().peak_bytes,
            phases,
        });
    }
    let mut measured = last.expect("at least the warm-up ran");
    measured.build_s = median(&builds).unwrap_or(f64::NAN);
    measured.optimize_s = median(&runs).unwrap_or(f64::NAN);
    measured
}

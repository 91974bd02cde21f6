//! Whole runs of prbvh on one device, repeated and checked: the same tree every time, a cost that the f64 referee confirms.

use super::stats::median;
use prbvh::bvh::tree_hash;
use prbvh::device::{Device, Timing};
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene::Scene;
use serde::Serialize;
use std::ops::ControlFlow;

/// How far the device's cost may be from that of the referee.
const TOLERANCE: f64 = 1e-4;

/// Medians over the repetitions.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Name of the device.
    pub device: String,
    /// How often it ran.
    pub repetitions: usize,
    /// Wall time of the initial tree, seconds.
    pub build_s: f64,
    /// Wall time of the optimiser, seconds.
    pub optimize_s: f64,
    /// Wall time of both, seconds.
    pub total_s: f64,
    /// Iterations of the optimiser.
    pub iterations: u32,
    /// Cost of the initial tree, in f64.
    pub initial_cost: f64,
    /// Cost of the best tree, in f64.
    pub final_cost: f64,
    /// Hash of the best tree.
    pub tree_hash: String,
    /// Bytes of the device's buffers while the iterations ran.
    pub working_bytes: u64,
    /// Most bytes of the device's buffers at any time.
    pub peak_bytes: u64,
    /// Device seconds by stage, in the order in which the stages first ran.
    pub phases: Vec<(String, f64)>,
}

/// What `optimize` did, time after time.
#[derive(Clone, Debug, Default)]
pub struct Runs {
    builds: Vec<f64>,
    optimizations: Vec<f64>,
    totals: Vec<f64>,
    phases: Vec<(String, Vec<f64>)>,
    last: Option<Measured>,
}

impl Runs {
    /// Runs once more. The first run warms up and is not timed.
    ///
    /// # Panics
    /// If the run fails, gives another tree than before, or says a cost that the referee does not confirm.
    pub fn run(&mut self, device: &mut dyn Device, scene: &Scene, settings: &Settings) {
        let result = optimize(scene, device, settings, &mut |_| ControlFlow::Continue(()))
            .unwrap_or_else(|error| panic!("{}: {error}", scene.name));
        let error = result.outcome.best().cost / result.quality.sah_cost - 1.0;
        assert!(error.abs() < TOLERANCE, "{}: the device's cost is off by {error:e}", scene.name);
        let hash = tree_hash(&result.tree);
        if let Some(last) = &self.last {
            assert_eq!(last.tree_hash, hash, "{}: another tree in repetition {}", scene.name, self.totals.len() + 1);
            self.builds.push(result.build_s);
            self.optimizations.push(result.optimize_s);
            self.totals.push(result.build_s + result.optimize_s);
            self.add_phases(result.build_timings.iter().chain(&result.outcome.timings));
        }
        self.last = Some(Measured {
            device: device.info().name.clone(),
            repetitions: 0,
            build_s: 0.0,
            optimize_s: 0.0,
            total_s: 0.0,
            iterations: result.outcome.rows.last().map_or(0, |row| row.iteration),
            initial_cost: result.initial.sah_cost,
            final_cost: result.quality.sah_cost,
            tree_hash: hash,
            working_bytes: result.outcome.working_bytes,
            peak_bytes: device.memory().peak_bytes,
            phases: Vec::new(),
        });
    }

    fn add_phases<'a>(&mut self, timings: impl Iterator<Item = &'a Timing>) {
        let run = self.totals.len();
        for &Timing { label, seconds } in timings {
            let at = self.phases.iter().position(|(have, _)| have == label).unwrap_or_else(|| {
                self.phases.push((label.to_owned(), Vec::new()));
                self.phases.len() - 1
            });
            let sums = &mut self.phases[at].1;
            sums.resize(run, 0.0);
            sums[run - 1] += seconds;
        }
    }

    /// The medians.
    ///
    /// # Panics
    /// If nothing ran after the warm-up.
    #[must_use]
    pub fn measured(&self) -> Measured {
        let repetitions = self.totals.len();
        assert!(repetitions > 0, "nothing ran after the warm-up");
        Measured {
            repetitions,
            build_s: median(&self.builds),
            optimize_s: median(&self.optimizations),
            total_s: median(&self.totals),
            phases: self.phases.iter().map(|(label, sums)| (label.clone(), median(sums))).collect(),
            ..self.last.clone().expect("it ran")
        }
    }
}

/// Runs `repetitions` times (at least once) after a warm-up.
///
/// # Panics
/// As [`Runs::run`].
pub fn measure(device: &mut dyn Device, scene: &Scene, settings: &Settings, repetitions: usize) -> Measured {
    let mut runs = Runs::default();
    for _ in 0..=repetitions.max(1) {
        runs.run(device, scene, settings);
    }
    runs.measured()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::soup;
    use prbvh::device::cpu::CpuDevice;

    fn scene(seed: u64) -> Scene {
        Scene::from_triangles("soup", soup(300, 0.1, seed)).unwrap()
    }

    #[test]
    fn runs_have_times_stages_and_one_tree() {
        let mut device = CpuDevice::new(1).unwrap();
        let measured = measure(&mut device, &scene(1), &Settings::default(), 3);
        assert_eq!(measured.repetitions, 3);
        assert!(measured.build_s > 0.0 && measured.optimize_s > 0.0 && measured.final_cost < measured.initial_cost);
        assert!(measured.total_s >= measured.build_s.max(measured.optimize_s));
        let seconds = |stage: &str| measured.phases.iter().find(|(label, _)| label == stage).unwrap().1;
        assert!(seconds("search") > 0.0 && seconds("refit") > 0.0);
        let sum: f64 = measured.phases.iter().map(|(_, seconds)| seconds).sum();
        assert!(sum < 2.0 * measured.total_s, "{sum} {}", measured.total_s);
    }

    #[test]
    #[should_panic(expected = "another tree in repetition 1")]
    fn another_tree_is_found() {
        let mut device = CpuDevice::new(1).unwrap();
        let mut runs = Runs::default();
        runs.run(&mut device, &scene(1), &Settings::default());
        runs.run(&mut device, &scene(2), &Settings::default());
    }

    #[test]
    #[should_panic(expected = "nothing ran")]
    fn a_warm_up_alone_is_no_measurement() {
        let mut device = CpuDevice::new(1).unwrap();
        let mut runs = Runs::default();
        runs.run(&mut device, &scene(1), &Settings::default());
        let _ = runs.measured();
    }
}

//! Device memory, phase by phase.

use super::Plan;
use super::dry::DryDevice;
use crate::device::{DeviceError, DeviceInfo};
use crate::optimize::{MoveKind, Strategy};
use crate::pipeline::{Optimizer, Settings};
use crate::scene::Scene;
use serde::Serialize;

/// Device memory of a phase, what outlives the phases before it included.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PhaseBytes {
    /// Name.
    pub phase: String,
    /// Whether it is part of the run.
    pub runs: bool,
    /// Most bytes in buffers at any time.
    pub peak_bytes: u64,
    /// Label of the largest buffer.
    pub largest_buffer: &'static str,
    /// Its bytes.
    pub largest_buffer_bytes: u64,
}

impl PhaseBytes {
    pub(super) fn check(&self, info: &DeviceInfo, triangles: usize) -> Result<(), DeviceError> {
        let limit = |what: &str, name, need, have| {
            let what = format!("{what} of {triangles} triangles");
            Err(DeviceError::Limit { what, name, need, have, device: info.name.clone() })
        };
        if self.largest_buffer_bytes > info.max_buffer_bytes && info.max_buffer_bytes > 0 {
            let what = format!("{}, {}", self.phase, self.largest_buffer);
            return limit(&what, info.max_buffer_limit, self.largest_buffer_bytes, info.max_buffer_bytes);
        }
        if self.peak_bytes > info.memory_bytes && info.memory_bytes > 0 {
            return limit(&self.phase, "device memory", self.peak_bytes, info.memory_bytes);
        }
        Ok(())
    }
}

/// The phases of the run, and those of other settings beside them. Tracing is without rays and without stacks for deep trees.
pub(super) fn phases(
    plan: &Plan,
    scene: &Scene,
    info: &DeviceInfo,
    settings: &Settings,
) -> Result<Vec<PhaseBytes>, DeviceError> {
    let n = scene.triangles.len();
    let phase = |name: String, runs, stage: &dyn Fn(&mut DryDevice) -> Result<(), DeviceError>| {
        let mut dry = DryDevice::new(info);
        stage(&mut dry)?;
        Ok(dry.phase(name, runs))
    };
    let chosen = (settings.prbvh.strategy, settings.prbvh.moves);
    let optimizes = |strategy, moves| settings.optimizer == Optimizer::Prbvh && chosen == (strategy, moves);
    let mut phases = vec![phase(format!("build, {}", settings.initial.method()), true, &|dry| {
        dry.build(&settings.initial, plan.codes, &scene.triangles)
    })?];
    for strategy in [Strategy::Aggressive, Strategy::Conservative] {
        for (moves, name) in [(MoveKind::Single, ""), (MoveKind::Dual, ", dual moves")] {
            let runs = optimizes(strategy, moves);
            let name = format!("optimise, {strategy}{name}");
            phases.push(phase(name, runs, &|dry| dry.optimize(n, strategy, moves, 0))?);
        }
    }
    phases.push(phase("collapse".to_owned(), plan.collapses, &|dry| dry.collapse(n))?);
    phases.push(phase("trace".to_owned(), false, &|dry| dry.trace(n))?);
    Ok(phases)
}

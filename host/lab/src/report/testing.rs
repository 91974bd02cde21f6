//! A report for tests.

use super::*;
use prbvh::Settings;
use prbvh::bvh::Quality;
use prbvh::device::Timing;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{IterationRow, PrbvhSettings, set_relative_errors};
use prbvh::plan::{Omission, Status};
use prbvh::scene::built_in;
use std::ops::ControlFlow;

/// A run of so many iterations whose cost falls from 312.5 towards 195, with a bump now and then.
pub(super) fn report(iterations: u32) -> RunReport {
    let row = |iteration: u32| {
        let k = f64::from(iteration);
        let bump = if iteration % 9 == 8 { 0.4 / k } else { 0.0 };
        IterationRow::default().with(|row| {
            row.iteration = iteration;
            row.mu = 9u32.saturating_sub(iteration / 10).max(1);
            row.time_s = 0.06 * k + 0.001 * (k * 7.0 % 5.0);
            row.device_s = if iteration == 0 { 0.0 } else { 0.055 };
            row.cost = 195.0 + 117.5 * (-0.15 * k).exp() + bump;
            row.predicted_decrease = 117.5 * (-0.15 * k).exp() * (0.15f64.exp() - 1.0);
            row.relative_error = 0.0;
            row.searched = 58_000;
            row.visits = 9_000_000 / (iteration + 1);
            row.found = 60_000 / (iteration + 1);
            row.owned = 50_000 / (iteration + 1);
            row.applied = 40_000 / (iteration + 1);
            row.most_steps = 1_000 + iteration;
        })
    };
    let mut rows: Vec<_> = (0..=iterations).map(row).collect();
    set_relative_errors(&mut rows);
    let quality = |sah_cost, max_depth| {
        let mut quality = Quality::default();
        quality.sah_cost = sah_cost;
        quality.max_depth = max_depth;
        quality.stack = max_depth;
        quality.mean_leaf_depth = 20.5;
        quality.nodes = 524_533;
        quality.leaves = 262_267;
        quality.triangles = 262_267;
        quality.is_root_flat = false;
        quality
    };
    let final_cost = rows.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min);
    let mut times = PhaseTimes::default();
    times.add(&[Timing { label: "search", seconds: 1.6 }, Timing { label: "refit", seconds: 0.3 }]);
    times.add(&[Timing { label: "lock", seconds: 0.1 }, Timing { label: "refit", seconds: 0.0 }]);

    // A run, and then the numbers of a larger one.
    let scene = built_in(100);
    let mut device = CpuDevice::new(1).unwrap();
    let settings = Settings::default().with(|s| s.prbvh = PrbvhSettings::published());
    let run = prbvh::optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let mut report = RunReport::of(&scene, &device, settings.into(), &run);
    report.scene = "sponza_crytek".to_owned();
    report.triangles = 262_267;
    report.device = "AMD EPYC 7763 64-Core Processor".to_owned();
    (report.initial_cost, report.final_cost) = (rows[0].cost, final_cost);
    (report.leaves, report.depth) = (262_267, 38);
    report.iterations = iterations;
    report.time_s = rows[rows.len() - 1].time_s;
    report.phases = times.phases();
    report.build_s = 0.0423;
    report.stop_reason = "converged: change of cost below ε at µ = 1".to_owned();
    report.plan_items.truncate(1);
    report.plan_items[0].status = Status::LeftOut;
    report.plan_items[0].what = Omission::LowerCodes.to_string();
    report.plan_items[0].why = "30 bits tell all triangles apart".to_owned();
    report.code.compiled_at_run = true;
    (report.code.runs.kernels, report.code.all.kernels) = (17, 49);
    report.memory = Memory::new(40 << 20, 262_267);
    report.quality = QualityReport { initial: quality(rows[0].cost, 41), last: quality(final_cost, 38) };
    report.scene_details.census = serde_json::json!({ "duplicates": 7 });
    report.rows = rows;
    report
}

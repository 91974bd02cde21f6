//! A report for tests.

use super::*;
use prbvh::bvh::{MaxDepth, Quality, SahModel};
use prbvh::device::{DeviceInfo, DeviceKind, Timing};
use prbvh::optimize::{IterationRow, set_relative_errors};
use prbvh::plan::{Plan, Status};
use prbvh::scene::built_in;

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
    let mut info = DeviceInfo::new("AMD EPYC 7763 64-Core Processor", DeviceKind::Cpu);
    info.driver = "2 threads".to_owned();
    info.memory_bytes = 24 << 30;
    info.atomics_64 = true;
    info.busy_invocations = 2;
    let planned = Plan::of(&built_in(100), &info, &prbvh::pipeline::Settings::default(), &[]).unwrap();
    RunReport {
        schema: SCHEMA,
        scene: "sponza_crytek".to_owned(),
        triangles: 262_267,
        device: "AMD EPYC 7763 64-Core Processor".to_owned(),
        initial_cost: rows[0].cost,
        final_cost,
        reference: None,
        adaptive_cost: None,
        leaves: 262_267,
        depth: 38,
        bound: None,
        iterations,
        time_s: rows[rows.len() - 1].time_s,
        tree_hash: "00112233445566778899aabbccddeeff".to_owned(),
        phases: times.phases(),
        build_s: 0.0423,
        stop_reason: "converged: change of cost below ε at µ = 1".to_owned(),
        plan: planned.lines(),
        plan_items: planned.items.into_iter().filter(|item| item.status == Status::LeftOut).collect(),
        code: planned.code,
        settings: Settings {
            initial: "lbvh".to_owned(),
            radius: None,
            treelet: None,
            optimizer: "prbvh".to_owned(),
            fold_duplicates: false,
            max_depth: MaxDepth::default(),
            rbvh: None,
            strategy: "aggressive".to_owned(),
            order: "published".to_owned(),
            worst_first: None,
            mu: 9,
            epsilon: 1e-4,
            epsilon_relative: true,
            max_iterations: Some(1000),
            max_time_s: None,
            target_cost: None,
            preset: None,
            threads: None,
            sah: SahModel::default(),
            adaptive: None,
        },
        memory: Memory::new(40 << 20, 262_267),
        quality: QualityReport { initial: quality(rows[0].cost, 41), last: quality(final_cost, 38) },
        scene_details: SceneReport {
            source: "sponza_crytek.obj.xz".to_owned(),
            hash: "ffeeddccbbaa99887766554433221100".to_owned(),
            census: serde_json::json!({ "duplicates": 7 }),
            notes: Vec::new(),
        },
        device_details: info,
        machine: Machine::current(),
        program: Program::current(),
        accuracy: None,
        rows,
    }
}

//! A report for tests.

use super::*;
use prbvh::bvh::{MaxDepth, Quality, SahModel};
use prbvh::device::{DeviceInfo, DeviceKind, Timing};
use prbvh::optimize::{IterationRow, set_relative_errors};
use prbvh::plan::{CodeSize, DeviceCode, Item, Omission, Saving, Status};

/// A run of so many iterations whose cost falls from 312.5 towards 195, with a bump now and then.
pub(super) fn report(iterations: u32) -> RunReport {
    let row = |iteration: u32| {
        let k = f64::from(iteration);
        let bump = if iteration % 9 == 8 { 0.4 / k } else { 0.0 };
        IterationRow {
            iteration,
            mu: 9u32.saturating_sub(iteration / 10).max(1),
            time_s: 0.06 * k + 0.001 * (k * 7.0 % 5.0),
            device_s: if iteration == 0 { 0.0 } else { 0.055 },
            cost: 195.0 + 117.5 * (-0.15 * k).exp() + bump,
            predicted_decrease: 117.5 * (-0.15 * k).exp() * (0.15f64.exp() - 1.0),
            relative_error: 0.0,
            searched: 58_000,
            visits: 9_000_000 / (iteration + 1),
            found: 60_000 / (iteration + 1),
            owned: 50_000 / (iteration + 1),
            applied: 40_000 / (iteration + 1),
            most_steps: 1_000 + iteration,
        }
    };
    let mut rows: Vec<_> = (0..=iterations).map(row).collect();
    set_relative_errors(&mut rows);
    let quality = |sah_cost, max_depth| Quality {
        sah_cost,
        max_depth,
        stack: max_depth,
        mean_leaf_depth: 20.5,
        nodes: 524_533,
        leaves: 262_267,
        triangles: 262_267,
        is_root_flat: false,
    };
    let final_cost = rows.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min);
    let mut times = PhaseTimes::default();
    times.add(&[Timing { label: "search", seconds: 1.6 }, Timing { label: "refit", seconds: 0.3 }]);
    times.add(&[Timing { label: "lock", seconds: 0.1 }, Timing { label: "refit", seconds: 0.0 }]);
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
        plan: vec!["60-bit codes left out: 30 bits tell all triangles apart".to_owned()],
        plan_items: vec![Item {
            omission: Omission::LowerCodes,
            status: Status::LeftOut,
            what: Omission::LowerCodes.to_string(),
            why: "30 bits tell all triangles apart".to_owned(),
            saved: Saving { bytes: 2048, ..Saving::default() },
        }],
        code: DeviceCode {
            compiled_at_run: true,
            runs: CodeSize { kernels: 17, spirv_bytes: 50_000 },
            all: CodeSize { kernels: 49, spirv_bytes: 250_000 },
            kernels: vec!["prbvh_search"],
        },
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
        device_details: DeviceInfo {
            name: "AMD EPYC 7763 64-Core Processor".to_owned(),
            kind: DeviceKind::Cpu,
            driver: "2 threads".to_owned(),
            max_buffer_bytes: u64::MAX,
            max_buffer_limit: "address space",
            memory_bytes: 24 << 30,
            atomics_64: true,
            busy_invocations: 2,
        },
        machine: Machine::current(),
        program: Program::current(),
        accuracy: None,
        rows,
    }
}

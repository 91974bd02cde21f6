//! What is known of a run.

use crate::accuracy::AccuracyReport;
use crate::machine::Machine;
use crate::phases::{Phase, PhaseTimes};
use crate::presets::Preset;
use crate::program::Program;
use crate::reference::ReferenceCost;
use prbvh::bvh::{self, DepthBound, Quality, SahModel};
use prbvh::device::{Device, DeviceInfo};
use prbvh::optimize::IterationRow;
use prbvh::pipeline::{Splits, WideTree};
use prbvh::plan::{DeviceCode, Item};
use prbvh::scene::{Note, Scene};
use prbvh::wide::WideQuality;
use prbvh::{Optimized, Settings};
use serde::{Deserialize, Serialize};

/// Version of [`RunReport`] as JSON; grows when a key changes its meaning or goes away.
pub const SCHEMA: u32 = 3;

/// A run, whole. As JSON the first keys are flat, for programs that want the outcome alone; what follows them explains it.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Name of the scene.
    pub scene: String,
    /// Triangles of the scene that are in the tree.
    pub triangles: u32,
    /// References of the tree handed out: triangles, each counted once for every leaf that it is in.
    pub references: u32,
    /// What became of triangles that were split; none where each is one reference.
    pub splits: Option<Splits>,
    /// Name of the device.
    pub device: String,
    /// SAH cost of the initial tree, unitless.
    pub initial_cost: f64,
    /// SAH cost of the best tree with one triangle per leaf, which is what was optimised, its depth bounded, unitless.
    pub final_cost: f64,
    /// What the cost is compared with; none before [`RunReport::set_reference`].
    pub reference: Option<RunReference>,
    /// SAH cost of the tree handed out by the costs of `settings.adaptive`; none if its leaves are single.
    pub adaptive_cost: Option<f64>,
    /// The wide tree; none where nobody asked for one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wide: Option<WideReport>,
    /// Leaves of the tree handed out.
    pub leaves: u32,
    /// Most links between root and leaf of the tree handed out.
    pub depth: u32,
    /// What the bound on the depth changed of the tree with one triangle per leaf; none where it was within it.
    pub bound: Option<DepthBound>,
    /// Iterations run.
    pub iterations: u32,
    /// Wall time of the optimisation, seconds.
    pub time_s: f64,
    /// Hash of the tree handed out ([`prbvh::bvh::tree_hash`]).
    pub tree_hash: String,
    /// Time on the device by kind of work, the longest first; new tops are the CPU's work.
    pub phases: Vec<Phase>,
    /// Wall time of the initial tree, seconds.
    pub build_s: f64,
    /// Why it stopped.
    pub stop_reason: String,
    /// What was left out and why, a line each.
    pub plan: Vec<String>,
    /// Every decision about what could be left out.
    pub plan_items: Vec<Item>,
    /// Device code that ran, and all there is.
    pub code: DeviceCode,
    /// What was asked for.
    pub settings: RunSettings,
    /// Device memory.
    pub memory: Memory,
    /// Quality before and after.
    pub quality: QualityReport,
    /// The scene in detail.
    pub scene_details: SceneReport,
    /// The device in detail.
    pub device_details: DeviceInfo,
    /// The machine.
    pub machine: Machine,
    /// The program.
    pub program: Program,
    /// The numbers of every iteration against f64; none where nobody asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<AccuracyReport>,
    /// A row per iteration; iteration 0 is the initial tree.
    pub rows: Vec<IterationRow>,
}

/// The lowest cost known of the scene, this run included.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunReference {
    /// SAH cost, unitless.
    pub reference_cost: f64,
    /// What reached it: `this run`, or a method and the commit at which it was measured.
    pub source: String,
    /// `final_cost / reference_cost - 1`.
    pub final_error: f64,
}

impl RunReport {
    /// All that is known of a run as it ends, on the device that it ran on.
    #[must_use]
    pub fn of(scene: &Scene, device: &dyn Device, settings: RunSettings, result: &Optimized) -> Self {
        let triangles = u32::try_from(scene.triangles.len()).unwrap_or(u32::MAX);
        let mut phases = PhaseTimes::default();
        let Optimized { build_timings, outcome, collapse_timings, wide_timings, .. } = result;
        for timings in [build_timings, &outcome.timings, collapse_timings, wide_timings] {
            phases.add(timings);
        }
        let handed_out = result.adaptive.unwrap_or(result.quality);
        Self {
            schema: SCHEMA,
            scene: scene.name.clone(),
            triangles,
            references: u32::try_from(result.tree.references()).unwrap_or(u32::MAX),
            splits: result.splits,
            device: device.info().name.clone(),
            initial_cost: result.initial.sah_cost,
            final_cost: result.quality.sah_cost,
            reference: None,
            adaptive_cost: result.adaptive.map(|quality| quality.sah_cost),
            wide: result.wide.as_ref().map(WideReport::of),
            leaves: handed_out.leaves,
            depth: handed_out.max_depth,
            bound: result.bound,
            iterations: result.outcome.rows.last().map_or(0, |row| row.iteration),
            time_s: result.optimize_s,
            tree_hash: bvh::tree_hash(&result.tree),
            phases: phases.phases(),
            build_s: result.build_s,
            stop_reason: result.outcome.stop.to_string(),
            plan: result.plan.lines(),
            plan_items: result.plan.items.clone(),
            code: DeviceCode::of(&result.ran, device.info()),
            settings,
            memory: Memory::new(device.memory().peak_bytes, triangles),
            quality: QualityReport { initial: result.initial, last: handed_out },
            scene_details: SceneReport {
                source: scene.source.clone(),
                hash: scene.hash.clone(),
                census: serde_json::to_value(&scene.census).unwrap_or_default(),
                notes: scene.notes.clone(),
            },
            device_details: device.info().clone(),
            machine: Machine::current(),
            program: Program::current(),
            accuracy: None,
            rows: result.outcome.rows.clone(),
        }
    }

    /// Compares the final cost with the one of the reference file, if there is one. A tree with splits is compared with none: it has other costs.
    pub fn set_reference(&mut self, known: Option<&ReferenceCost>) {
        if self.splits.is_some() {
            return;
        }
        let cost = self.final_cost;
        let known = known.filter(|known| known.cost <= cost);
        let (reference_cost, source) = match known {
            Some(known) => (known.cost, format!("{}, commit {}", known.method, known.commit)),
            None => (cost, "this run".to_owned()),
        };
        let final_error = if cost == reference_cost { 0.0 } else { cost / reference_cost - 1.0 };
        self.reference = Some(RunReference { reference_cost, source, final_error });
    }
}

/// The wide tree beside the one handed out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WideReport {
    /// Quality by the costs that decided, boxes as they were before they were packed.
    pub quality: WideQuality,
    /// Bytes of nodes and triangle order.
    pub bytes: usize,
    /// The same for each triangle.
    pub bytes_per_triangle: f64,
    /// Hash of nodes and order ([`prbvh::wide::PackedTree::hash`]).
    pub tree_hash: String,
}

impl WideReport {
    fn of(wide: &WideTree) -> Self {
        let WideTree { tree, quality, .. } = wide;
        let (bytes, bytes_per_triangle) = (tree.bytes(), tree.bytes_per_triangle());
        Self { quality: *quality, bytes, bytes_per_triangle, tree_hash: tree.hash() }
    }
}

/// The scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneReport {
    /// File or generator that it came from.
    pub source: String,
    /// Hash of its triangles, 32 hexadecimal digits.
    pub hash: String,
    /// What the screening found.
    pub census: serde_json::Value,
    /// What of its file was not read.
    pub notes: Vec<Note>,
}

/// What was asked for. `run` and what stands beside it are one object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunSettings {
    /// Of the library.
    #[serde(flatten)]
    pub run: Settings,
    /// Preset that they are of; none: of arguments or defaults.
    pub preset: Option<Preset>,
    /// Threads of the CPU device; none: as many as there are.
    pub threads: Option<u32>,
    /// Costs behind every SAH cost of the report but that of adaptive leaves.
    pub sah: SahModel,
}

impl From<Settings> for RunSettings {
    fn from(run: Settings) -> Self {
        Self { run, preset: None, threads: None, sah: SahModel::default() }
    }
}

/// Device memory in buffers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Memory {
    /// Most at any time, bytes.
    pub peak_bytes: u64,
    /// The same per triangle, bytes.
    pub bytes_per_triangle: f64,
    /// The same per node, bytes.
    pub bytes_per_node: f64,
}

impl Memory {
    /// Divides `peak_bytes` by the triangles and by the nodes of a tree with one of them in each leaf.
    #[must_use]
    pub fn new(peak_bytes: u64, triangles: u32) -> Self {
        let triangles = f64::from(triangles.max(1));
        let peak = peak_bytes as f64;
        Self { peak_bytes, bytes_per_triangle: peak / triangles, bytes_per_node: peak / (2.0 * triangles - 1.0) }
    }
}

/// Quality before and after.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QualityReport {
    /// Of the initial tree.
    pub initial: Quality,
    /// Of the tree handed out.
    #[serde(rename = "final")]
    pub last: Quality,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_shared_out() {
        let memory = Memory::new(600, 3);
        assert_eq!((memory.bytes_per_triangle, memory.bytes_per_node), (200.0, 120.0));
    }
}

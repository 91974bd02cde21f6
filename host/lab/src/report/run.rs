//! What is known of a run.

use crate::accuracy::AccuracyReport;
use crate::machine::Machine;
use crate::phases::Phase;
use crate::program::Program;
use crate::reference::ReferenceCost;
use prbvh::bvh::{DepthBound, MaxDepth, Quality, SahModel};
use prbvh::collapse::CollapseSettings;
use prbvh::device::DeviceInfo;
use prbvh::optimize::{IterationRow, RbvhSettings, WorstFirst};
use prbvh::plan::{DeviceCode, Item};
use prbvh::scene::Note;
use serde::Serialize;

/// Version of [`RunReport`] as JSON; grows when a key changes its meaning or goes away.
pub const SCHEMA: u32 = 2;

/// A run, whole. As JSON the first keys are flat, for programs that want the outcome alone; what follows them explains it.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Name of the scene.
    pub scene: String,
    /// Triangles of the scene that are in the tree.
    pub triangles: u32,
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
    /// Time on the device by kind of work, the longest first.
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
    pub settings: Settings,
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
    /// Compares the final cost with the one of the reference file, if there is one.
    pub fn set_reference(&mut self, known: Option<&ReferenceCost>) {
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

/// What was asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Builder of the initial tree, or the file that it was read from.
    pub initial: String,
    /// Radius of PLOC; none for another builder.
    pub radius: Option<u32>,
    /// Leaves of the treelets of ATRBVH; none for another builder.
    pub treelet: Option<u32>,
    /// Optimiser: `prbvh`, `rbvh` or `none`. `order` and what follows from it are for `prbvh` alone.
    pub optimizer: String,
    /// Settings of RBVH; none for another optimiser.
    pub rbvh: Option<RbvhSettings>,
    /// Whether triangles of equal boxes were one reference.
    pub fold_duplicates: bool,
    /// Most links between root and leaf; none: no bound.
    pub max_depth: MaxDepth,
    /// Locking strategy.
    pub strategy: String,
    /// Which nodes are searched first.
    pub order: String,
    /// How the worst nodes are searched first; none for another order. `strategy`, `mu` and `epsilon` are for the published order alone.
    pub worst_first: Option<WorstFirst>,
    /// Sparse search: one node in `mu` is searched per iteration, at first.
    pub mu: u32,
    /// Change of cost below which `mu` shrinks.
    pub epsilon: f64,
    /// Whether `epsilon` is a share of the initial cost (else it is a cost).
    pub epsilon_relative: bool,
    /// Most iterations; none: no limit.
    pub max_iterations: Option<u32>,
    /// Longest wall time, seconds; none: no limit.
    pub max_time_s: Option<f64>,
    /// Cost at which the run ends, unitless; none: no limit.
    pub target_cost: Option<f64>,
    /// Preset that the settings are of; none: of arguments or defaults.
    pub preset: Option<String>,
    /// Threads of the CPU device; none: as many as there are.
    pub threads: Option<u32>,
    /// Costs behind every SAH cost of the report but that of adaptive leaves.
    pub sah: SahModel,
    /// Adaptive leaves; none: one triangle per leaf.
    pub adaptive: Option<CollapseSettings>,
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

//! What a comparison found: the rows of the table, and the runs behind the figures.

use crate::machine::Machine;
use crate::phases::Phase;
use crate::program::Program;
use prbvh::bvh::DepthBound;
use prbvh::device::DeviceInfo;
use prbvh::optimize::IterationRow;
use prbvh::scene::Note;
use serde::{Deserialize, Serialize};

/// Version of [`Comparison`] as JSON; grows when a key changes its meaning or goes away.
pub const SCHEMA: u32 = 1;

/// Methods against each other on some scenes, all costs from the one f64 evaluator ([`prbvh::bvh::quality`]).
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The machine.
    pub machine: Machine,
    /// The program, its commit and the command line.
    pub program: Program,
    /// The devices used, in the order of `--device`.
    pub devices: Vec<DeviceInfo>,
    /// Times of a row are medians of this many runs.
    pub repeat: u32,
    /// How the rays were made; none: nothing was traced.
    pub rays: Option<RaySettings>,
    /// In the order of the command line.
    pub scenes: Vec<SceneComparison>,
}

/// The path tracer's settings, for all scenes and methods alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RaySettings {
    /// Columns of a picture.
    pub width: u32,
    /// Rows of a picture.
    pub height: u32,
    /// Paths per pixel.
    pub samples: u32,
    /// Times that a path goes on after the first surface.
    pub bounces: u32,
    /// Shadow rays per surface hit.
    pub light_samples: u32,
    /// Views of each scene, over which the rates are taken.
    pub views: u32,
}

/// One scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneComparison {
    /// Name.
    pub name: String,
    /// Hash of its triangles.
    pub hash: String,
    /// Triangles in the trees.
    pub triangles: u32,
    /// What of its file was not read.
    pub notes: Vec<Note>,
    /// A row per method, µ and device.
    pub rows: Vec<MethodRow>,
    /// The optimiser's runs, for the figures.
    pub runs: Vec<OptimizerRun>,
    /// Costs against the lowest one known; none before [`super::SceneErrors::of`] fills it, or if there is no cost.
    pub errors: Option<SceneErrors>,
    /// Pictures of the scene.
    pub pictures: Vec<Picture>,
}

/// A row of the table. What a method does not have is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MethodRow {
    /// Scene.
    pub scene: String,
    /// Method with its setting, such as `ploc r=100`, `prbvh`, `obvhs best`.
    pub method: String,
    /// First µ of a PRBVH run.
    pub mu: Option<u32>,
    /// Device that built the tree; `cpu (host)` for a builder that runs on no device, `cpu (peer)` for another library.
    pub device: String,
    /// Device that the rays were traced on, and the adaptive leaves made.
    #[serde(default)]
    pub traced_on: Option<String>,
    /// Threads that built the tree; 0: as many as the device has.
    pub threads: u32,
    /// SAH cost with one triangle per leaf, unitless.
    pub cost: Option<f64>,
    /// SAH cost with adaptive leaves, as the paper counts, unitless.
    pub adaptive_cost: Option<f64>,
    /// Wall time from triangles to the tree with one triangle per leaf, seconds; median.
    pub build_s: Option<f64>,
    /// Of it, time on the device, seconds; the paper's build time. None for what runs on the host alone.
    pub device_s: Option<f64>,
    /// Millions of rays per second, with adaptive leaves.
    pub mrays: Option<RayRates>,
    /// Box tests per ray, all rays.
    pub box_tests: Option<f64>,
    /// Triangle tests per ray, all rays.
    pub triangle_tests: Option<f64>,
    /// Most links between root and leaf, one triangle per leaf.
    pub depth: Option<u32>,
    /// Entries that the stack of a ray needs ([`prbvh::bvh::Quality::stack`]), with adaptive leaves, which is what the rays trace.
    #[serde(default)]
    pub stack: Option<u32>,
    /// What the bound on the depth changed; none where the tree was within it.
    #[serde(default)]
    pub bound: Option<DepthBound>,
    /// End-point overlap (Aila, Karras & Laine 2013) of the tree with one triangle per leaf, unitless.
    pub epo: Option<f64>,
    /// Half the width of its 95 % confidence interval, unitless; 0 where it is exact ([`prbvh::bvh::epo()`]).
    #[serde(default)]
    pub epo_error: Option<f64>,
    /// Most bytes of device buffers while it was built.
    pub bytes: Option<u64>,
    /// References of the tree with one of them per leaf: with splits more than the scene has triangles. Its cost is then not compared with those of others.
    #[serde(default)]
    pub references: Option<u32>,
    /// Iterations of an optimiser.
    pub iterations: Option<u32>,
    /// Hash of the tree with one triangle per leaf.
    pub tree_hash: Option<String>,
    /// `cost / lowest cost known - 1`, unitless ([`super::SceneErrors`]).
    #[serde(default)]
    pub relative_error: Option<f64>,
    /// When its run came near the lowest cost known.
    #[serde(default)]
    pub time_to: Option<TimesToError>,
    /// `ok`, or what went wrong in a line.
    pub status: String,
    /// Seconds that PRBVH with this row's µ needs, on one thread, to reach the cost of RBVH; and how many times RBVH's time that is less.
    pub against_rbvh: Option<AgainstRbvh>,
}

impl MethodRow {
    /// Whether its tree has more references than the scene has triangles.
    #[must_use]
    pub fn has_splits(&self, triangles: u32) -> bool {
        self.references.is_some_and(|references| references > triangles)
    }
}

/// Speed over RBVH to the same cost, both on one core.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgainstRbvh {
    /// The higher of the two final costs, which both reach.
    pub cost: f64,
    /// Seconds until RBVH was there.
    pub rbvh_s: f64,
    /// Seconds until PRBVH was there.
    pub prbvh_s: f64,
    /// `rbvh_s / prbvh_s`.
    pub speed_up: f64,
}

/// Millions of rays per second of the trace kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RayRates {
    /// All rays over all time.
    pub overall: f64,
    /// Camera rays.
    pub primary: f64,
    /// Shadow rays.
    pub shadow: f64,
    /// Rays of later bounces; none were traced: 0.
    pub secondary: f64,
}

/// One run of an optimiser; a builder without iterations has one row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizerRun {
    /// Method, as in the rows.
    pub method: String,
    /// What the run is shown in.
    pub purpose: Purpose,
    /// Initial tree.
    pub initial: String,
    /// Locking strategy; empty for RBVH and the builders.
    pub strategy: String,
    /// First µ; 0 for what has none.
    pub mu: u32,
    /// Device.
    pub device: String,
    /// Wall time of the initial tree, seconds; a row's time from triangles is this and its `time_s`.
    pub build_s: f64,
    /// Time of the initial tree on the device, seconds; none for what runs on the host alone. A row's device time from triangles is this
    /// and its `device_s`.
    #[serde(default)]
    pub build_device_s: Option<f64>,
    /// A row per iteration; row 0 is the initial tree.
    pub rows: Vec<IterationRow>,
    /// Device time by kind of work, the initial tree's included.
    pub phases: Vec<Phase>,
    /// What its plan left out and why, a line each ([`prbvh::plan::Plan::lines`]); nothing of what is not planned.
    #[serde(default)]
    pub plan: Vec<String>,
}

impl OptimizerRun {
    /// The lowest cost of a row; none if there is none above 0.
    #[must_use]
    pub fn lowest_cost(&self) -> Option<f64> {
        self.rows.iter().map(|row| row.cost).filter(|cost| is_cost(*cost)).min_by(f64::total_cmp)
    }
}

/// Whether it is a number that a tree can cost.
pub(super) fn is_cost(cost: f64) -> bool {
    cost > 0.0 && cost.is_finite()
}

/// Method, and µ where it has one.
pub(super) fn with_mu(method: &str, mu: Option<u32>) -> String {
    mu.map_or_else(|| method.to_owned(), |mu| format!("{method} µ={mu}"))
}

/// The figure that a run was made for; every figure may use the runs of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// A row of the table.
    Table,
    /// Influence of µ.
    Mu,
    /// Aggressive against conservative.
    Strategy,
    /// LBVH against ATRBVH and others as the initial tree.
    Initial,
    /// PRBVH on one thread, against RBVH.
    OneThread,
}

/// A rendered picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// What it shows, such as `view 1, shaded` or `view 1, tests per pixel, lbvh`.
    pub title: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The PNG file.
    #[serde(skip)]
    pub png: Vec<u8>,
}

/// Relative errors whose times are told: 10 %, 5 %, 2 %, 1 %, 0.1 %.
pub const LEVELS: [f64; 5] = [0.1, 0.05, 0.02, 0.01, 0.001];

/// Costs of a scene against the lowest one known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneErrors {
    /// The lowest cost known.
    pub reference: Reference,
    /// [`LEVELS`].
    pub levels: [f64; 5],
    /// A row per method, µ and device, the runs of figures included; in the order of the runs.
    pub settings: Vec<SettingErrors>,
    /// The Pareto front: places in `settings` of those that no other is both faster than and as good as, the fastest first.
    pub pareto_front: Vec<usize>,
}

/// The cost that errors are relative to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// SAH cost, one triangle per leaf, unitless.
    pub reference_cost: f64,
    /// What reached it.
    pub source: String,
    /// Whether it is from the file of reference costs, not of this comparison.
    pub is_from_file: bool,
}

/// A method with its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SettingErrors {
    /// Method; with the initial tree and the strategy where they are not the usual ones.
    pub method: String,
    /// First µ; 0 for what has none.
    pub mu: u32,
    /// Device.
    pub device: String,
    /// Wall time from triangles to its end, seconds.
    pub wall_s: f64,
    /// Relative error of the best tree.
    pub error: f64,
    /// When it came near.
    pub time_to: TimesToError,
}

/// Times from triangles until the relative error was at most each of [`LEVELS`], seconds; none where it never was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimesToError {
    /// Wall time.
    pub wall_s: [Option<f64>; 5],
    /// Time on the device; none for what runs on the host alone too.
    pub device_s: [Option<f64>; 5],
}

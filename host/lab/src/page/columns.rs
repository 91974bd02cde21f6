//! The columns of the table: their values, and what they mean in plain words.

use crate::compare::{MethodRow, RayRates};
use prbvh::format;

/// A column.
pub(super) struct Column {
    pub(super) name: &'static str,
    /// Empty: none.
    pub(super) unit: &'static str,
    pub(super) meaning: &'static str,
    pub(super) better: Better,
    pub(super) cell: Cell,
}

/// Which value of a column is the best.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Better {
    Less,
    More,
    Neither,
}

/// How a column's value is found and written.
pub(super) enum Cell {
    Text(fn(&MethodRow) -> String),
    /// The value, and its text. The second argument is the cost of the scene's LBVH.
    Number(fn(&MethodRow, Option<f64>) -> Option<f64>, fn(f64) -> String),
}

/// From left to right, after the method.
pub(super) const COLUMNS: [Column; 22] = [
    Column {
        name: "µ",
        unit: "",
        meaning: "Sparse search of PRBVH: an iteration searches a new place for one node in µ. µ shrinks to 1 while the run converges; this is the first.",
        better: Better::Neither,
        cell: Cell::Number(|row, _| row.mu.map(Into::into), whole),
    },
    Column {
        name: "device",
        unit: "",
        meaning: "What built the tree. “cpu (peer)” is another library on the processor.",
        better: Better::Neither,
        cell: Cell::Text(|row| row.device.clone()),
    },
    Column {
        name: "threads",
        unit: "",
        meaning: "Threads that built the tree; “all”: as many as the device has.",
        better: Better::Neither,
        cell: Cell::Number(|row, _| Some(row.threads.into()), |v| if v == 0.0 { "all".to_owned() } else { whole(v) }),
    },
    Column {
        name: "SAH cost",
        unit: "",
        meaning: "Expected cost of a random ray by the surface area heuristic, with one triangle in each leaf: the quantity that the optimisers make smaller. All costs are measured by one program, in double precision.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.cost, cost),
    },
    Column {
        name: "cost / LBVH",
        unit: "",
        meaning: "SAH cost divided by the one of LBVH on the same scene, as in the paper's table.",
        better: Better::Less,
        cell: Cell::Number(
            |row, lbvh| Some(row.cost? / lbvh?).filter(|ratio| ratio.is_finite()),
            |v| format!("{v:.3}"),
        ),
    },
    Column {
        name: "adaptive cost",
        unit: "",
        meaning: "SAH cost after leaves were merged wherever that makes it smaller, as the paper counts. The rays below trace these trees.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.adaptive_cost, cost),
    },
    Column {
        name: "build time",
        unit: "",
        meaning: "Wall time from triangles to the finished tree, the initial tree and the optimisation included; median of the runs.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.build_s, format::seconds),
    },
    Column {
        name: "on the device",
        unit: "",
        meaning: "The part of the build time that kernels ran on the device, which the paper gives as build time. Empty for what runs on the host alone.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.device_s, format::seconds),
    },
    Column {
        name: "rays",
        unit: "M/s",
        meaning: "Millions of rays per second through the tree with adaptive leaves, all kinds together.",
        better: Better::More,
        cell: Cell::Number(|row, _| rate(row, |rates| rates.overall), format::significant),
    },
    Column {
        name: "primary rays",
        unit: "M/s",
        meaning: "Rays from the camera, which are coherent.",
        better: Better::More,
        cell: Cell::Number(|row, _| rate(row, |rates| rates.primary), format::significant),
    },
    Column {
        name: "shadow rays",
        unit: "M/s",
        meaning: "Rays towards the light, which end at the first thing hit.",
        better: Better::More,
        cell: Cell::Number(|row, _| rate(row, |rates| rates.shadow), format::significant),
    },
    Column {
        name: "secondary rays",
        unit: "M/s",
        meaning: "Rays of later bounces of the path tracer, which are incoherent.",
        better: Better::More,
        cell: Cell::Number(|row, _| rate(row, |rates| rates.secondary), format::significant),
    },
    Column {
        name: "box tests",
        unit: "per ray",
        meaning: "Tests of a ray against a box, on average over all rays. Unlike a rate it does not depend on the machine.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.box_tests, format::significant),
    },
    Column {
        name: "triangle tests",
        unit: "per ray",
        meaning: "Tests of a ray against a triangle, on average over all rays.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.triangle_tests, format::significant),
    },
    Column {
        name: "depth",
        unit: "",
        meaning: "Most steps from the root to a leaf, with one triangle in each leaf. A deep tree needs a larger stack.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.depth.map(Into::into), whole),
    },
    Column {
        name: "stack",
        unit: "",
        meaning: "Entries that the stack of a ray needs in the tree with adaptive leaves, if the nearer child is visited first and the farther one waits: the most over all rays. Stacks of 64 are usual.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.stack.map(Into::into), whole),
    },
    Column {
        name: "EPO",
        unit: "",
        meaning: "End-point overlap (Aila, Karras and Laine 2013): the share of the cost from nodes that a surface point lies in without belonging to them. Together with the cost it predicts the speed of rays better than the cost alone.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.epo, format::significant),
    },
    Column {
        name: "EPO error",
        unit: "±",
        meaning: "Where an exact end-point overlap takes too long it is estimated from a sample; this is half the width of its 95 % confidence interval.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.epo_error.filter(|&error| error > 0.0), format::significant),
    },
    Column {
        name: "device memory",
        unit: "",
        meaning: "Most memory in device buffers at any time while the tree was built.",
        better: Better::Less,
        cell: Cell::Number(|row, _| row.bytes.map(|bytes| bytes as f64), |v| format::bytes(v as u64)),
    },
    Column {
        name: "iterations",
        unit: "",
        meaning: "Iterations of the optimiser until it stopped.",
        better: Better::Neither,
        cell: Cell::Number(|row, _| row.iterations.map(Into::into), whole),
    },
    Column {
        name: "speed-up over RBVH",
        unit: "×",
        meaning: "How many times sooner than RBVH this PRBVH reaches the same cost, both on one thread of the processor. The cost is the higher of their two final ones.",
        better: Better::More,
        cell: Cell::Number(|row, _| row.against_rbvh.map(|against| against.speed_up), format::significant),
    },
    Column {
        name: "tree hash",
        unit: "",
        meaning: "Hash of the tree with one triangle per leaf: equal hashes are equal trees, whatever the device.",
        better: Better::Neither,
        cell: Cell::Text(|row| {
            row.tree_hash.as_deref().map_or_else(String::new, |hash| hash.chars().take(12).collect())
        }),
    },
];

/// A rate of 0 says that no such rays were traced.
fn rate(row: &MethodRow, of: fn(&RayRates) -> f64) -> Option<f64> {
    row.mrays.as_ref().map(of).filter(|&rate| rate > 0.0)
}

fn whole(value: f64) -> String {
    format::count(value as u64)
}

fn cost(value: f64) -> String {
    format!("{value:.2}")
}

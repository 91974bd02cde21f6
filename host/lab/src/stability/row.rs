//! A row of the table.

use serde::{Deserialize, Serialize};
use std::fmt;

/// One method on one case on one device. What could not be measured is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Case.
    pub case: String,
    /// Method.
    pub method: String,
    /// Device, as `--device` names it.
    pub device: String,
    /// Triangles in the tree.
    pub triangles: u32,
    /// Triangles left out because a coordinate is not finite.
    pub left_out: u32,
    /// Whether the tree is one, over these triangles.
    pub valid: bool,
    /// Whether all costs, of every iteration too, are finite.
    pub finite: bool,
    /// Iterations of the optimiser.
    pub iterations: u32,
    /// Why it stopped; empty for a builder.
    pub stop: String,
    /// SAH cost of the initial tree, f64, one triangle per leaf, unitless.
    pub cost_before: Option<f64>,
    /// SAH cost of the tree that is handed out, f64, unitless.
    pub cost_after: Option<f64>,
    /// The larger of |f32 cost / f64 cost - 1| before and after.
    pub f32_error: Option<f64>,
    /// Most links between root and leaf.
    pub depth: Option<u32>,
    /// Most steps of a search.
    pub most_steps: u32,
    /// Hash of the tree.
    pub tree_hash: Option<String>,
    /// Whether the hash is that of the first device; none on the first.
    pub same_hash: Option<bool>,
    /// Runs that must give the same tree and did: other orders of the invocations, one thread.
    pub repeated: Vec<String>,
    /// Powers of two by which the scene was multiplied without a change of the topology.
    pub scaled_by: Vec<i32>,
    /// Largest |relative difference| of the cost after the axes changed places, from the same initial tree.
    pub axes_change: Option<f64>,
    /// Moves that a search offers in the initial and the final tree, all of which lower the cost in f64.
    pub moves: Option<u32>,
    /// Rays that hit as they do without a tree.
    pub rays: u32,
    /// What is wrong; nothing: the row is green.
    pub breaches: Vec<Breach>,
}

/// A property that does not hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Breach {
    /// Which.
    pub property: Property,
    /// The numbers.
    pub what: String,
}

/// What every row must keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Property {
    /// A scene with NaN or infinities is refused by name, or they are left out and counted.
    Screened,
    /// There is a result.
    Runs,
    /// The tree is one: [`prbvh::bvh::validate`].
    Valid,
    /// All costs are finite.
    Finite,
    /// No cost is above the initial one.
    NotWorse,
    /// The f32 cost is within its bound of the f64 one.
    F32Cost,
    /// The optimiser ends by itself, before its iteration limit and without a fault.
    Ends,
    /// No search takes more steps than its bound.
    Steps,
    /// Where the depth is bounded, no leaf lies deeper.
    Depth,
    /// The same tree on every device.
    Device,
    /// The same tree again, for any number of threads and order of invocations.
    Repeats,
    /// The same topology for the scene times a power of two.
    Scale,
    /// The same cost when the axes change places.
    Axes,
    /// Every move that a search offers lowers the cost, computed in f64.
    Moves,
    /// Rays hit what they hit without a tree.
    Rays,
}

impl fmt::Display for Property {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Screened => "screened",
            Self::Runs => "runs",
            Self::Valid => "valid",
            Self::Finite => "finite",
            Self::NotWorse => "not worse",
            Self::F32Cost => "f32 cost",
            Self::Ends => "ends",
            Self::Steps => "steps",
            Self::Depth => "depth",
            Self::Device => "device",
            Self::Repeats => "repeats",
            Self::Scale => "scale",
            Self::Axes => "axes",
            Self::Moves => "moves",
            Self::Rays => "rays",
        })
    }
}

impl Row {
    /// Whether every property holds.
    #[must_use]
    pub fn is_green(&self) -> bool {
        self.breaches.is_empty()
    }

    pub(super) fn breach(&mut self, property: Property, what: impl Into<String>) {
        self.breaches.push(Breach { property, what: what.into() });
    }
}

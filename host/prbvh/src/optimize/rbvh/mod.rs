//! RBVH: insertion-based optimisation, one node after another (Bittner, Hapala & Havran 2013, *Fast Insertion-Based Optimization of
//! Bounding Volume Hierarchies*).
//!
//! The sequential reference that the paper of PRBVH compares with, in time and in cost. A batch takes the 1 % of the nodes that look worst,
//! removes each together with its parent, and inserts its two children again, the larger one first, where branch and bound finds that
//! they add the least area. The best tree is kept.

mod batch;
mod grow;
mod rows;
mod schedule;
mod search;
mod select;
#[cfg(test)]
mod tests;
mod tree;

pub(super) use grow::{Between, Way, grown};
pub use tree::RbvhTree;

use super::TreeAreas;
use super::{IterationRow, Limits, OptimizeError, Outcome, StopReason, set_relative_errors};
use crate::build::UnfitTree;
use crate::bvh::Bvh;
use crate::device::Timing;
use crate::scene::SafeRange;
use batch::reinsert;
use prbvh_kernel::node::Node;
use rows::Rows;
use schedule::{Schedule, Source};
use search::Search;
use select::Selection;
use std::ops::ControlFlow;
use std::time::Instant;

/// Settings of RBVH.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct RbvhSettings {
    /// Part of the nodes with a grandparent that a batch takes, above 0 and at most 1; but 32 nodes at least.
    pub batch: f64,
    /// A batch improves the tree if the cost falls below the best one by more than this part of it. With 0 the last batches win next to
    /// nothing each, and rounding alone may make a new best cost for ever.
    pub epsilon: f64,
    /// Takes a reinsertion that does not lower the cost back at once. Without, a run ends sooner with a tree that is a few per cent worse:
    /// the second child cannot repair what the first one's best place spoils, and once the tree is good most random picks spoil it.
    pub undo: bool,
    /// Batches without an improvement after which nodes are picked at random until the next one.
    pub random_after: u32,
    /// Batches without an improvement that end the search.
    pub patience: u32,
    /// What ends it early.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub limits: Limits,
    /// Seed of the random picks.
    pub seed: u64,
}

impl Default for RbvhSettings {
    /// As published: 1 %, 5 and 10 batches. `epsilon` and `undo` are this implementation's.
    fn default() -> Self {
        Self {
            batch: 0.01,
            epsilon: 1e-5,
            undo: true,
            random_after: 5,
            patience: 10,
            limits: Limits::iterations(100_000),
            seed: 1,
        }
    }
}

/// Optimises `nodes[2n-1]`, a tree as a device leaves it, in place; it ends as the best tree, the initial one included. Boxes are finite and
/// in the [range](SafeRange::check) of what works on trees. One thread; the result depends on the tree and the settings alone.
///
/// `observe` sees every batch as a row, the initial tree as row 0, and the tree after it; it may break. In a row `found` are the nodes
/// picked, `owned` those of them that were reinserted (others went away with an earlier one of the batch), `applied` those whose reinsertion
/// lowered the cost, and `most_steps` the most nodes opened by one search; `mu` and `device_s` are 0. [`Outcome::rows`] has a row per batch,
/// of a long run a row for several: the counts are then sums, and the cost is the lowest.
///
/// # Errors
/// If a setting makes no sense, the links are no tree, or the root's box is [out of range](SafeRange::check).
pub fn rbvh(
    nodes: &mut [Node],
    settings: &RbvhSettings,
    observe: &mut dyn FnMut(&IterationRow, &RbvhTree) -> ControlFlow<()>,
) -> Result<Outcome, OptimizeError> {
    settings.check()?;
    let tree = Bvh::from_device(nodes).map_err(|faults| UnfitTree::Broken { faults })?;
    SafeRange::check(&nodes[0].aabb()).map_err(UnfitTree::from)?;
    let (best, outcome) = rbvh_of(tree, settings, observe);
    nodes.copy_from_slice(&best);
    Ok(outcome)
}

/// [`rbvh`] of a tree as [`Bvh::from_device`] makes it, which is freed as soon as it has been read.
pub(crate) fn rbvh_of(
    tree: Bvh,
    settings: &RbvhSettings,
    observe: &mut dyn FnMut(&IterationRow, &RbvhTree) -> ControlFlow<()>,
) -> (Vec<Node>, Outcome) {
    let mut run = Run::new(tree, settings);
    let (mut rows, stop) = run.run(settings, observe);
    set_relative_errors(&mut rows);
    let Run { mut tree, selection, search, timings, .. } = run;
    let working_bytes = tree.bytes() + search.bytes() + selection.bytes();
    drop((selection, search));
    tree.restore();
    (tree.nodes(), Outcome { rows, stop, timings, working_bytes })
}

struct Run {
    start: Instant,
    tree: RbvhTree,
    selection: Selection,
    search: Search,
    timings: Vec<Timing>,
}

impl Run {
    fn new(tree: Bvh, settings: &RbvhSettings) -> Self {
        let start = Instant::now();
        let tree = RbvhTree::new(tree);
        let selection = Selection::new(&tree, settings.batch, settings.seed);
        let search = Search::new(tree.internal());
        Self { start, tree, selection, search, timings: Vec::new() }
    }

    fn run(
        &mut self,
        settings: &RbvhSettings,
        observe: &mut dyn FnMut(&IterationRow, &RbvhTree) -> ControlFlow<()>,
    ) -> (Vec<IterationRow>, StopReason) {
        let mut row = IterationRow { cost: self.cost(), time_s: self.seconds(), ..IterationRow::default() };
        let mut schedule = Schedule::new(settings, row.cost);
        let mut rows = Rows::new(row);
        let mut best = row.cost;
        let stop = loop {
            if observe(&row, &self.tree).is_break() {
                break StopReason::Cancelled;
            }
            if let Some(stop) = schedule.stop(row.iteration, self.start.elapsed()) {
                break stop;
            }
            row = self.batch(settings, row.iteration + 1, schedule.source());
            if row.found == 0 {
                break StopReason::Converged;
            }
            if row.cost < best {
                best = row.cost;
                self.tree.keep();
            }
            schedule.note(&row, settings.undo);
            rows.push(row);
        };
        (rows.finish(), stop)
    }

    fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// SAH cost of the tree, one triangle per leaf.
    fn cost(&self) -> f64 {
        let tree = &self.tree;
        TreeAreas { root: tree.root_area(), leaves: tree.leaf_area(), internal: tree.internal_area() }
            .cost(tree.internal() + 1)
    }

    fn batch(&mut self, settings: &RbvhSettings, iteration: u32, source: Source) -> IterationRow {
        let start = Instant::now();
        match source {
            Source::Worst => self.selection.pick_worst(&self.tree),
            Source::Random => self.selection.pick_random(&self.tree),
        }
        let picked = Instant::now();
        self.timings.push(Timing { label: "select", seconds: (picked - start).as_secs_f64() });
        let mut row = IterationRow { iteration, ..IterationRow::default() };
        let is_stopped = || settings.limits.is_stopped();
        reinsert(&mut self.tree, (&mut self.selection, &mut self.search), settings.undo, &is_stopped, &mut row);
        self.timings.push(Timing { label: "reinsert", seconds: picked.elapsed().as_secs_f64() });
        row.time_s = self.seconds();
        row.cost = self.cost();
        row
    }
}

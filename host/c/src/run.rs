//! A run, and where its tree goes.

use crate::input::check_pointer;
use crate::options::{PrbvhOptions, PrbvhProgress};
use crate::status::Failure;
use bytemuck::{Pod, Zeroable};
use prbvh::bvh::FlatTree;
use prbvh::device;
use prbvh::optimize::{IterationRow, StopReason};
use prbvh::pipeline::{self, Optimized};
use prbvh::scene::Scene;
use std::ops::ControlFlow;

/// A node, 32 bytes; the root is the first. Children come after their parents.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PrbvhNode {
    /// Smallest corner of the box.
    pub min: [f32; 3],
    /// count = 0: the left child, whose sibling is the next node. Else a leaf: its first place in the order of primitives.
    pub first: u32,
    /// Largest corner of the box.
    pub max: [f32; 3],
    /// Primitives of a leaf; 0: it is none.
    pub count: u32,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PrbvhStop {
    /// Nothing more is to be gained.
    Converged = 0,
    /// `max_iterations`.
    MaxIterations = 1,
    /// `max_seconds`.
    MaxSeconds = 2,
    /// `target_cost`.
    TargetCost = 3,
    /// `progress` ended it.
    Cancelled = 4,
    /// Something else.
    Other = 5,
}

/// What came out. Set the size before the call:
///
/// PrbvhResult result = {0};
/// result.size = sizeof result;
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct PrbvhResult {
    /// sizeof(PrbvhResult): which version of it this is.
    pub size: usize,
    /// Nodes of the tree, 2n-1 at the most.
    pub node_count: usize,
    /// A PrbvhStop.
    pub stop: u32,
    /// Iterations.
    pub iterations: u32,
    /// Most links from the root to a leaf.
    pub max_depth: u32,
    /// Always 0.
    pub reserved: u32,
    /// SAH cost of the initial tree: 3 for a visit of a node, 2 for a test of a primitive.
    pub initial_cost: f64,
    /// SAH cost of the tree.
    pub cost: f64,
    /// Seconds of all.
    pub seconds: f64,
}

/// Where the tree goes.
pub(crate) struct Out {
    nodes: *mut PrbvhNode,
    order: *mut u32,
    result: *mut PrbvhResult,
}

impl Out {
    /// # Safety
    /// A result that is not NULL leads to as many bytes as its first word says.
    pub(crate) unsafe fn new(
        nodes: *mut PrbvhNode,
        order: *mut u32,
        result: *mut PrbvhResult,
    ) -> Result<Self, Failure> {
        check_pointer("nodes", nodes)?;
        check_pointer("order", order)?;
        if !result.is_null() {
            check_pointer("result", result)?;
            // SAFETY: the size comes first.
            let (size, known) = (unsafe { result.cast::<usize>().read() }, size_of::<PrbvhResult>());
            if size < known {
                return Err(Failure::argument(format!("result.size is {size}, but sizeof(PrbvhResult) is {known}")));
            }
        }
        Ok(Self { nodes, order, result })
    }

    /// Writes all.
    fn write(self, tree: &FlatTree, result: PrbvhResult) {
        let nodes: &[PrbvhNode] = bytemuck::cast_slice(&tree.nodes);
        // SAFETY: a tree over n primitives has 2n-1 nodes at the most, for which there is room; the caller's arrays are no others.
        unsafe { std::ptr::copy_nonoverlapping(nodes.as_ptr(), self.nodes, nodes.len()) };
        // SAFETY: n ids, as above.
        unsafe { std::ptr::copy_nonoverlapping(tree.order.as_ptr(), self.order, tree.order.len()) };
        if !self.result.is_null() {
            // SAFETY: checked in `new`; the rest of the caller's size stays as it is.
            unsafe {
                let size = self.result.cast::<usize>().read();
                self.result.write(PrbvhResult { size, ..result });
            }
        }
    }
}

/// Optimises and writes.
pub(crate) fn run(
    scene: impl FnOnce() -> Result<Scene, Failure>,
    options: &PrbvhOptions,
    out: Out,
) -> Result<(), Failure> {
    let start = std::time::Instant::now();
    // SAFETY: the duty of whoever called the library: its functions say so of their options.
    let (choice, settings) = (options.device()?, unsafe { options.settings() }?);
    let scene = scene()?;
    let mut device = device::open(choice, options.threads as usize, false)?;
    let done = pipeline::optimize(&scene, &mut *device, &settings, &mut |row| told(options, row))?;
    let result = result(&done, start.elapsed().as_secs_f64());
    out.write(&FlatTree::new(&done.tree), result);
    Ok(())
}

fn told(options: &PrbvhOptions, row: &IterationRow) -> ControlFlow<()> {
    let Some(progress) = options.progress else { return ControlFlow::Continue(()) };
    let size = size_of::<PrbvhProgress>();
    let now = PrbvhProgress { size, iteration: row.iteration, reserved: 0, seconds: row.time_s, cost: row.cost };
    // SAFETY: the caller's function, with the caller's pointer.
    let answer = unsafe { progress(options.user, &raw const now) };
    if answer == 0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}

fn result(done: &Optimized, seconds: f64) -> PrbvhResult {
    let stop = match done.outcome.stop {
        StopReason::Converged => PrbvhStop::Converged,
        StopReason::MaxIterations => PrbvhStop::MaxIterations,
        StopReason::MaxTime => PrbvhStop::MaxSeconds,
        StopReason::Target => PrbvhStop::TargetCost,
        StopReason::Cancelled => PrbvhStop::Cancelled,
        _ => PrbvhStop::Other,
    };
    let quality = done.adaptive.unwrap_or(done.quality);
    PrbvhResult {
        size: size_of::<PrbvhResult>(),
        node_count: done.tree.nodes.len(),
        stop: stop as u32,
        iterations: done.outcome.rows.len().saturating_sub(1) as u32,
        max_depth: quality.max_depth,
        reserved: 0,
        initial_cost: done.initial.sah_cost,
        cost: quality.sah_cost,
        seconds,
    }
}

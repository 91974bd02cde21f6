//! A tree and its triangles as the tracing kernels take them.

use super::form::Form;
use super::wide::{WideArrays, packed};
use super::{Query, TraceError, TraceRange};
use crate::bvh::{self, Bvh, Content, ROOT};
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, on_host};
use crate::wide::{Layout as WideLayout, PackedTree, Width};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::trace::{LEAF, STEPS, TraceNode, TraceParams, TraceTriangle};

/// Most bytes of a buffer for the stacks of deep trees.
const STACK_BYTES: usize = 64 << 20;

/// A scene to trace rays through, on a device.
#[derive(Debug)]
pub struct TraceScene {
    nodes: Buffer,
    triangles: Buffer,
    /// Stacks of as many rays as are traced at once, for trees too deep for a stack of the invocation's own.
    stacks: Option<Buffer>,
    root: u32,
    /// Nodes and triangles, more than any ray visits.
    most_steps: u64,
    form: Form,
    depth: u32,
    range: TraceRange,
}

/// What goes on the device.
struct Arrays<'a> {
    form: Form,
    /// The nodes, and the bytes of one.
    nodes: (&'a [u8], usize),
    triangles: &'a [TraceTriangle],
    root: u32,
    depth: u32,
}

/// The arrays of [`TraceScene`] on the host.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) nodes: Vec<TraceNode>,
    pub(super) triangles: Vec<TraceTriangle>,
    pub(super) root: u32,
}

impl TraceScene {
    /// Puts `tree` over `triangles` on the device; leaves of a tree [with splits](Bvh::has_splits) keep their boxes. Rays will start in the smallest box around the scene and the points `starts`.
    ///
    /// # Errors
    /// If the tree is none over as many triangles, or the device refuses or fails.
    pub fn new(
        device: &mut dyn Device,
        tree: &Bvh,
        triangles: &[Triangle],
        starts: &[[f32; 3]],
    ) -> Result<Self, TraceError> {
        let (range, working) = working(device, triangles, starts);
        let has_splits = tree.has_splits(triangles.len());
        let faults = if has_splits {
            bvh::validate_tree(tree, triangles).err().unwrap_or_default()
        } else {
            bvh::links_and_leaves(tree, triangles.len())
        };
        if !faults.is_empty() {
            return Err(TraceError::InvalidTree(faults));
        }
        let depth = bvh::quality(tree, &bvh::SahModel::default()).max_depth;
        let Layout { nodes, triangles, root } = on_host(device, || {
            let tree = if has_splits { with_boxes_in(tree, &range) } else { tree.clone().with_boxes_of(&working) };
            Layout::new(&tree, &working)
        });
        let nodes = (bytemuck::cast_slice(&nodes), size_of::<TraceNode>());
        Ok(Self::upload(device, &Arrays { form: Form::Binary, nodes, triangles: &triangles, root, depth }, range)?)
    }

    /// [`TraceScene::new`] with a wide tree. Hits are the same, bit for bit; a node counts as tests of as many boxes as it has slots.
    ///
    /// # Errors
    /// As [`TraceScene::new`].
    pub fn of_wide(
        device: &mut dyn Device,
        tree: &PackedTree,
        triangles: &[Triangle],
        starts: &[[f32; 3]],
    ) -> Result<Self, TraceError> {
        let (range, working) = working(device, triangles, starts);
        let WideArrays { tree, triangles, levels } = on_host(device, || WideArrays::new(tree, &working, &range))?;
        let form = Form::Wide(tree.nodes.width(), tree.nodes.layout());
        let nodes = (tree.nodes.bytes(), tree.nodes.node_bytes());
        Ok(Self::upload(device, &Arrays { form, nodes, triangles: &triangles, root: 0, depth: levels }, range)?)
    }

    /// Allocates what a tree over so many triangles takes at most, and gives it back: for plans. Without stacks for deep trees.
    pub(crate) fn reserve(device: &mut dyn Device, triangles: usize) -> Result<(), DeviceError> {
        reserve(device, triangles.saturating_sub(1), size_of::<TraceNode>(), triangles)
    }

    /// [`TraceScene::reserve`] of a wide tree: each node but a lone root has two children at least.
    pub(crate) fn reserve_wide(
        device: &mut dyn Device,
        triangles: usize,
        width: Width,
        layout: WideLayout,
    ) -> Result<(), DeviceError> {
        reserve(device, triangles.saturating_sub(1), layout.node_bytes(width), triangles)
    }

    fn upload(device: &mut dyn Device, arrays: &Arrays<'_>, range: TraceRange) -> Result<Self, DeviceError> {
        let device = &mut Lease::new(device);
        let Arrays { form, nodes: (nodes, node_bytes), triangles: leaves, root, depth } = *arrays;
        let count = nodes.len() / node_bytes;
        let [on_device, triangles] = buffers_of(device, count, node_bytes, leaves.len())?;
        device.upload(&on_device, nodes)?;
        device.upload(&triangles, bytemuck::cast_slice(leaves))?;
        let most_steps = count as u64 + leaves.len() as u64;
        let mut scene = Self { nodes: on_device, triangles, stacks: None, root, most_steps, form, depth, range };
        if form.kernel(depth) == form.deep_kernel() {
            scene.go_deep(device)?;
        }
        device.keep();
        Ok(scene)
    }

    /// From now on rays may take any number of steps: for scenes with [`UNFINISHED`](prbvh_kernel::ray::UNFINISHED) rays. Slower.
    ///
    /// # Errors
    /// If the device has no memory for the stacks.
    pub fn go_deep(&mut self, device: &mut dyn Device) -> Result<(), DeviceError> {
        if self.stacks.is_none() {
            let rows = self.form.rows(self.depth);
            let words = (STACK_BYTES / 4 / rows).max(1) * rows;
            self.stacks = Some(device.allocate("stacks", words, 4)?);
        }
        Ok(())
    }

    /// Whether rays may take any number of steps.
    #[must_use]
    pub fn is_deep(&self) -> bool {
        self.stacks.is_some()
    }

    /// The coordinates on the device.
    #[must_use]
    pub fn range(&self) -> &TraceRange {
        &self.range
    }

    /// Most links between root and leaf, of a wide tree most nodes on a way; as many entries has a stack.
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// The buffers of nodes, [`TraceNode`]s in breadth-first order or those of the [`PackedTree`], and of triangles.
    #[must_use]
    pub fn buffers(&self) -> [&Buffer; 2] {
        [&self.nodes, &self.triangles]
    }

    /// Records the tracing of the first `count` of `rays` into `hits`; both are in the trace range.
    pub fn record(
        &self,
        recording: &mut Recording,
        label: &'static str,
        (rays, hits): (&Buffer, &Buffer),
        count: u32,
        query: Query,
    ) {
        let any = u32::from(query == Query::Any);
        let params = |first, count, resumes| TraceParams { count, first, root: self.root, any, resumes };
        let (nodes, triangles) = (&self.nodes, &self.triangles);
        match &self.stacks {
            None => {
                let params = params(0, count, 0);
                let buffers = [nodes, triangles, rays, hits];
                recording.dispatch(label, self.form.kernel(self.depth), count, &params, &buffers);
            }
            Some(stacks) => {
                let at_once = u32::try_from(stacks.length / self.form.rows(self.depth)).unwrap_or(u32::MAX);
                for first in (0..count).step_by(at_once as usize) {
                    let here = at_once.min(count - first);
                    let buffers = [nodes, triangles, rays, hits, stacks];
                    for part in 0..self.most_steps.div_ceil(STEPS.into()) {
                        let params = params(first, here, u32::from(part > 0));
                        recording.dispatch(label, self.form.deep_kernel(), here, &params, &buffers);
                    }
                }
            }
        }
    }

    /// Gives the memory back.
    pub fn free(self, device: &mut dyn Device) {
        device.free(self.nodes);
        device.free(self.triangles);
        if let Some(stacks) = self.stacks {
            device.free(stacks);
        }
    }
}

/// The coordinates on the device, and the triangles in them.
fn working(device: &dyn Device, triangles: &[Triangle], starts: &[[f32; 3]]) -> (TraceRange, Vec<Triangle>) {
    on_host(device, || {
        let range = TraceRange::of(triangles, starts);
        let working = range.triangles(triangles);
        (range, working)
    })
}

/// Buffers of `nodes` nodes and of the triangles; no buffer may be empty.
fn buffers_of(
    device: &mut dyn Device,
    nodes: usize,
    node_bytes: usize,
    triangles: usize,
) -> Result<[Buffer; 2], DeviceError> {
    Ok([
        device.allocate("trace nodes", nodes.max(1), node_bytes)?,
        device.allocate("trace triangles", triangles, size_of::<TraceTriangle>())?,
    ])
}

fn reserve(device: &mut dyn Device, nodes: usize, node_bytes: usize, triangles: usize) -> Result<(), DeviceError> {
    let device = &mut Lease::new(device);
    buffers_of(device, nodes, node_bytes, triangles).map(|_| ())
}

/// The tree with its own boxes in the trace range, those of pieces: the rays' tests widen boxes by far more than what a corner may be rounded by here.
fn with_boxes_in(tree: &Bvh, range: &TraceRange) -> Bvh {
    let mut tree = tree.clone();
    for node in &mut tree.nodes {
        let Aabb { min, max } = node.aabb;
        node.aabb = Aabb { min: range.point(min), max: range.point(max) };
    }
    tree.with_boxes_of_leaves()
}

impl Layout {
    /// Internal nodes breadth-first, triangles leaf by leaf in the order of the tree.
    pub(super) fn new(tree: &Bvh, triangles: &[Triangle]) -> Self {
        let mut leaves: Vec<TraceTriangle> = tree.triangle_order.iter().map(|&id| packed(id, triangles)).collect();
        let mut order = Vec::new();
        let mut numbers = vec![0u32; tree.nodes.len()];
        let mut level = vec![ROOT];
        while !level.is_empty() {
            let mut below = Vec::new();
            for &v in &level {
                match tree.nodes[v as usize].content {
                    Content::Internal { left, right } => {
                        numbers[v as usize] = order.len() as u32;
                        order.push(v);
                        below.extend([left, right]);
                    }
                    Content::Leaf { first, count } => {
                        numbers[v as usize] = first | LEAF;
                        leaves[(first + count - 1) as usize].is_last = 1;
                    }
                }
            }
            level = below;
        }
        let node = |&v: &u32| match tree.nodes[v as usize].content {
            Content::Internal { left, right } => {
                let aabb = |child: u32| -> Aabb { tree.nodes[child as usize].aabb };
                TraceNode {
                    left_min: aabb(left).min,
                    left: numbers[left as usize],
                    left_max: aabb(left).max,
                    right: numbers[right as usize],
                    right_min: aabb(right).min,
                    unused: 0,
                    right_max: aabb(right).max,
                    also_unused: 0,
                }
            }
            Content::Leaf { .. } => unreachable!("only internal nodes are in the order"),
        };
        Self { nodes: order.iter().map(node).collect(), triangles: leaves, root: numbers[ROOT as usize] }
    }
}

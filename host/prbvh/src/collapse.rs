//! Adaptive leaves: a tree of one triangle per leaf becomes a cheaper one with leaves of several ([`prbvh_kernel::collapse`]).

use crate::build::{DeviceTree, UnfitTree, arrivals_length};
use crate::bvh::{self, Bvh, BvhNode, Content, NO_NODE, SahModel, TreeFault};
use crate::check::{SettingError, at_least_1, must};
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing, read_pieces};
use crate::scene::OutOfRange;
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::collapse::{
    COST, CollapseParams, CompactNode, EmitParams, HEIGHT, LEAF, Place, PlacesParams, REMAINING, SIZE, SUBTREE_WORDS,
};
use prbvh_kernel::node::Node;

/// When a subtree becomes a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct CollapseSettings {
    /// The costs that decide.
    pub sah: SahModel,
    /// Most triangles of a leaf, at least 1; none: no limit.
    pub max_leaf: Option<u32>,
}

impl CollapseSettings {
    /// # Errors
    /// The first field whose value makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        const COST: &str = "a number from 0 to 1000000";
        for (name, value) in [("c_traversal", self.sah.c_traversal), ("c_intersect", self.sah.c_intersect)] {
            must(name, value, (0.0..=1e6).contains(&value), COST)?;
        }
        at_least_1("max_leaf", self.max_leaf.unwrap_or(1))
    }
}

/// A tree with adaptive leaves, on the device and on the host.
#[derive(Debug)]
#[non_exhaustive]
pub struct Collapsed {
    /// The nodes on the device in depth-first order, `[nodes]` [`CompactNode`]s.
    pub nodes: Buffer,
    /// Triangle ids on the device, leaf by leaf, `[n]`.
    pub order: Buffer,
    /// The same tree on the host, node for node.
    pub tree: Bvh,
    /// Root cost that the device decided with, unitless; in f32, so [`bvh::quality()`] of `tree` differs in the last digits.
    pub device_cost: f64,
    /// Time of every command.
    pub timings: Vec<Timing>,
}

impl Collapsed {
    /// Gives the memory of the device back and returns the tree of the host.
    pub fn free(self, device: &mut dyn Device) -> Bvh {
        device.free(self.nodes);
        device.free(self.order);
        self.tree
    }
}

/// Why a tree was not collapsed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CollapseError {
    /// The device refused or failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// What is on the device is no tree.
    #[error("the tree on {device} is broken: {}", bvh::summary(.faults))]
    InvalidTree {
        /// On which device.
        device: String,
        /// All faults.
        faults: Vec<TreeFault>,
    },
    /// A setting makes no sense.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The tree's coordinates are too small or too large.
    #[error(transparent)]
    Range(#[from] OutOfRange),
}

/// Collapses `tree`, whose boxes are right (refitted) and in the safe range, and which stays as it is.
///
/// The tree that comes back has the boxes of `tree`; [`Bvh::with_boxes_of`] gives it those of the original triangles.
///
/// # Errors
/// If a setting makes no sense, [`DeviceTree::check`] finds fault with the tree, or the device fails.
pub fn collapse(
    device: &mut dyn Device,
    tree: &DeviceTree,
    settings: &CollapseSettings,
) -> Result<Collapsed, CollapseError> {
    settings.check()?;
    tree.check(device).map_err(|unfit| match unfit {
        UnfitTree::Device(error) => error.into(),
        UnfitTree::Range(error) => error.into(),
        UnfitTree::Broken { faults } => broken(device, faults),
    })?;
    collapse_sound(device, tree, settings)
}

/// [`collapse`] of a tree that this library made, by settings that were checked.
pub(crate) fn collapse_sound(
    device: &mut dyn Device,
    tree: &DeviceTree,
    settings: &CollapseSettings,
) -> Result<Collapsed, CollapseError> {
    check_words(device, tree)?;
    let device = &mut Lease::new(device);
    let collapsed = Stages { tree, timings: Vec::new() }.run(device, settings)?;
    device.keep();
    Ok(collapsed)
}

fn broken(device: &dyn Device, faults: Vec<TreeFault>) -> CollapseError {
    CollapseError::InvalidTree { device: device.info().name.clone(), faults }
}

/// A word of a subtree has a 32-bit index.
fn check_words(device: &dyn Device, tree: &DeviceTree) -> Result<(), DeviceError> {
    let need = u64::from(DeviceTree::node_count(tree.references)) * u64::from(SUBTREE_WORDS);
    if need > u64::from(u32::MAX) {
        return Err(DeviceError::Limit {
            what: format!("the collapse of {} triangles", tree.references),
            name: "32-bit indices of subtree words",
            need,
            have: u32::MAX.into(),
            device: device.info().name.clone(),
        });
    }
    Ok(())
}

/// Allocates what the collapse of a tree of `references` triangles takes at most, and gives it back: for plans.
pub(crate) fn reserve(device: &mut dyn Device, references: u32) -> Result<(), DeviceError> {
    let device = &mut Lease::new(device);
    let Working { arrivals, places: [_, spare], .. } = Working::allocate(device, references)?;
    device.free(arrivals);
    device.free(spare);
    device.allocate(NODES, DeviceTree::node_count(references) as usize, size_of::<CompactNode>())?;
    device.allocate(ORDER, references as usize, 4)?;
    Ok(())
}

const NODES: &str = "collapsed nodes";
const ORDER: &str = "triangle order";

/// Buffers that no collapsed tree keeps.
struct Working {
    subtrees: Buffer,
    arrivals: Buffer,
    places: [Buffer; 2],
}

impl Working {
    fn allocate(device: &mut dyn Device, references: u32) -> Result<Self, DeviceError> {
        let length = DeviceTree::node_count(references) as usize;
        let mut buffer = |label, length, bytes| device.allocate(label, length, bytes);
        Ok(Self {
            subtrees: buffer("subtrees", length * SUBTREE_WORDS as usize, 4)?,
            arrivals: buffer("arrivals", arrivals_length(references), 4)?,
            places: [buffer("places", length, size_of::<Place>())?, buffer("places", length, size_of::<Place>())?],
        })
    }
}

struct Stages<'a> {
    tree: &'a DeviceTree,
    timings: Vec<Timing>,
}

impl Stages<'_> {
    fn run(mut self, device: &mut dyn Device, settings: &CollapseSettings) -> Result<Collapsed, CollapseError> {
        let count = DeviceTree::node_count(self.tree.references);
        let Working { subtrees, arrivals, places } = Working::allocate(device, self.tree.references)?;
        let root = self.sizes(device, settings, [&subtrees, &arrivals])?;
        device.free(arrivals);
        let [places, spare] = self.places(device, count, (&subtrees, places), root[HEIGHT as usize])?;
        device.free(spare);

        let remaining = root[REMAINING as usize] as usize;
        let nodes = device.allocate(NODES, remaining, size_of::<CompactNode>())?;
        let order = device.allocate(ORDER, self.tree.references as usize, 4)?;
        self.emit(device, count, [&subtrees, &places], [&nodes, &order])?;
        device.free(subtrees);
        device.free(places);
        let tree = read(device, &nodes, &order)?;
        let device_cost = self.device_cost(device, root[COST as usize])?;
        Ok(Collapsed { nodes, order, tree, device_cost, timings: self.timings })
    }

    /// Sizes and decisions; returns the words of the root.
    fn sizes(
        &mut self,
        device: &mut dyn Device,
        settings: &CollapseSettings,
        [subtrees, arrivals]: [&Buffer; 2],
    ) -> Result<[u32; SUBTREE_WORDS as usize], CollapseError> {
        let n = self.tree.references;
        let params = CollapseParams {
            count: n,
            c_traversal: settings.sah.c_traversal as f32,
            c_intersect: settings.sah.c_intersect as f32,
            max_leaf: settings.max_leaf.unwrap_or(u32::MAX),
        };
        let mut recording = Recording::new();
        recording.clear("collapse", arrivals);
        recording.dispatch("collapse", Kernel::CollapseSizes, n, &params, &[&self.tree.nodes, subtrees, arrivals]);
        let mut root = [0; SUBTREE_WORDS as usize];
        recording.fetch("collapse", subtrees, size_of_val(&root));
        self.timings.extend(device.run(&recording)?);
        device.download(subtrees, bytemuck::cast_slice_mut(&mut root))?;
        if root[SIZE as usize] & !LEAF != n {
            // Not every leaf hangs below the root.
            let faults = self.tree.decode(device, 0)?.err().unwrap_or_default();
            return Err(broken(device, faults));
        }
        Ok(root)
    }

    /// The places of all nodes, and the buffer that is free again; `height` links at most lie between the root and a leaf.
    fn places(
        &mut self,
        device: &mut dyn Device,
        count: u32,
        (subtrees, [mut from, mut to]): (&Buffer, [Buffer; 2]),
        height: u32,
    ) -> Result<[Buffer; 2], CollapseError> {
        let params = PlacesParams { count };
        let mut recording = Recording::new();
        let buffers = [&self.tree.nodes, subtrees, &from];
        recording.dispatch("collapse", Kernel::CollapsePlaces, count, &params, &buffers);
        let mut reach = 1;
        while reach < height {
            recording.dispatch("collapse", Kernel::CollapseJump, count, &params, &[&from, &to]);
            std::mem::swap(&mut from, &mut to);
            reach *= 2;
        }
        self.timings.extend(device.run(&recording)?);
        Ok([from, to])
    }

    fn emit(
        &mut self,
        device: &mut dyn Device,
        count: u32,
        [subtrees, places]: [&Buffer; 2],
        [nodes, order]: [&Buffer; 2],
    ) -> Result<(), CollapseError> {
        let mut recording = Recording::new();
        let buffers = [&self.tree.nodes, subtrees, places, nodes, order];
        recording.dispatch("collapse", Kernel::CollapseEmit, count, &EmitParams { count }, &buffers);
        self.timings.extend(device.run(&recording)?);
        Ok(())
    }

    /// Cost of the root in the unit of [`bvh::quality()`].
    fn device_cost(&self, device: &mut dyn Device, bits: u32) -> Result<f64, CollapseError> {
        let mut root: [Node; 1] = bytemuck::Zeroable::zeroed();
        device.download(&self.tree.nodes, bytemuck::cast_slice_mut(&mut root))?;
        let cost = f64::from(f32::from_bits(bits));
        let area = root[0].aabb().half_area();
        // The unit of the kernel: the root's area, its exponent taken away.
        let unit =
            if area > 0.0 { f64::from(f32::from_bits((area.to_bits() & 0x007f_ffff) | 0x3f80_0000)) } else { 1.0 };
        Ok(cost / unit)
    }
}

/// The tree with its parents; ids stay.
fn read(device: &mut dyn Device, compact: &Buffer, order: &Buffer) -> Result<Bvh, DeviceError> {
    let mut nodes: Vec<BvhNode> = Vec::with_capacity(compact.length);
    read_pieces(device, compact, |piece: &[CompactNode]| {
        for node in piece {
            let content = match node.count {
                0 => Content::Internal { left: nodes.len() as u32 + 1, right: node.first },
                count => Content::Leaf { first: node.first, count },
            };
            nodes.push(BvhNode { aabb: Aabb { min: node.min, max: node.max }, parent: NO_NODE, content });
        }
    })?;
    for v in 0..nodes.len() {
        if let Content::Internal { left, right } = nodes[v].content {
            for child in [left, right] {
                if let Some(child) = nodes.get_mut(child as usize) {
                    child.parent = v as u32;
                }
            }
        }
    }
    let mut triangle_order = vec![0u32; order.length];
    device.download(order, bytemuck::cast_slice_mut(&mut triangle_order))?;
    Ok(Bvh { nodes, triangle_order })
}

//! The wide tree of least cost that a binary tree can become.
//!
//! Source: Ylitie, Karras & Laine 2017, §3.1. Of each subtree, from the leaves up, is known what it costs at least as a forest of a few roots: the kernel
//! [`widen`](prbvh_kernel::collapse::widen::widen) says it of all on a device, or its [`join`] of one after another here, with the same bits. From the choices that are left the tree is
//! read off from the root down.

use super::emit::Fate;
use super::settings::WideSettings;
use crate::build::arrivals_length;
use crate::bvh::{Bvh, Content, EncodeError, ROOT};
use crate::collapse::CollapseError;
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing, on_host, read_pieces};
use crate::scene::SafeRange;
use prbvh_kernel::Kernel;
use prbvh_kernel::collapse::area::{area_scale, relative_area};
use prbvh_kernel::collapse::widen::{Forest, IS_LEAF, IS_LEAF_AT_ROOT, WidenParams, join, left_roots};
use prbvh_kernel::node::Node;
use std::convert::Infallible;

/// Label of its commands.
const LABEL: &str = "wide";

/// What becomes of each node, computed here.
pub(super) fn fates(tree: &Bvh, settings: &WideSettings) -> Vec<Fate> {
    let walk = tree.preorder();
    let nodes = working_nodes(tree, &walk);
    let params = params(settings, nodes.len());
    let scale = area_scale(nodes[ROOT as usize].aabb().half_area());
    let internal = nodes.len() / 2;
    let mut choices = vec![0; internal];
    let mut below: Vec<Forest> = Vec::new();
    // Backward, children come before their parents, and the right one before the left one.
    let (mut inner, mut leaf) = (internal, nodes.len());
    for &v in walk.iter().rev() {
        let is_leaf = matches!(tree.nodes[v as usize].content, Content::Leaf { .. });
        let next = if is_leaf { &mut leaf } else { &mut inner };
        *next -= 1;
        let node = &nodes[*next];
        let area = relative_area(node, scale);
        let forest = if is_leaf {
            Forest::leaf(&params, area, node.down)
        } else {
            let (Some(left), Some(right)) = (below.pop(), below.pop()) else {
                unreachable!("children come before their parent")
            };
            let (joined, choice) = join(&params, area, &left, &right);
            choices[inner] = choice;
            joined
        };
        below.push(forest);
    }
    chosen(tree, &walk, settings, &choices)
}

/// What becomes of each node, computed on a device.
pub(super) fn fates_on(
    device: &mut dyn Device,
    tree: &Bvh,
    settings: &WideSettings,
) -> Result<(Vec<Fate>, Vec<Timing>), CollapseError> {
    let walk = checked_walk(device, tree)?;
    let nodes = on_host(device, || working_nodes(tree, &walk));
    let device = &mut Lease::new(device);
    let leaves = nodes.len().div_ceil(2);
    let Working { nodes: buffer, forests, choices, arrivals } = Working::allocate(device, leaves, settings)?;
    device.upload(&buffer, bytemuck::cast_slice(&nodes))?;
    let params = params(settings, nodes.len());
    drop(nodes);
    let mut recording = Recording::new();
    recording.clear(LABEL, &arrivals);
    let buffers = [&buffer, &forests, &choices, &arrivals];
    recording.dispatch(LABEL, Kernel::CollapseWiden, params.count, &params, &buffers);
    let timings = device.run(&recording)?;
    let mut chosen_words: Vec<u32> = Vec::with_capacity(choices.length);
    read_pieces(device, &choices, |piece: &[u32]| chosen_words.extend_from_slice(piece))?;
    Ok((on_host(device, || chosen(tree, &walk, settings, &chosen_words)), timings))
}

/// The nodes as a depth-first walk meets them.
///
/// # Errors
/// [`CollapseError::InvalidTree`].
pub(super) fn checked_walk(device: &dyn Device, tree: &Bvh) -> Result<Vec<u32>, CollapseError> {
    on_host(device, || tree.preorder_checked()).map_err(|error| match error {
        EncodeError::Broken { faults } => CollapseError::InvalidTree { device: device.info().name.clone(), faults },
        EncodeError::LeafSize { .. } => unreachable!("leaves have any size here"),
    })
}

/// Allocates what the collapse of a tree of so many leaves takes, and gives it back: for plans.
pub(super) fn reserve(device: &mut dyn Device, leaves: usize, settings: &WideSettings) -> Result<(), DeviceError> {
    let device = &mut Lease::new(device);
    Working::allocate(device, leaves, settings)?;
    Ok(())
}

/// What there is on a device.
struct Working {
    nodes: Buffer,
    forests: Buffer,
    choices: Buffer,
    arrivals: Buffer,
}

impl Working {
    fn allocate(device: &mut dyn Device, leaves: usize, settings: &WideSettings) -> Result<Self, DeviceError> {
        let internal = leaves as u64 - 1;
        let need = internal * settings.width.get() as u64;
        if need > u64::from(u32::MAX) {
            return Err(DeviceError::Limit {
                what: format!("the wide tree of {leaves} leaves"),
                name: "32-bit indices of the words of subtrees",
                need,
                have: u32::MAX.into(),
                device: device.info().name.clone(),
            });
        }
        let count = u32::try_from(leaves).expect("fewer than words");
        let mut buffer = |label, length: usize, bytes| device.allocate(label, length.max(1), bytes);
        Ok(Self {
            nodes: buffer("nodes", 2 * leaves - 1, size_of::<Node>())?,
            forests: buffer("forests", need as usize, 4)?,
            choices: buffer("choices", internal as usize, 4)?,
            arrivals: buffer("arrivals", arrivals_length(count), 4)?,
        })
    }
}

pub(super) fn params(settings: &WideSettings, nodes: usize) -> WidenParams {
    let model = settings.costs();
    WidenParams {
        count: nodes.div_ceil(2) as u32,
        width: settings.width.get() as u32,
        c_traversal: model.c_traversal as f32,
        c_intersect: model.c_intersect as f32,
        max_leaf: settings.most_of_a_leaf(),
    }
}

/// The nodes as [`Bvh::to_device`] numbers them, boxes in working coordinates, with a leaf's number of triangles in `down`.
fn working_nodes(tree: &Bvh, walk: &[u32]) -> Vec<Node> {
    let range = SafeRange::of_box(&tree.nodes[ROOT as usize].aabb);
    let Ok(mut nodes) = tree.threaded(walk, |_, _, count| Ok::<_, Infallible>(count));
    for node in &mut nodes {
        let aabb = range.apply_to_box(&node.aabb());
        (node.min, node.max) = (aabb.min, aabb.max);
    }
    nodes
}

/// What becomes of each node, by the choices of the internal ones in the order of the walk.
fn chosen(tree: &Bvh, walk: &[u32], settings: &WideSettings, choices: &[u32]) -> Vec<Fate> {
    let width = settings.width.get() as u32;
    let mut choice_of = vec![IS_LEAF | IS_LEAF_AT_ROOT; tree.nodes.len()];
    let is_internal = |v: &&u32| matches!(tree.nodes[**v as usize].content, Content::Internal { .. });
    for (&v, &choice) in walk.iter().filter(is_internal).zip(choices) {
        choice_of[v as usize] = choice;
    }
    let mut fates = vec![Fate::Gone; tree.nodes.len()];
    // The root is a node in any case, which pays when its children cost less than a leaf in it.
    let is_leaf = choice_of[ROOT as usize] & IS_LEAF_AT_ROOT != 0;
    fates[ROOT as usize] = if is_leaf { Fate::Leaf } else { Fate::Node };
    let mut stack = Vec::new();
    // A node's children are a forest of as many roots as the width; a root asks for its own as one of 1.
    let open = |stack: &mut Vec<(u32, u32)>, v: u32, roots: u32| {
        if let Content::Internal { left, right } = tree.nodes[v as usize].content {
            let of_left = left_roots(choice_of[v as usize], roots);
            let all = if roots == 1 { width } else { roots };
            stack.extend([(right, all - of_left), (left, of_left)]);
        }
    };
    if !is_leaf {
        open(&mut stack, ROOT, 1);
    }
    while let Some((v, mut roots)) = stack.pop() {
        let choice = choice_of[v as usize];
        while roots > 1 && left_roots(choice, roots) == 0 {
            roots -= 1;
        }
        if roots > 1 {
            open(&mut stack, v, roots);
        } else if choice & IS_LEAF != 0 {
            fates[v as usize] = Fate::Leaf;
        } else {
            fates[v as usize] = Fate::Node;
            open(&mut stack, v, 1);
        }
    }
    fates
}

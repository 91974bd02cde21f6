//! The top of a tree, built anew.
//!
//! Where reinsertions end is a minimum of theirs, and which one is decided by a few nodes near the root. These are few: the *top* is the nodes of more
//! than a given area, and what hangs below counts as its leaves. Over those another tree is built and optimised, as if each were a triangle with the same
//! box, which takes some milliseconds whatever the size of the scene. The best of several such tops replaces the old one if it has less area.

use super::session::{Observe, Outcome, Session};
use super::{Limits, PrbvhSettings, TreeAreas, WorstFirst};
use crate::build::{self, CodeCensus, DeviceTree, MortonBits, Scratch};
use crate::device::{Buffer, Device, DeviceError, Recording, on_host, read_pieces};
use crate::scene::stand_in;
use bytemuck::Zeroable;
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::kept::Kept;
use prbvh_kernel::node::{Node, ROOT};
use prbvh_kernel::prbvh::worst::keys::{COLD, ON_FRINGE};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::sort::GatherParams;
use std::ops::ControlFlow;

/// Words of a node.
const NODE_WORDS: u32 = (size_of::<Node>() / 4) as u32;
/// No number of a best tree.
const GRAFTED: u32 = u32::MAX;

/// What became of the top of a tree.
#[derive(Clone, Debug, Default)]
pub(super) struct NewTop {
    /// What puts it in place.
    pub(super) graft: Recording,
    /// Half area that the tree lost.
    pub(super) decrease: f64,
    /// Nodes that the searches for the new tops looked at.
    pub(super) visits: u32,
}

/// Optimises a tree in place.
pub(super) type Optimise =
    fn(&mut dyn Device, &DeviceTree, Option<TreeAreas>, &PrbvhSettings, Observe<'_>) -> Result<Outcome, DeviceError>;

/// A top of less area for the tree, if it finds one, and boxes made anew. The keys tell which nodes are the top: those that have
/// been unfolded.
pub(super) fn renew(
    session: &mut Session<'_>,
    device: &mut dyn Device,
    keys: &Buffer,
    settings: &PrbvhSettings,
    optimise: Optimise,
) -> Result<NewTop, DeviceError> {
    let top = Top::read(session, device, keys)?;
    let mut renewed = NewTop::default();
    if top.leaves.len() != top.nodes.len() + 1 {
        return Ok(renewed);
    }
    // The first of equally good ones.
    let mut best = (top.area * (1.0 - settings.worst_first.settles), None);
    for start in [Start::Lbvh, Start::SahBinned] {
        if settings.limits.is_stopped() {
            break;
        }
        let (nodes, visits) = top.optimised(session, device, start, settings, optimise)?;
        renewed.visits = renewed.visits.saturating_add(visits);
        let area = area(&nodes[..nodes.len() / 2]);
        if area < best.0 {
            best = (area, Some(nodes));
        }
    }
    if let (area, Some(nodes)) = best {
        session.moves.replace_kept(device, &top.children(&nodes, session.internal))?;
        session.record_restore(&mut renewed.graft, GRAFTED);
        renewed.decrease = top.area - area;
    }
    Ok(renewed)
}

/// How a new top begins. That they differ is the point of them.
#[derive(Clone, Copy, Debug)]
enum Start {
    Lbvh,
    SahBinned,
}

/// The top of a tree, and what hangs below it.
#[derive(Debug)]
struct Top {
    /// Its nodes, upward by number: first the root.
    nodes: Vec<u32>,
    /// Their half areas together.
    area: f64,
    /// Children that are not among them.
    leaves: Vec<u32>,
    /// A triangle in the box of each leaf.
    triangles: Vec<Triangle>,
}

impl Top {
    fn read(session: &mut Session<'_>, device: &mut dyn Device, keys: &Buffer) -> Result<Self, DeviceError> {
        let (mut nodes, mut v) = (Vec::new(), ROOT);
        read_pieces(device, keys, |keys: &[u32]| {
            for &key in keys {
                if key != COLD && key != ON_FRINGE {
                    nodes.push(v);
                }
                v += 1;
            }
        })?;
        let own = gathered(session, device, &nodes)?;
        let left: Vec<u32> = own.iter().map(|node| node.down).collect();
        let of_left = gathered(session, device, &left)?;
        let right: Vec<u32> = of_left.iter().map(|node| node.up).collect();
        let of_right = gathered(session, device, &right)?;
        let children = left.into_iter().zip(of_left).chain(right.into_iter().zip(of_right));
        let below = children.filter(|(v, _)| nodes.binary_search(v).is_err());
        let (leaves, boxes): (Vec<u32>, Vec<Node>) = below.unzip();
        let triangles = boxes.iter().map(|node| stand_in(&node.aabb())).collect();
        Ok(Self { area: area(&own), nodes, leaves, triangles })
    }

    /// Another top over the same leaves, as a tree of its own, and how many nodes the searches looked at.
    fn optimised(
        &self,
        session: &mut Session<'_>,
        device: &mut dyn Device,
        start: Start,
        settings: &PrbvhSettings,
        optimise: Optimise,
    ) -> Result<(Vec<Node>, u32), DeviceError> {
        let triangles = &self.triangles;
        let tree = match start {
            Start::Lbvh => {
                let all = triangles.iter().fold(Aabb::EMPTY, |all, triangle| all.union(triangle.aabb()));
                let census = on_host(device, || CodeCensus::of(triangles, all.min, all.max));
                let codes = census.enough(MortonBits::default());
                let (tree, timings) = build::lbvh(device, triangles, codes)?;
                session.take_note(timings);
                tree
            }
            Start::SahBinned => {
                let nodes = on_host(device, || build::sah_binned(triangles));
                DeviceTree::upload(device, &nodes)?
            }
        };
        let max_time = settings.limits.max_time.map(|limit| limit.saturating_sub(session.elapsed()));
        let settings = PrbvhSettings {
            worst_first: WorstFirst { top: 0, ..settings.worst_first },
            limits: Limits {
                max_time,
                stop: settings.limits.stop.clone(),
                ..Limits::iterations(settings.limits.max_iterations)
            },
            ..settings.clone()
        };
        let mut visits = 0u32;
        let done = optimise(device, &tree, None, &settings, &mut |row, _, _| {
            visits = visits.saturating_add(row.visits);
            ControlFlow::Continue(())
        })
        .and_then(|outcome| Ok((outcome, tree.download(device)?)));
        tree.free(device);
        let (outcome, nodes) = done?;
        session.take_note(outcome.timings);
        Ok((nodes, visits))
    }

    /// The children that the nodes of the top have in another one.
    fn children(&self, other: &[Node], internal: u32) -> Vec<Kept> {
        let mut kept = vec![Kept::zeroed(); internal as usize];
        let place = |v: u32| match self.nodes.get(v as usize) {
            Some(&node) => node,
            None => self.leaves[other[v as usize].down as usize],
        };
        for (&node, new) in self.nodes.iter().zip(other) {
            let (left, right) = (new.down, other[new.down as usize].up);
            kept[node as usize] = Kept { epoch: GRAFTED, left: place(left), right: place(right) };
        }
        kept
    }
}

/// Sum of the half areas.
fn area(nodes: &[Node]) -> f64 {
    nodes.iter().map(|node| f64::from(node.aabb().half_area())).sum()
}

/// Some nodes of the tree.
fn gathered(session: &mut Session<'_>, device: &mut dyn Device, nodes: &[u32]) -> Result<Vec<Node>, DeviceError> {
    let words: Vec<u32> = nodes.iter().flat_map(|v| (0..NODE_WORDS).map(move |word| v * NODE_WORDS + word)).collect();
    let mut read = vec![Node::zeroed(); nodes.len()];
    let mut scratch = Scratch::default();
    let order = scratch.allocate(device, "words of nodes", words.len().max(1), 4)?;
    let gathered = scratch.allocate(device, "gathered nodes", words.len().max(1), 4)?;
    if !words.is_empty() {
        device.upload(&order, bytemuck::cast_slice(&words))?;
        let mut recording = Recording::new();
        let count = words.len() as u32;
        let buffers = [&order, &session.tree.nodes.as_words(), &gathered];
        recording.dispatch("read top", Kernel::SortGather, count, &GatherParams { count }, &buffers);
        recording.fetch("read top", &gathered, 4 * words.len());
        session.submit(device, &recording)?;
        device.download(&gathered, bytemuck::cast_slice_mut(&mut read))?;
    }
    scratch.free(device);
    Ok(read)
}

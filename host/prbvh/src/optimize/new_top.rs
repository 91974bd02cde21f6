//! The top of a tree, built anew.
//!
//! Where reinsertions end is a minimum of theirs, and which one is decided by a few nodes near the root. These are few: the *top* is the nodes of more
//! than a given area, and what hangs below counts as its leaves. Over those other trees are built and optimised, as if each leaf were a triangle with the same
//! box, which takes some hundredths of a second whatever the size of the scene. The best of several such tops replaces the old one if it has less area.

use super::contenders::{Contender, contenders};
use super::lists::{Lists, top_buffer};
use super::search::of;
use super::session::Session;
use super::{Limits, PrbvhSettings};
use crate::build::Scratch;
use crate::device::{Buffer, Device, DeviceError, Recording, Timing};
use crate::scene::stand_in;
use bytemuck::Zeroable;
use prbvh_kernel::kept::Graft;
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{LIST_LENGTH, MOST_STAGES};
use prbvh_kernel::prbvh::worst::top::TopNode;
use prbvh_kernel::setup::Triangle;
use std::time::Instant;

/// As many times the nodes that a top should have there is room for on the first look: the last stage that unfolds may bring more than were missing.
const ROOM: u32 = 4;

/// What became of the top of a tree.
#[derive(Debug, Default)]
pub(super) struct NewTop {
    /// The children that nodes have in a better one.
    pub(super) grafts: Option<Buffer>,
    /// Half area that the tree lost.
    pub(super) decrease: f64,
    /// Nodes that the searches for the new tops looked at.
    pub(super) visits: u32,
}

/// A top of less area for the tree, if there is one. `first` goes before all that is recorded; `params` say how many nodes the top should have.
pub(super) fn renew(
    session: &mut Session<'_>,
    device: &mut dyn Device,
    first: Recording,
    (lists, params): (&Lists, &RoundParams),
    settings: &PrbvhSettings,
) -> Result<NewTop, DeviceError> {
    let top = Top::read(session, device, first, lists, params)?;
    let mut renewed = NewTop::default();
    if top.leaves.len() != top.nodes.len() + 1 || settings.limits.is_stopped() {
        return Ok(renewed);
    }
    // The first of equally good ones.
    let mut best = (top.area * (1.0 - settings.worst_first.settles), None);
    let start = Instant::now();
    for Contender { nodes, visits } in top.contenders(session, device, settings)? {
        renewed.visits = renewed.visits.saturating_add(visits);
        let area = area(&nodes[..nodes.len() / 2]);
        if area < best.0 {
            best = (area, Some(nodes));
        }
    }
    session.take_note_of_host(device.info().kind, Timing { label: "new top", seconds: start.elapsed().as_secs_f64() });
    if let (area, Some(nodes)) = best {
        let grafts = top.grafts(&nodes);
        let buffer = session.scratch.allocate(device, "grafts", grafts.len(), size_of::<Graft>())?;
        device.upload(&buffer, bytemuck::cast_slice(&grafts))?;
        renewed.grafts = Some(buffer);
        renewed.decrease = top.area - area;
    }
    Ok(renewed)
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
    fn read(
        session: &mut Session<'_>,
        device: &mut dyn Device,
        mut recording: Recording,
        lists: &Lists,
        params: &RoundParams,
    ) -> Result<Self, DeviceError> {
        let mut scratch = Scratch::default();
        let room = params.next[0].saturating_mul(ROOM).min(session.internal);
        let buffer = top_buffer(device, &mut scratch, room)?;
        recording.clear("select", &session.moves.report);
        lists.record_forget(&mut recording);
        lists.record_top(of(session), &mut recording, params, MOST_STAGES + 1, &buffer);
        let books = &session.moves.books;
        recording.fetch("read top", books, 4 * (LIST_LENGTH + 1));
        session.submit(device, &recording)?;
        let mut words = [0u32; LIST_LENGTH + 1];
        device.download(&session.moves.books, bytemuck::cast_slice_mut(&mut words))?;
        let length = words[LIST_LENGTH] as usize;
        let mut top: Vec<TopNode> = Vec::with_capacity(length);
        while top.len() < length {
            if !top.is_empty() {
                let mut recording = Recording::new();
                lists.record_more_of_top(of(session), &mut recording, top.len() as u32, &buffer);
                session.submit(device, &recording)?;
            }
            let first = top.len();
            top.resize(length.min(first + buffer.length), TopNode::zeroed());
            device.download(&buffer, bytemuck::cast_slice_mut(&mut top[first..]))?;
        }
        scratch.free(device);

        top.sort_unstable_by_key(|node| node.v);
        let nodes: Vec<u32> = top.iter().map(|node| node.v).collect();
        let left = top.iter().map(|node| (node.children[0], &node.left));
        let right = top.iter().map(|node| (node.children[1], &node.right));
        let below = left.chain(right).filter(|(v, _)| nodes.binary_search(v).is_err());
        let (leaves, triangles) = below.map(|(v, node)| (v, stand_in(&node.aabb()))).unzip();
        let area = top.iter().map(|node| half_area(&node.node)).sum();
        Ok(Self { area, nodes, leaves, triangles })
    }

    /// Other tops over the same leaves, as trees of their own.
    fn contenders(
        &self,
        session: &Session<'_>,
        device: &dyn Device,
        settings: &PrbvhSettings,
    ) -> Result<[Contender; 2], DeviceError> {
        let left = settings.limits.max_time.map(|limit| limit.saturating_sub(session.elapsed()));
        let until = left.and_then(|left| Instant::now().checked_add(left));
        let stop = settings.limits.stop.clone();
        let settings = PrbvhSettings {
            worst_first: settings.worst_first,
            limits: Limits { stop, ..Limits::iterations(settings.limits.max_iterations) },
            ..PrbvhSettings::default()
        };
        contenders(device, &self.triangles, &settings, until)
    }

    /// The children that the nodes of the top have in another one.
    fn grafts(&self, other: &[Node]) -> Vec<Graft> {
        let place = |v: u32| match self.nodes.get(v as usize) {
            Some(&node) => node,
            None => self.leaves[other[v as usize].down as usize],
        };
        let children = |new: &Node| (place(new.down), place(other[new.down as usize].up));
        let grafts = self.nodes.iter().zip(other).map(|(&node, new)| {
            let (left, right) = children(new);
            Graft { node, left, right }
        });
        grafts.collect()
    }
}

fn half_area(node: &Node) -> f64 {
    f64::from(node.aabb().half_area())
}

/// Sum of the half areas.
fn area(nodes: &[Node]) -> f64 {
    nodes.iter().map(half_area).sum()
}

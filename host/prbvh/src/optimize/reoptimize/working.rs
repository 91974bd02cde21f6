//! The buffers that live from frame to frame, and what is recorded over them.

use super::super::areas::Measure;
use super::super::ledger::Report;
use super::super::lists::{FIRST_STAGES, Lists, Of, Trial};
use super::super::moves::Moves;
use super::super::rotations::record_rotations;
use super::super::{TreeAreas, WorstFirst};
use super::Shapes;
use crate::build::{DeviceTree, Scratch};
use crate::device::{Buffer, Device, DeviceError, DeviceKind, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::lbvh::LeavesParams;
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::refit::RefitParams;
use prbvh_kernel::rotations::{COUSINS, Offer, RotateParams};
use prbvh_kernel::setup::BoxesParams;
use prbvh_kernel::status::REPORT_WORDS;
use prbvh_kernel::subtrees::{SubtreesParams, TO_LEAVES};
use prbvh_kernel::sum::scale_of;

/// One in so many nodes is offered a rotation in a frame, in turn; a power of two.
const OFFERED: u32 = 8;
/// Nodes of at least this part of the root's area, as it was in the last frame, are in every frame.
const ALWAYS_OFFERED: f32 = 1.0 / 1024.0;
/// As many times the nodes of a round should be in the pool. A frame has small rounds, in which one thread looks at the keys: with more they take as long as the
/// searches.
const POOL: u32 = 4;
/// Leaves of a subtree that is worth an invocation, where there are few threads.
const LEAVES_OF_A_SUBTREE: u32 = 64;
/// Most levels above these subtrees.
const MOST_LEVELS: u32 = 12;
/// So many levels are one subtree.
const FEW_LEVELS: u32 = 6;

/// The tree, and everything that a frame needs.
#[derive(Debug)]
pub(super) struct Working {
    pub(super) tree: DeviceTree,
    scratch: Scratch,
    moves: Moves,
    measure: Measure,
    lists: Lists,
    /// Boxes of the primitives, and the primitive of each leaf.
    boxes: Buffer,
    order: Buffer,
    root_area: f32,
    scale: f32,
    /// Whether boxes are made by whole subtrees; else by a climb. Both make the same.
    by_subtrees: bool,
    /// Refits.
    turn: u32,
}

impl Working {
    /// Puts a tree on the device, with room for so many rounds at once.
    pub(super) fn new(device: &mut dyn Device, nodes: &[Node], rounds: u32) -> Result<Self, DeviceError> {
        let tree = DeviceTree::upload(device, nodes)?;
        let mut scratch = Scratch::default();
        let internal = tree.references - 1;
        let moves = Moves::new(device, &mut scratch, &tree, internal as usize, REPORT_WORDS * rounds)?;
        let measure = Measure::new(device, &mut scratch, &tree, &moves.report)?;
        let lists = Lists::new(device, &mut scratch, internal)?;
        let is_cpu = device.info().kind == DeviceKind::Cpu;
        let length = tree.references as usize;
        let mut buffer = |label, element_bytes| scratch.allocate(&mut *device, label, length, element_bytes);
        let working = Self {
            lists,
            boxes: buffer("boxes", size_of::<Aabb>())?,
            order: buffer("order", 4)?,
            tree,
            scratch,
            moves,
            measure,
            root_area: 0.0,
            scale: 0.0,
            by_subtrees: is_cpu,
            turn: 0,
        };
        let order: Vec<u32> = nodes[internal as usize..].iter().map(|leaf| leaf.down).collect();
        device.upload(&working.order, bytemuck::cast_slice(&order))?;
        Ok(working)
    }

    fn internal(&self) -> u32 {
        self.tree.references - 1
    }

    /// Takes the boxes of other shapes, which the next refit gives the leaves; false if one of these is not finite or inverted.
    pub(super) fn take(&self, device: &mut dyn Device, shapes: Shapes<'_>) -> Result<bool, DeviceError> {
        let mut are_good = true;
        let bytes = self.boxes.bytes() as usize;
        device.upload_with(&self.boxes, bytes, &mut |first, boxes| {
            are_good &= shapes.write(first / size_of::<Aabb>(), bytemuck::cast_slice_mut(boxes));
        })?;
        Ok(are_good)
    }

    /// Records the same of as many triangles that are on the device.
    pub(super) fn record_take(&self, recording: &mut Recording, triangles: &Buffer) {
        let params = BoxesParams { count: self.tree.references };
        recording.dispatch("boxes", Kernel::SetupBoxes, params.count, &params, &[triangles, &self.boxes]);
    }

    /// Makes all boxes anew after what was recorded, and rotates on the way up if `rotates`; returns the root's.
    pub(super) fn refit(
        &mut self,
        device: &mut dyn Device,
        mut recording: Recording,
        rotates: bool,
    ) -> Result<Aabb, DeviceError> {
        self.turn = self.turn.wrapping_add(1);
        if self.by_subtrees {
            self.record_subtrees(&mut recording, rotates);
        } else {
            self.record_climb(&mut recording, rotates);
        }
        recording.fetch("refit", &self.tree.nodes, size_of::<Node>());
        device.run(&recording)?;
        let mut root = [bytemuck::Zeroable::zeroed()];
        device.download(&self.tree.nodes, bytemuck::cast_slice_mut::<Node, u8>(&mut root))?;
        let root = root[0].aabb();
        self.root_area = root.half_area();
        self.scale = scale_of(self.root_area.into());
        Ok(root)
    }

    /// Who is offered a rotation in this frame.
    fn offer(&self) -> Offer {
        Offer { mask: OFFERED - 1, turn: self.turn, area: self.root_area * ALWAYS_OFFERED }
    }

    /// Records a refit by whole subtrees, from the bottom ones up to that of the root.
    fn record_subtrees(&self, recording: &mut Recording, rotates: bool) {
        let references = self.tree.references;
        let deepest = (references / LEAVES_OF_A_SUBTREE).max(1).ilog2().min(MOST_LEVELS);
        let mut last = TO_LEAVES;
        let mut first = deepest;
        while last > 0 {
            let params = SubtreesParams {
                count: 1 << first,
                references,
                first,
                last,
                rotates: rotates.into(),
                flags: COUSINS,
                offer: self.offer(),
            };
            let buffers = [&self.boxes, &self.tree.nodes, &self.moves.report];
            recording.dispatch("refit", Kernel::SubtreesRefit, params.count, &params, &buffers);
            (first, last) = (if first > FEW_LEVELS { first / 2 } else { 0 }, first);
        }
    }

    /// Records a refit by a climb, over arrivals that are clear before and after.
    fn record_climb(&mut self, recording: &mut Recording, rotates: bool) {
        let (count, nodes, arrivals) = (self.tree.references, &self.tree.nodes, &self.measure.arrivals);
        let buffers = [&self.order, &self.boxes, nodes];
        recording.dispatch("refit", Kernel::LbvhLeaves, count, &LeavesParams { count }, &buffers);
        if rotates {
            let params = RotateParams { count, flags: COUSINS, offer: self.offer(), ..bytemuck::Zeroable::zeroed() };
            let buffers = (&self.moves.kept, &self.moves.report);
            record_rotations(recording, nodes, arrivals, buffers, params);
        } else {
            recording.dispatch("refit", Kernel::Refit, count, &RefitParams { count }, &[nodes, arrivals]);
        }
        self.measure.record_no_arrivals(recording);
    }

    /// The sums of the areas.
    pub(super) fn areas(&mut self, device: &mut dyn Device) -> Result<TreeAreas, DeviceError> {
        Ok(self.measure.areas(device, Recording::new())?.0)
    }

    fn params(&self, wanted: u32, round: u32) -> RoundParams {
        RoundParams {
            count: self.internal(),
            nodes: DeviceTree::node_count(self.tree.references),
            root_area: self.root_area,
            scale: self.scale,
            row: round * REPORT_WORDS,
            ..bytemuck::Zeroable::zeroed()
        }
        .wanting(wanted, wanted.saturating_mul(POOL))
    }

    /// Runs rounds that search so many nodes each; if `begins`, a new walk from the top of the tree comes before. Returns the report of each round.
    pub(super) fn rounds(
        &self,
        device: &mut dyn Device,
        settings: &WorstFirst,
        begins: bool,
        (rounds, wanted): (u32, u32),
    ) -> Result<Vec<Report>, DeviceError> {
        let mut recording = Recording::new();
        recording.clear("select", &self.moves.report);
        let of = Of { nodes: &self.tree.nodes, ways: &self.measure.arrivals, moves: &self.moves };
        let WorstFirst { climb, slack, lock_rounds, .. } = *settings;
        let trial = Trial { both_orders: false, climb, slack, lock_rounds };
        for round in 0..rounds {
            let params = self.params(wanted, round);
            if begins && round == 0 {
                self.lists.record_forget(&mut recording);
                self.lists.record_begin(of, &mut recording, &params, FIRST_STAGES);
            }
            self.lists.record_round(of, &mut recording, &params, &trial);
        }
        let mut reports = vec![Report::default(); rounds as usize];
        recording.fetch("search", &self.moves.report, size_of_val(reports.as_slice()));
        device.run(&recording)?;
        device.download(&self.moves.report, bytemuck::cast_slice_mut(&mut reports))?;
        Ok(reports)
    }

    /// Gives the memory back; nothing is to be done with it any more.
    pub(super) fn free(&mut self, device: &mut dyn Device) {
        std::mem::take(&mut self.scratch).free(device);
        device.free(self.tree.nodes.clone());
    }
}

//! The buffers that live from frame to frame, and what is recorded over them.

use super::super::areas::Measure;
use super::super::moves::Moves;
use super::super::{TreeAreas, WorstFirst};
use crate::build::{DeviceTree, Scratch};
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::lbvh::LeavesParams;
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::dual::search::{DualParams, TO_THE_ROOT};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BEGIN, CLOSE, LIST, OVER_FRINGE, OVER_LIST, OVER_POOL, WORST};
use prbvh_kernel::prbvh::{DUAL, PrbvhParams, ROUNDS};
use prbvh_kernel::status::REPORT_WORDS;
use prbvh_kernel::sum::scale_of;

/// Stages that unfold when a walk through the tree begins: nodes of a sixty-fourth of the root's area.
const FIRST_STAGES: u32 = 4;
/// As many times the nodes of a round should be in the pool.
const POOL: u32 = 16;

/// A row of the report of a device.
pub(super) type Report = [u32; REPORT_WORDS as usize];

/// The tree, and everything that a frame needs.
#[derive(Debug)]
pub(super) struct Working {
    pub(super) tree: DeviceTree,
    scratch: Scratch,
    moves: Moves,
    measure: Measure,
    keys: Buffer,
    pool: Buffer,
    fringe: Buffer,
    list: Buffer,
    /// Boxes of the primitives, and the primitive of each leaf.
    boxes: Buffer,
    order: Buffer,
    root_area: f32,
    scale: f32,
}

impl Working {
    /// Puts a tree on the device, with room for so many rounds at once. `boxes` are those of the primitives.
    pub(super) fn new(
        device: &mut dyn Device,
        nodes: &[Node],
        boxes: &[Aabb],
        rounds: u32,
    ) -> Result<Self, DeviceError> {
        let tree = DeviceTree::upload(device, nodes)?;
        let mut scratch = Scratch::default();
        let internal = tree.references - 1;
        let places = internal.max(1) as usize;
        let moves = Moves::new(device, &mut scratch, &tree, internal as usize, REPORT_WORDS * rounds)?;
        let measure = Measure::new(device, &mut scratch, &tree, &moves.report)?;
        let mut buffer = |label, length, element_bytes| scratch.allocate(&mut *device, label, length, element_bytes);
        let working = Self {
            keys: buffer("keys", places, 4)?,
            pool: buffer("pool", 2 * places, 4)?,
            fringe: buffer("fringe", 2 * places, 4)?,
            list: buffer("list", places, 4)?,
            boxes: buffer("boxes", boxes.len(), size_of::<Aabb>())?,
            order: buffer("order", boxes.len(), 4)?,
            tree,
            scratch,
            moves,
            measure,
            root_area: 0.0,
            scale: 0.0,
        };
        let order: Vec<u32> = nodes[internal as usize..].iter().map(|leaf| leaf.down).collect();
        device.upload(&working.order, bytemuck::cast_slice(&order))?;
        Ok(working)
    }

    fn internal(&self) -> u32 {
        self.tree.references - 1
    }

    /// Takes other boxes of the primitives; returns the root's.
    pub(super) fn refit(&mut self, device: &mut dyn Device, boxes: &[Aabb]) -> Result<Aabb, DeviceError> {
        device.upload(&self.boxes, bytemuck::cast_slice(boxes))?;
        let mut recording = Recording::new();
        let params = LeavesParams { count: self.tree.references };
        let buffers = [&self.order, &self.boxes, &self.tree.nodes];
        recording.dispatch("refit", Kernel::LbvhLeaves, params.count, &params, &buffers);
        self.measure.record_refit(&mut recording);
        self.measure.record_no_arrivals(&mut recording);
        device.run(&recording)?;
        let mut root = [bytemuck::Zeroable::zeroed()];
        device.download(&self.tree.nodes, bytemuck::cast_slice_mut::<Node, u8>(&mut root))?;
        let root = root[0].aabb();
        self.root_area = root.half_area();
        self.scale = scale_of(self.root_area.into());
        Ok(root)
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
            page: 0,
            wanted,
            pool: wanted.saturating_mul(POOL),
        }
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
        for round in 0..rounds {
            let params = self.params(wanted, round);
            if begins && round == 0 {
                self.record_begin(&mut recording, &params);
            }
            self.record_round(&mut recording, &params, settings);
        }
        device.run(&recording)?;
        let mut reports = vec![Report::default(); rounds as usize];
        device.download(&self.moves.report, bytemuck::cast_slice_mut(&mut reports))?;
        Ok(reports)
    }

    fn record_begin(&self, recording: &mut Recording, params: &RoundParams) {
        recording.clear("unfold", &self.keys);
        self.page(recording, params, BEGIN);
        for _ in 0..FIRST_STAGES {
            self.record_unfold(recording, params);
            self.page(recording, params, CLOSE);
        }
    }

    fn page(&self, recording: &mut Recording, params: &RoundParams, page: u32) {
        self.moves.record_page(recording, "select", &RoundParams { page, ..*params }, &self.fringe);
    }

    fn record_unfold(&self, recording: &mut Recording, params: &RoundParams) {
        let books = &self.moves.books;
        let buffers = [&self.tree.nodes, &self.keys, &self.fringe, &self.pool, books];
        recording.dispatch_counted("unfold", Kernel::WorstUnfold, params.count, params, &buffers, books, OVER_FRINGE);
    }

    /// As a round of [`worst_first`](super::super::worst_first), which has a best tree to keep besides.
    fn record_round(&self, recording: &mut Recording, params: &RoundParams, settings: &WorstFirst) {
        let Self { moves, keys, pool, fringe, list, .. } = self;
        let (nodes, ways) = (&self.tree.nodes, &self.measure.arrivals);
        let (books, found, report) = (&moves.books, &moves.found, &moves.report);
        let over_pool = |recording: &mut Recording, kernel, buffers: &[&Buffer]| {
            recording.dispatch_counted("select", kernel, params.count, params, buffers, books, OVER_POOL);
        };
        over_pool(recording, Kernel::WorstCount, &[pool, keys, books]);
        self.page(recording, params, WORST);
        over_pool(recording, Kernel::WorstSelect, &[keys, pool, list, books]);
        self.record_unfold(recording, params);
        self.page(recording, params, LIST);

        let dual = DualParams {
            count: params.count,
            nodes: params.nodes,
            both_orders: 0,
            climb: settings.climb.min(TO_THE_ROOT),
            slack: settings.slack,
            row: params.row,
        };
        let buffers = [nodes, list, found, keys, books, report];
        recording.dispatch_counted("search", Kernel::DualSearch, dual.count, &dual, &buffers, books, OVER_LIST);
        let params_of_moves = PrbvhParams {
            count: params.count,
            mu: 1,
            first: 0,
            nodes: params.nodes,
            flags: DUAL | ROUNDS,
            row: params.row,
            scale: params.scale,
        };
        moves.record_lock_rounds(recording, &params_of_moves, settings.lock_rounds);
        moves.record_reinsert(recording, &params_of_moves);
        let buffers = [found, nodes, ways, keys, fringe, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstMark, &params_of_moves, &buffers);
        let buffers = [found, nodes, ways, keys, pool, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstRefit, &params_of_moves, &buffers);
        self.page(recording, params, CLOSE);
    }

    /// Gives the memory back; nothing is to be done with it any more.
    pub(super) fn free(&mut self, device: &mut dyn Device) {
        std::mem::take(&mut self.scratch).free(device);
        device.free(self.tree.nodes.clone());
    }
}

//! What a round of [`prbvh_kernel::prbvh::worst`] records, and the lists that it fills.

use super::moves::Moves;
use crate::build::Scratch;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::dual::search::{DualParams, TO_THE_ROOT};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BEGIN, CLOSE, LIST, OVER_FRINGE, OVER_LIST, OVER_POOL, WORST};
use prbvh_kernel::prbvh::{DUAL, PrbvhParams, ROUNDS};

/// Stages that unfold before the first round: nodes of a sixty-fourth of the root's area.
pub(super) const FIRST_STAGES: u32 = 4;
/// As many times the nodes of a round should be in the pool: to look at a key costs little beside a search.
pub(super) const POOL: u32 = 16;

/// Buffers of the order.
#[derive(Debug)]
pub(super) struct Lists {
    pub(super) keys: Buffer,
    pool: Buffer,
    fringe: Buffer,
    list: Buffer,
}

/// The tree that rounds work on, and what they have besides the lists.
#[derive(Clone, Copy, Debug)]
pub(super) struct Of<'a> {
    pub(super) nodes: &'a Buffer,
    pub(super) ways: &'a Buffer,
    pub(super) moves: &'a Moves,
}

/// How a node is searched, and how often its move may try for its locks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    pub(super) both_orders: bool,
    pub(super) climb: u32,
    pub(super) slack: f32,
    pub(super) lock_rounds: u32,
}

impl Lists {
    /// Of a tree with so many internal nodes.
    pub(super) fn new(device: &mut dyn Device, scratch: &mut Scratch, internal: u32) -> Result<Self, DeviceError> {
        let places = internal.max(1) as usize;
        let mut buffer = |label, length| scratch.allocate(device, label, length, 4);
        Ok(Self {
            keys: buffer("keys", places)?,
            pool: buffer("pool", 2 * places)?,
            fringe: buffer("fringe", 2 * places)?,
            list: buffer("list", places)?,
        })
    }

    /// Records that the pool is empty and unfolds the top of the tree, in so many stages or until the pool is full.
    pub(super) fn record_begin(&self, of: Of<'_>, recording: &mut Recording, params: &RoundParams, stages: u32) {
        self.record_page(of, recording, params, BEGIN);
        for _ in 0..stages {
            self.record_unfold(of, recording, params);
            self.record_page(of, recording, &RoundParams { flags: 0, ..*params }, CLOSE);
        }
    }

    /// Records that nobody has looked at any node.
    pub(super) fn record_forget(&self, recording: &mut Recording) {
        recording.clear("unfold", &self.keys);
    }

    /// Records a page of the books.
    pub(super) fn record_page(&self, of: Of<'_>, recording: &mut Recording, params: &RoundParams, page: u32) {
        of.moves.record_page(recording, "select", &RoundParams { page, ..*params }, &self.fringe);
    }

    fn record_unfold(&self, of: Of<'_>, recording: &mut Recording, params: &RoundParams) {
        let Self { keys, pool, fringe, .. } = self;
        let books = &of.moves.books;
        let buffers = [of.nodes, keys, fringe, pool, books];
        recording.dispatch_counted("unfold", Kernel::WorstUnfold, params.count, params, &buffers, books, OVER_FRINGE);
    }

    /// Records a round.
    pub(super) fn record_round(&self, of: Of<'_>, recording: &mut Recording, params: &RoundParams, trial: &Trial) {
        let Self { keys, pool, fringe, list } = self;
        let Of { nodes, ways, moves } = of;
        let (books, found, report) = (&moves.books, &moves.found, &moves.report);
        let over_pool = |recording: &mut Recording, kernel, buffers: &[&Buffer]| {
            recording.dispatch_counted("select", kernel, params.count, params, buffers, books, OVER_POOL);
        };
        over_pool(recording, Kernel::WorstCount, &[pool, keys, books]);
        self.record_page(of, recording, params, WORST);
        over_pool(recording, Kernel::WorstSelect, &[keys, pool, list, books]);
        self.record_unfold(of, recording, params);
        self.record_page(of, recording, params, LIST);

        let dual = DualParams {
            count: params.count,
            nodes: params.nodes,
            both_orders: trial.both_orders.into(),
            climb: trial.climb.min(TO_THE_ROOT),
            slack: trial.slack,
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
        moves.record_lock_rounds(recording, &params_of_moves, trial.lock_rounds);
        moves.record_reinsert(recording, &params_of_moves);
        let buffers = [found, nodes, ways, keys, fringe, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstMark, &params_of_moves, &buffers);
        let buffers = [found, nodes, ways, keys, pool, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstRefit, &params_of_moves, &buffers);
        self.record_page(of, recording, params, CLOSE);
    }
}

//! What a round of [`prbvh_kernel::prbvh::worst`] records, and the lists that it fills.

use super::WorstFirst;
use super::moves::Moves;
use crate::build::Scratch;
use crate::device::{Buffer, Device, DeviceError, DeviceInfo, DeviceKind, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::dual::search::{DualParams, TO_THE_ROOT};
use prbvh_kernel::prbvh::group::{BEGINS, COMES_FIRST};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BEGIN, CLOSE, LISTS, OVER_BOTH, OVER_LIST, OVER_POOL, SELECTS};
use prbvh_kernel::prbvh::worst::top::{TopNode, TopParams};
use prbvh_kernel::prbvh::{DUAL, PrbvhParams, ROUNDS};

/// Stages that unfold before the first round: nodes of a sixty-fourth of the root's area.
pub(super) const FIRST_STAGES: u32 = 4;
/// As many times the nodes of a round should be in the pool: to look at a key costs little beside a search.
pub(super) const POOL: u32 = 16;

/// A round that wants no more nodes takes a GPU longer to begin its dispatches than to do the work in one workgroup.
const SMALL_ROUND: u32 = 64;
/// The same where the workgroup is a thread of a CPU, and a dispatch dearer still.
const SMALL_ROUND_OF_VULKAN_CPU: u32 = 256;
/// Internal nodes of a tree through which one invocation may walk on any device: lavapipe leaves its loops after 65,535 rounds of them all, in silence.
const WALK: u32 = 1 << 13;

/// How many nodes a round wants at the most that is [small](prbvh_kernel::prbvh::group), and whether a single workgroup may unfold a tree.
fn alone(info: &DeviceInfo, internal: u32) -> (u32, bool) {
    match info.kind {
        DeviceKind::VulkanCpu if internal > WALK => (0, false),
        DeviceKind::VulkanCpu => (SMALL_ROUND_OF_VULKAN_CPU, true),
        DeviceKind::VulkanGpu | DeviceKind::Cpu => (SMALL_ROUND, true),
    }
}

/// Whether a single workgroup may end a small round.
fn ends_alone(info: &DeviceInfo) -> bool {
    info.atomics_64 && info.kernel_buffers as usize >= Kernel::WorstTail.info().bindings.len()
}

/// Kernels that a run may take beside those of its first rounds: of larger rounds, if there are any, and of new tops.
pub(crate) fn later_kernels(info: &DeviceInfo, internal: u32, settings: &WorstFirst) -> Vec<Kernel> {
    const LARGE: [Kernel; 5] =
        [Kernel::WorstCount, Kernel::WorstSelect, Kernel::PrbvhReinsert, Kernel::WorstMark, Kernel::WorstRefit];
    const LOCKS: [[Kernel; 2]; 2] =
        [[Kernel::PrbvhLock, Kernel::PrbvhCheck], [Kernel::PrbvhLockWords, Kernel::PrbvhCheckWords]];
    const TOPS: [Kernel; 4] = [Kernel::WorstTop, Kernel::KeptGraft, Kernel::Refit, Kernel::WorstHead];
    let most = settings.most_part.max(settings.tail_part) * f64::from(internal);
    let mut kernels = vec![Kernel::WorstBooks];
    if most >= f64::from(alone(info, internal).0) + 1.0 {
        kernels.extend(LARGE.into_iter().chain(LOCKS[usize::from(!info.atomics_64)]));
    }
    if !settings.tops(internal).is_empty() {
        kernels.extend(TOPS);
    }
    kernels
}

/// Buffers of the order.
#[derive(Debug)]
pub(super) struct Lists {
    /// A round that wants no more nodes is a small one.
    small: u32,
    /// Whether a single workgroup may unfold the tree.
    unfolds_alone: bool,
    /// Whether one may end a small round.
    ends_alone: bool,
    keys: Buffer,
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
        let (small, unfolds_alone) = alone(device.info(), internal);
        let ends_alone = ends_alone(device.info());
        let mut buffer = |label, length| scratch.allocate(device, label, length, 4);
        Ok(Self {
            small,
            unfolds_alone,
            ends_alone,
            keys: buffer("keys", places)?,
            pool: buffer("pool", 2 * places)?,
            fringe: buffer("fringe", 2 * places)?,
            list: buffer("list", places)?,
        })
    }

    /// Most nodes that a small round wants.
    pub(super) fn small(&self) -> u32 {
        self.small
    }

    /// Whether a round that wants so many nodes is a small one.
    pub(super) fn is_small(&self, wanted: u32) -> bool {
        wanted <= self.small
    }

    /// Records that the pool is empty and unfolds the top of the tree, in so many stages or until the pool is full.
    pub(super) fn record_begin(&self, of: Of<'_>, recording: &mut Recording, params: &RoundParams, stages: u32) {
        if self.unfolds_alone {
            let params = RoundParams { flags: params.flags | BEGINS, page: stages, ..*params };
            self.record_head(of, recording, "unfold", &params);
            return;
        }
        self.record_page(of, recording, params, BEGIN);
        for _ in 0..stages {
            self.record_select(of, recording, "unfold", params);
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

    /// Records that the pool is empty and unfolds the top of the tree until the pool is full, in so many stages at the most; then the first nodes of the
    /// top go to `top`, as many as it has room for.
    pub(super) fn record_top(
        &self,
        of: Of<'_>,
        recording: &mut Recording,
        params: &RoundParams,
        stages: u32,
        top: &Buffer,
    ) {
        self.record_begin(of, recording, &RoundParams { flags: LISTS, ..*params }, stages);
        self.record_more_of_top(of, recording, 0, top);
    }

    /// The same of the nodes from `first` on, of a top that has been unfolded.
    pub(super) fn record_more_of_top(&self, of: Of<'_>, recording: &mut Recording, first: u32, top: &Buffer) {
        let params = TopParams { count: top.length as u32, first };
        let buffers = [of.nodes, &self.list, &of.moves.books, top];
        recording.dispatch("read top", Kernel::WorstTop, params.count, &params, &buffers);
        recording.fetch("read top", top, top.bytes() as usize);
    }

    fn record_select(&self, of: Of<'_>, recording: &mut Recording, label: &'static str, params: &RoundParams) {
        let Self { keys, pool, fringe, list, .. } = self;
        let books = &of.moves.books;
        let buffers = [of.nodes, keys, pool, list, fringe, books];
        // Chunks of the pool, and the fringe.
        let params = RoundParams { count: params.count.saturating_mul(2), ..*params };
        recording.dispatch_counted(label, Kernel::WorstSelect, params.count, &params, &buffers, books, OVER_BOTH);
    }

    fn record_head(&self, of: Of<'_>, recording: &mut Recording, label: &'static str, params: &RoundParams) {
        let Self { keys, pool, fringe, list, .. } = self;
        let buffers = [of.nodes, keys, fringe, pool, list, &of.moves.books, &of.moves.report];
        if params.has(BEGINS) {
            let params = RoundParams { count: 1, ..*params };
            recording.dispatch(label, Kernel::WorstHead, 1, &params, &buffers);
        } else {
            of.moves.dispatch_once(recording, label, Kernel::WorstHead, params, &buffers);
        }
    }

    /// Records a round.
    pub(super) fn record_round(&self, of: Of<'_>, recording: &mut Recording, params: &RoundParams, trial: &Trial) {
        let Self { keys, pool, fringe, list, .. } = self;
        let Of { nodes, ways, moves } = of;
        let (books, found, report) = (&moves.books, &moves.found, &moves.report);
        let is_small = self.is_small(params.wanted[0]);
        if is_small {
            self.record_head(of, recording, "select", &RoundParams { flags: params.flags | COMES_FIRST, ..*params });
        } else {
            let buffers = [pool, keys, books];
            recording.dispatch_counted("select", Kernel::WorstCount, params.count, params, &buffers, books, OVER_POOL);
            self.record_head(of, recording, "select", params);
            let selects = RoundParams { flags: params.flags | SELECTS, ..*params };
            self.record_select(of, recording, "select", &selects);
        }

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
        let lock_rounds = trial.lock_rounds.max(1);
        if is_small
            && self.ends_alone
            && let Some(locks) = moves.word_locks()
        {
            let params = RoundParams { page: lock_rounds, ..*params };
            let buffers = [found, nodes, locks, &moves.kept, ways, keys, fringe, pool, books, report];
            moves.dispatch_once(recording, "reinsert", Kernel::WorstTail, &params, &buffers);
            return;
        }
        let params_of_moves = PrbvhParams {
            count: params.count,
            mu: 1,
            first: 0,
            nodes: params.nodes,
            flags: DUAL | ROUNDS,
            row: params.row,
            scale: params.scale,
        };
        moves.record_lock_rounds(recording, &params_of_moves, lock_rounds);
        moves.record_reinsert(recording, &params_of_moves);
        let buffers = [found, nodes, ways, keys, fringe, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstMark, &params_of_moves, &buffers);
        let buffers = [found, nodes, ways, keys, pool, books, report];
        moves.dispatch(recording, "refit", Kernel::WorstRefit, &params_of_moves, &buffers);
        self.record_page(of, recording, params, CLOSE);
    }
}

/// Room for so many nodes of a top.
pub(super) fn top_buffer(device: &mut dyn Device, scratch: &mut Scratch, nodes: u32) -> Result<Buffer, DeviceError> {
    scratch.allocate(device, "top", nodes.max(1) as usize, size_of::<TopNode>())
}

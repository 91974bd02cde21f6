//! Which nodes are searched first: those that look worst.
//!
//! Source of the measure: Bittner, Hapala & Havran, *Fast Insertion-Based Optimization of Bounding Volume Hierarchies*, CGF 32(1), 2013, §4.1, who
//! dissolve one node after another. Nearly the whole gain of an optimisation sits in about one node of a hundred, and their measure finds
//! these. Here a *round* dissolves many of them side by side ([`super::dual`]).
//!
//! # The key of a node
//! Each internal node has a [key](keys): its measure, which is larger than its area. A node that was searched in vain is *tired*: it is not searched again
//! until its measure or its children change. So the key says three things: how bad the node is, whether it is tired, and whether it is in the *pool*, the list of
//! nodes that wait for their search. [Refit](refit) keeps the keys right, since it comes to every node whose children or area changed.
//!
//! # Unfolding
//! No key is computed before it is wanted. Areas fall on every way down, so the nodes of more than a given area are the top of the tree, and below it hangs a
//! *fringe* of nodes. When the pool runs low the area is divided by four, and the fringe [unfolds](unfold): each of its nodes walks through the part
//! below it that is now large enough. Optimising begins after a look at a few hundred nodes, and an untouched part of a scene is never looked at.
//!
//! # A round
//! | dispatch | what it does |
//! |---|---|
//! | `worst_count` | a histogram of the keys in the pool |
//! | `worst_head` | which keys are among the worst `k` |
//! | `worst_select` | the worst go on the list, the tired leave the pool; if it is low the fringe unfolds |
//! | `dual_search` | a move for each node on the list, or it is tired |
//! | `prbvh_lock`, `prbvh_check` | several times over |
//! | `prbvh_reinsert` | the winners |
//! | `worst_mark`, `worst_refit` | boxes and keys above them |
//! | `worst_books` | the sum of the areas, whether it is the lowest so far, how long the lists are |
//!
//! Where few nodes are searched, `worst_head` does all that comes before the search, and `worst_tail` all that comes after it ([`super::group`]).
//!
//! Lists are filled through a common counter, so that their order differs from run to run. Nothing depends on it: what is on a list does not, no node is on a list
//! twice, locks know moves by their nodes, and sums have no order ([`crate::sum`]).

pub mod books;
pub(in crate::prbvh) mod hurry;
pub mod keys;
pub mod refit;
pub mod select;
pub mod top;
pub mod unfold;
pub mod verdict;
mod words;

use super::Move;
use super::dual::search::{self, DualParams};
use crate::mem::{AtomicU32, Slot};
use crate::node::{NO_NODE, WideNode};
use crate::status::SEARCHED;
use bytemuck::{Pod, Zeroable};

/// Push constants of the kernels of a round.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct RoundParams {
    /// Most invocations.
    pub count: u32,
    /// Nodes of the tree, `2n-1`.
    pub nodes: u32,
    /// Half area of the root, scene units².
    pub root_area: f32,
    /// Units of a [`Sum`](crate::sum::Sum) in an area.
    pub scale: f32,
    /// The word of the report with which the row of the round begins.
    pub row: u32,
    /// Of [`books`]: which page. Of [`super::group`]: how many stages unfold, or how many rounds of locks there are.
    pub page: u32,
    /// Nodes to search in the round, without further hurry: a whole number and a fraction of 2⁻³².
    pub wanted: [u32; 2],
    /// The same of the next round.
    pub next: [u32; 2],
    /// Most nodes of a round, whatever the hurry.
    pub most: u32,
    /// As many times the nodes of the next round should be in the pool for it; 0 is 1.
    pub pools: u32,
    /// How often there was hurry when the round was planned.
    pub hurried: u32,
    /// Rounds of more nodes are not planned behind this one, as far as the submission goes.
    pub room: u32,
    /// Of the published order: every `mu`-th node is searched at first; 0 in the other.
    pub mu: u32,
    /// Of [`verdict`], [`books`] and [`super::group`]: [`JUDGES`](verdict::JUDGES) and the like.
    pub flags: u32,
    /// A round that searches as many nodes counts where it makes no progress.
    pub broad: u32,
    /// So many rounds without progress end the search.
    pub patience: u32,
    /// What counts as progress, as a part of the cost at the last one.
    pub settles: f32,
    /// The cost of the first tree in the unit of the sums.
    pub total: f32,
    /// A change that counts as none, in the unit of the sums.
    pub epsilon: f32,
    /// A [`Sum`](crate::sum::Sum): so much is lost at the cost that was asked for.
    pub target: [u32; 2],
}

impl RoundParams {
    /// Places of a list, and so of each half of the two that have two sides.
    #[inline(always)]
    #[must_use]
    pub fn places(&self) -> u32 {
        self.nodes / 2
    }

    /// The same of a round that wants so many nodes, and so many in the pool for the next one, without hurry.
    #[must_use]
    pub const fn wanting(self, wanted: u32, pool: u32) -> Self {
        let most = if wanted > pool { wanted } else { pool };
        Self { wanted: [wanted, 0], next: [pool, 0], most, pools: 1, ..self }
    }

    /// Whether a flag is set.
    #[inline(always)]
    #[must_use]
    pub fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }
}

/// Invocation `i` searches for node `list[i]`, which is tired if that was in vain. Reads `nodes[2n-1]`, writes `found[i]`, also behind the end of the list,
/// and `keys`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn search(
    i: u32,
    params: &DualParams,
    nodes: &[WideNode],
    list: &[u32],
    found: &[Slot<Move>],
    keys: &[AtomicU32],
    books: &[AtomicU32],
    report: &[AtomicU32],
) {
    let mut best = Move::NONE;
    let length = books[books::LIST_LENGTH].load();
    if i == 0 {
        report[params.row as usize + SEARCHED].store(length);
    }
    if i < length {
        let input = list[i as usize];
        best = search::search(input, params, nodes, report);
        if best.output == NO_NODE {
            let key = &keys[input as usize];
            key.store(key.load() | keys::TIRED);
        }
    }
    found[i as usize].set(best);
}

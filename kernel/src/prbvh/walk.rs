//! The search of [`super::search`] for processors that run invocations in lockstep: the same outputs, bit for bit, in another order of work.
//!
//! Three kernels: [`list`] writes the input nodes, [`walk`] finds an output for each, [`confirm`] computes the area decreases again, directly.
//!
//! The invocations of `walk` are *lanes* that outlive a search: one that is done takes the next input node from a common counter while its
//! neighbours go on (persistent threads: Aila & Laine, *Understanding the Efficiency of Ray Traversal on GPUs*, 2009). In lockstep all pay for
//! what one does, also for loads. So a round of the one inner loop loads one node, with one load, and does with it whatever the lane is about, by
//! selections in place of branches; and to end a search and to begin another waits for every [`BURST`]-th round.
//!
//! Kind: maps. Which lane of `walk` makes a search does not change what it finds.

use super::candidates::largest_decrease;
use super::search::{MAX_STEPS, checked_area_decrease};
use super::{PrbvhParams, Reinsertion};
use crate::aabb::Aabb;
use crate::math::{select, umax};
use crate::mem::{AtomicU32, Slot};
use crate::node::{Family, NO_NODE, RIGHT, ROOT, WholeNodes, WideNode};
use crate::status::{self, FAULT_SEARCH_STEPS, FOUND, MOST_STEPS};
use bytemuck::{Pod, Zeroable};

/// Rounds between two chances to begin a search.
pub const BURST: u32 = 32;

/// Most rounds of a search: to each step belong at most one way up, or two rounds to the next pivot.
const MAX_ROUNDS: u32 = 3 * MAX_STEPS;
/// Bursts that a search may last.
const MAX_BURSTS: u32 = MAX_ROUNDS.div_ceil(BURST) + 1;
/// Bursts of a lane. lavapipe leaves the loops of an invocation after 65,535 rounds of them all, without a word; each burst has one more round to end
/// it, and one in the loop around it.
const BURSTS: u32 = 60_000 / (BURST + 2);
/// A lane begins no search in its last [`MAX_BURSTS`] bursts, so it makes at least as many.
const SEARCHES_OF_A_LANE: u32 = (BURSTS - MAX_BURSTS) / MAX_BURSTS;
const _: () = assert!(SEARCHES_OF_A_LANE >= 3);

/// A search on its way through the three kernels, in the place of the [`Reinsertion`] that it ends with.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Pending {
    /// The child of the pivot above the output; bits of the area decrease once it is confirmed.
    pub top: u32,
    /// The input node; [`NO_NODE`] if there is nothing to search.
    pub input: u32,
    /// The output node; [`NO_NODE`] without one, [`NOT_YET`] before the search.
    pub output: u32,
}

const _: () = assert!(size_of::<Pending>() == size_of::<Reinsertion>());

/// [`Pending::output`] of an input node that no lane has taken.
pub const NOT_YET: u32 = NO_NODE - 1;

/// Push constants of [`walk`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct WalkParams {
    /// Invocations: lanes.
    pub count: u32,
    /// Searches.
    pub searches: u32,
    /// As in [`PrbvhParams`].
    pub nodes: u32,
    /// As in [`PrbvhParams`].
    pub floor: f32,
}

impl WalkParams {
    /// As many lanes as all searches need if each of them takes [`MAX_STEPS`].
    #[must_use]
    pub const fn of(params: &PrbvhParams) -> Self {
        Self {
            count: params.count.div_ceil(SEARCHES_OF_A_LANE),
            searches: params.count,
            nodes: params.nodes,
            floor: params.floor,
        }
    }
}

/// Writes input node `input`, unless it cannot gain more than the floor.
#[inline(always)]
pub fn list(input: u32, params: &PrbvhParams, nodes: &[WideNode], pending: &Slot<Pending>) {
    let searches =
        input != ROOT && input < params.nodes && (params.floor == 0.0 || largest_decrease(input, nodes) > params.floor);
    pending.set(Pending { top: NO_NODE, input: if searches { input } else { NO_NODE }, output: NOT_YET });
}

/// Takes input nodes until there are none left. `taken[0]` counts them and starts at 0.
#[inline(always)]
pub fn walk(
    params: &WalkParams,
    nodes: &[WideNode],
    pending: &[Slot<Pending>],
    taken: &[AtomicU32],
    report: &[AtomicU32],
) {
    let internal = params.nodes / 2;
    let mut search = Walk::NONE;
    let mut most_steps = 0;
    let mut place = NO_NODE;
    let mut goes_on = true;
    let mut bursts = 0;
    while goes_on && bursts < BURSTS {
        if search.at == NO_NODE {
            if place != NO_NODE {
                pending[place as usize].set(Pending {
                    top: search.best_top,
                    input: search.input,
                    output: search.output,
                });
            }
            most_steps = umax(most_steps, search.steps);
            place = NO_NODE;
            goes_on = bursts + MAX_BURSTS < BURSTS;
            if goes_on {
                let next = taken[0].arrive();
                goes_on = next < params.searches;
                if goes_on {
                    let input = pending[next as usize].get().input;
                    if input != NO_NODE {
                        place = next;
                        search = Walk::begin(input, params.floor, nodes);
                    }
                }
            }
        }
        let mut rounds = 0;
        while search.at != NO_NODE && rounds < BURST {
            rounds += 1;
            search = search.round(internal, nodes);
        }
        bursts += 1;
    }
    // The device cut the loops short.
    if place != NO_NODE {
        status::raise(report, FAULT_SEARCH_STEPS);
    }
    if most_steps > report[MOST_STEPS].load() {
        report[MOST_STEPS].max(most_steps);
    }
}

/// What a lane does with the node that it loads.
const VISIT: u32 = 0;
/// Takes back its increase: all below it is done.
const ASCEND: u32 = 1;
/// Leaves it, the pivot, for the next one.
const LEAVE: u32 = 2;
/// Goes to its left child: it is the next pivot, and the last one its right child.
const ENTER: u32 = 3;

/// The state of a search between two rounds; see [`super::search::best_output`].
#[derive(Clone, Copy)]
struct Walk {
    /// The node to load; [`NO_NODE`] at the end.
    at: u32,
    does: u32,
    steps: u32,
    input: u32,
    input_box: Aabb,
    sibling: u32,
    parent: u32,
    parent_area: f32,
    bound: f32,
    pivot: u32,
    /// The pivot without the input and without what is below `top`, until `top` is visited.
    pivot_box: Aabb,
    top: u32,
    d_pivot: f32,
    d: f32,
    best: f32,
    output: u32,
    best_top: u32,
}

impl Walk {
    const NONE: Self = Self {
        at: NO_NODE,
        does: VISIT,
        steps: 0,
        input: NO_NODE,
        input_box: Aabb::EMPTY,
        sibling: NO_NODE,
        parent: NO_NODE,
        parent_area: 0.0,
        bound: 0.0,
        pivot: NO_NODE,
        pivot_box: Aabb::EMPTY,
        top: NO_NODE,
        d_pivot: 0.0,
        d: 0.0,
        best: 0.0,
        output: NO_NODE,
        best_top: NO_NODE,
    };

    #[inline(always)]
    fn begin(input: u32, floor: f32, nodes: &[WideNode]) -> Self {
        let node = nodes.whole(input);
        let Family { parent, sibling, parent_node, .. } = nodes.family(node);
        let parent_area = parent_node.aabb().half_area();
        Self {
            at: sibling,
            input,
            input_box: node.aabb(),
            sibling,
            parent,
            parent_area,
            bound: parent_area - node.aabb().half_area(),
            pivot: parent,
            top: sibling,
            best: floor,
            ..Self::NONE
        }
    }

    #[inline(always)]
    fn round(mut self, internal: u32, nodes: &[WideNode]) -> Self {
        let at = self.at;
        let node = nodes.whole(at);
        let aabb = node.aabb();
        let area = aabb.half_area();
        let united_area = aabb.union(self.input_box).half_area();
        let is_right = !node.is_left();
        let link = node.up & !RIGHT;

        let visits = self.does == VISIT;
        let ascends = self.does == ASCEND;
        let leaves = self.does == LEAVE;
        let enters = self.does == ENTER;

        // The next pivot is known from its children, whichever is loaded.
        let begins_top = visits & (at == self.top);
        self.pivot = select(begins_top & is_right, link, select(enters, at, self.pivot));
        let pivot_area = self.pivot_box.half_area();
        self.d_pivot = select(leaves & (at != self.parent), self.d_pivot + (area - pivot_area), self.d_pivot);
        self.pivot_box = Aabb::select(begins_top, self.pivot_box.union(aabb), self.pivot_box);

        self.steps += visits as u32;
        let decrease = self.d + (self.parent_area - united_area);
        let is_better = visits & (at != self.sibling) & (decrease > self.best);
        self.best = select(is_better, decrease, self.best);
        self.output = select(is_better, at, self.output);
        self.best_top = select(is_better, self.top, self.best_top);

        // Written so that a NaN does not descend.
        let change = area - united_area;
        let d_below = self.d + change;
        let descends = visits & (at < internal) & (d_below + self.bound > self.best);

        let is_top = at == self.top;
        let turns = (visits & !descends) | ascends;
        let d_above = self.d - change;
        self.d = select(descends, d_below, select(ascends, d_above, self.d));
        // Where to, and what for.
        let next_top = select(enters, node.down, link);
        let goes_to_top = enters | (leaves & !is_right);
        let goes_to_pivot = turns & is_top;
        self.top = select(goes_to_top, next_top, self.top);
        self.d = select(goes_to_top, self.d_pivot, self.d);
        let is_done = (goes_to_pivot & (self.pivot == ROOT)) | (self.steps >= MAX_STEPS);
        let on = select(descends | enters, node.down, select(goes_to_pivot, self.pivot, link));
        self.at = select(is_done, NO_NODE, on);
        self.does =
            select(goes_to_pivot, LEAVE, select(turns & is_right, ASCEND, select(leaves & is_right, ENTER, VISIT)));
        self
    }
}

/// Makes a reinsertion of what was found for an input node, with the area decrease computed again; returns the child of the pivot above its
/// output, as [`super::search::search`] does.
#[inline(always)]
pub fn confirm(nodes: &[WideNode], pending: &Slot<Pending>, report: &[AtomicU32]) -> u32 {
    let Pending { top, input, output } = pending.get();
    let mut confirmed = Reinsertion::NONE;
    let mut confirmed_top = NO_NODE;
    if input != NO_NODE {
        if output == NOT_YET {
            status::raise(report, FAULT_SEARCH_STEPS);
        } else if output != NO_NODE {
            let area_decrease = checked_area_decrease(input, output, nodes.family(nodes.whole(top)).parent, nodes);
            if area_decrease > 0.0 {
                confirmed = Reinsertion { area_decrease, input, output };
                confirmed_top = top;
                report[FOUND].add(1);
            }
        }
    }
    pending.set(Pending { top: confirmed.area_decrease.to_bits(), input: confirmed.input, output: confirmed.output });
    confirmed_top
}

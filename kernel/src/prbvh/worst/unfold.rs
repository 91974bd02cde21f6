//! Keys from the top of the tree downward.
//!
//! Kind: walks from the nodes of the fringe. More than one may come to a node: the first to exchange its key decides, and all would do the same.

use super::RoundParams;
use super::books::{FRINGE_LENGTH, FRINGE_SIDE, LISTS, MOST_STAGES, POOL_LENGTH, POOL_SIDE, STAGE, UNFOLDS, list_more};
use super::keys::{COLD, IN_POOL, ON_FRINGE, fresh, measure, push, waits};
use crate::math::umin;
use crate::mem::{AtomicU32, Slot};
use crate::node::{RIGHT, ROOT, WholeNodes, WideNode};

/// Nodes that one walk steps into; the rest below goes on the fringe.
const MAX_STEPS: u32 = 4096;

/// Invocation `i` walks below its node of the fringe through all nodes of more than the area of the stage: those without a key get one and go into the
/// pool. Where the area is less, the walk ends at the first node without a key, which goes on the other side of the fringe. Reads `nodes[2n-1]`; reads and
/// writes `keys[n-1]`, `fringe[2(n-1)]`, `pool[2(n-1)]`, and with [`LISTS`] every node that gets a key to `list[n-1]`.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn unfold(
    i: u32,
    params: &RoundParams,
    nodes: &[WideNode],
    keys: &[AtomicU32],
    fringe: &[AtomicU32],
    pool: &[AtomicU32],
    list: &[Slot<u32>],
    books: &[AtomicU32],
) {
    let places = params.places();
    let side = books[FRINGE_SIDE].load();
    if books[UNFOLDS].load() == 0 || i >= books[FRINGE_LENGTH + side as usize].load() || i >= places {
        return;
    }
    let top = fringe[(side * places + i) as usize].load();
    let stage = books[STAGE].load();
    let bits = params.root_area.to_bits();
    // A quarter is two less in the exponent.
    let least = if stage < MOST_STAGES { f32::from_bits(bits - umin(bits, stage << 24)) } else { 0.0 };
    let to_fringe = &books[FRINGE_LENGTH + (side ^ 1) as usize];
    let pool_side = books[POOL_SIDE].load();
    let to_pool = &books[POOL_LENGTH + pool_side as usize];

    let mut v = top;
    let mut steps = 0;
    let mut done = false;
    while !done {
        let mut node = nodes.whole(v);
        let mut descends = false;
        if v < places {
            let key = keys[v as usize].load();
            let is_new = key == COLD || (key == ON_FRINGE && v == top);
            if is_new && (node.aabb().half_area() < least || steps >= MAX_STEPS) {
                let before = keys[v as usize].swap(ON_FRINGE);
                if v == top || before == COLD {
                    push(fringe, places, side ^ 1, to_fringe, v);
                }
            } else if is_new {
                let left = nodes.whole(node.down);
                let right_area = nodes.box_of(left.up).half_area();
                let mut key = fresh(measure(node.aabb().half_area(), left.aabb().half_area(), right_area));
                if waits(key) && v != ROOT {
                    key |= IN_POOL;
                }
                let before = keys[v as usize].swap(key);
                if before == COLD || before == ON_FRINGE {
                    if key & IN_POOL != 0 {
                        push(pool, places, pool_side, to_pool, v);
                    }
                    if params.has(LISTS) {
                        list[list_more(books, 1) as usize].set(v);
                    }
                }
                descends = true;
            } else if key != ON_FRINGE {
                descends = steps < MAX_STEPS;
                if !descends {
                    push(fringe, places, side ^ 1, to_fringe, v);
                }
            }
        }
        if descends {
            steps += 1;
            v = node.down;
        } else {
            // On to the next subtree in depth-first order.
            while v != top && node.up & RIGHT != 0 {
                v = node.up & !RIGHT;
                node = nodes.whole(v);
            }
            if v == top {
                done = true;
            } else {
                v = node.up;
            }
        }
    }
}

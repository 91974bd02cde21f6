//! PRBVH check, conservative strategy: a reinsertion stays if it owns every node that it writes, and others only read what it reads.
//!
//! Kind: map: invocation `i` reads `nodes[2n-1]`, `tops` and the locks, and clears `found[i]` of a loser.

use super::{Footprint, claim, is_read_only};
use crate::mem::{AtomicU32, Slot};
use crate::node::{NO_NODE, Node};
use crate::prbvh::{PrbvhParams, Reinsertion};
use crate::status::OWNED;

/// Invocation `i` checks 64-bit locks.
#[inline(always)]
pub fn check(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    tops: &[u32],
    locks: &[u64],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
) {
    check_with(i, params, nodes, tops, found, report, |v| ((locks[v] >> 32) as u32, locks[v] as u32));
}

/// Invocation `i` checks locks of two 32-bit words.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a parameter for each buffer")]
pub fn check_words(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    tops: &[u32],
    decreases: &[u32],
    inputs: &[u32],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
) {
    check_with(i, params, nodes, tops, found, report, move |v| (decreases[v], inputs[v]));
}

/// `holder` gives the upper and the lower word of the key of a node's holder.
#[inline(always)]
fn check_with(
    i: u32,
    params: &PrbvhParams,
    nodes: &[Node],
    tops: &[u32],
    found: &[Slot<Reinsertion>],
    report: &[AtomicU32],
    holder: impl Fn(usize) -> (u32, u32),
) {
    let Reinsertion { area_decrease, input, output } = found[i as usize].get();
    if output != NO_NODE {
        let footprint = Footprint { internal: params.nodes / 2, input, output, top: tops[i as usize] };
        let stays = footprint.all(nodes, move |v, written| {
            let (decrease, held) = holder(v as usize);
            let own = decrease == area_decrease.to_bits() && (held | 1) == claim(input, true);
            own || (!written && is_read_only(held))
        });
        if stays {
            report[OWNED].add(1);
        } else {
            found[i as usize].set(Reinsertion::NONE);
        }
    }
}

//! A round of dual moves once more, on the host: what the search finds, and what each move is worth in f64.

use super::{BreachKind, Offer, SearchAccuracy, dual_area_decrease};
use prbvh::bvh::SahModel;
use prbvh::optimize::{DualRound, IterationRow};
use prbvh_kernel::mem::AtomicU32;
use prbvh_kernel::node::{NO_NODE, Node, ROOT};
use prbvh_kernel::prbvh::Move;
use prbvh_kernel::prbvh::dual::search::{DualParams, search};
use prbvh_kernel::status::REPORT_WORDS;
use prbvh_kernel::sum::scale_of;
use rayon::prelude::*;

/// What is wrong with a round.
pub(super) type Faults = Vec<(BreachKind, String)>;

/// Searches again in the tree before the round, and compares.
pub(super) fn check_round(before: &[Node], row: &IterationRow, round: &DualRound) -> (SearchAccuracy, Faults) {
    let mut faults = Faults::new();
    let mut fault = |kind, what: String| faults.push((kind, what));
    let mut inputs = round.inputs.clone();
    inputs.sort_unstable();
    inputs.dedup();
    let is_list = inputs.last().is_none_or(|&last| (last as usize) < before.len() / 2);
    if inputs.len() != row.searched as usize || !is_list {
        let what = format!("{} nodes were searched, but the list has {} that differ", row.searched, inputs.len());
        fault(BreachKind::Search, what);
        return (SearchAccuracy::default(), faults);
    }
    let params = DualParams { row: 0, ..round.params };
    let again = |(&input, found): (&u32, &Move)| (search_again(input, &params, before), *found);
    let pairs: Vec<(Move, Move)> = round.inputs.par_iter().zip(&round.found).map(again).collect();
    // A move that met taken nodes is none by now; that it was found, the count below tells.
    let differs = |(expected, found): &&(Move, Move)| found.output != NO_NODE && !is_same(expected, found);
    if let Some((expected, found)) = pairs.iter().find(differs) {
        fault(BreachKind::Search, format!("the search found {found:?}, and {expected:?} on the host"));
    }
    let offered: Vec<&(Move, Move)> = pairs.iter().filter(|(expected, _)| expected.output != NO_NODE).collect();
    let offers: Vec<Option<Offer>> =
        offered.par_iter().map(|(expected, found)| offer(before, expected, found)).collect();
    if let Some(((expected, _), _)) = offered.iter().zip(&offers).find(|(_, offer)| offer.is_none()) {
        fault(BreachKind::Search, format!("{expected:?} is no move"));
    }
    let offers: Vec<Offer> = offers.into_iter().flatten().collect();
    if let Some(Offer { input, direct, exact, .. }) = offers.iter().find(|offer| !is_held(offer)) {
        fault(BreachKind::Offer, format!("a move of {input} is offered for {direct:e}, in f64 it is worth {exact:e}"));
    }
    let won: Vec<&Move> = round.found.iter().filter(|found| found.has_won()).collect();
    let counts = [offered.len(), won.len(), won.len()];
    if counts != [row.found, row.owned, row.applied].map(|count| count as usize) {
        let what = format!("{} moves found, {} owned, {} applied", row.found, row.owned, row.applied);
        fault(BreachKind::Search, format!("{what}, but there are {counts:?}"));
    }
    let root = f64::from(before[ROOT as usize].aabb().half_area());
    let worth = |area: f64| if root > 0.0 { SahModel::default().c_traversal * area / root } else { 0.0 };
    let promised = worth(won.iter().map(|found| f64::from(found.area_decrease)).sum());
    // Each term loses less than a unit of the sum; sums and products are f64.
    let bound = worth(won.len() as f64 / f64::from(scale_of(root))) + 1e-12 * promised;
    let apart = (row.predicted_decrease - promised).abs();
    if apart.partial_cmp(&bound).is_none_or(std::cmp::Ordering::is_gt) {
        let what = format!("the moves made promise {promised}, not {}", row.predicted_decrease);
        fault(BreachKind::Prediction, format!("{what}: {apart:.1e} apart, {bound:.1e} is allowed"));
    }
    (SearchAccuracy::of(row.searched, &offers), faults)
}

/// The search kernel, run natively: the same bits as on a device.
fn search_again(input: u32, params: &DualParams, nodes: &[Node]) -> Move {
    let mut report = [0; REPORT_WORDS as usize];
    search(input, params, nodes, AtomicU32::from_mut_slice(&mut report))
}

/// Whether a device found this, and perhaps made it: then the kernel that made it has left other nodes in place of the outputs.
fn is_same(expected: &Move, found: &Move) -> bool {
    if found.has_won() {
        let worth = |found: &Move| (found.input(), found.area_decrease.to_bits());
        return expected.output != NO_NODE && worth(expected) == worth(found);
    }
    if expected.output == NO_NODE {
        found.output == NO_NODE
    } else {
        Move { input: found.input(), ..*found } == *expected
    }
}

/// There is no walk whose sum could drift: both sums are the direct one.
fn offer(nodes: &[Node], expected: &Move, found: &Move) -> Option<Offer> {
    let exact = dual_area_decrease(nodes, expected)?;
    let direct = if found.output == NO_NODE { expected.area_decrease } else { found.area_decrease };
    Some(Offer { input: expected.input, output: expected.output, walked: direct, direct, exact })
}

/// An offer must lower the sum of areas in f64, and be right to a factor of two: roundings are less than itself, or the search
/// refuses it.
fn is_held(offer: &Offer) -> bool {
    offer.exact > 0.0 && (f64::from(offer.direct) - offer.exact).abs() <= f64::from(offer.direct)
}

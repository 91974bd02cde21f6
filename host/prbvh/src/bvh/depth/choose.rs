//! Which subtrees are built anew: all that lies too deep is in one of them, and the cost rises as little as can be.

use super::ceil_log2;
use super::rebuild::Rebuilt;
use super::shape::Shape;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Levels beyond the fewest that a subtree is to have left. Without one it can only be halved again and again; each one more lets splits
/// be where the SAH wants them, in a subtree twice as large.
const SPARES: [u32; 4] = [0, 1, 2, 4];

/// Their places, in order.
///
/// The candidates are the lowest ancestors of what is too deep that have levels enough for their leaves, without and with some to spare.
/// All of them are tried. Of nested ones the upper one is taken where it costs no more than those below together.
pub(super) fn choose(shape: &Shape) -> Vec<usize> {
    let candidates: BTreeSet<usize> = SPARES.iter().flat_map(|&spare| lowest(shape, spare)).collect();
    let candidates: Vec<usize> = candidates.into_iter().collect();
    let changes: Vec<f64> = candidates.par_iter().map(|&place| Rebuilt::of(shape, place).area_change()).collect();
    cheapest(shape, &candidates, &changes)
}

/// The lowest nodes that have levels enough for their leaves and so many to spare, above all that lies too deep; the root also with fewer.
/// A few lie below others.
fn lowest(shape: &Shape, spare: u32) -> Vec<usize> {
    let mut found = Vec::new();
    // Whether something below lies too deep and in none of them.
    let mut is_open = vec![false; shape.len()];
    for place in (0..shape.len()).rev() {
        is_open[place] = match shape.children(place) {
            None => !shape.fits(place),
            Some([left, right]) if is_open[left] || is_open[right] => {
                let need = ceil_log2(shape.leaves(place).into());
                let is_enough = need + spare <= shape.levels_left(place) || place == 0;
                if is_enough {
                    found.push(place);
                }
                !is_enough
            }
            Some(_) => false,
        };
    }
    found
}

/// The candidates that change the sum of areas least and leave nothing too deep.
fn cheapest(shape: &Shape, candidates: &[usize], changes: &[f64]) -> Vec<usize> {
    let mut own = vec![f64::INFINITY; shape.len()];
    for (&place, &change) in candidates.iter().zip(changes) {
        own[place] = change;
    }
    // Least change with all of a subtree within the bound; without the node itself.
    let mut least = vec![0.0; shape.len()];
    let below = |least: &[f64], place: usize| match shape.children(place) {
        _ if shape.fits(place) => 0.0,
        Some([left, right]) => least[left] + least[right],
        None => f64::INFINITY,
    };
    for place in (0..shape.len()).rev() {
        least[place] = below(&least, place).min(own[place]);
    }
    let mut chosen = Vec::new();
    let mut place = 0;
    while place < shape.len() {
        if shape.fits(place) {
            place = shape.end(place);
        } else if own[place] <= below(&least, place) {
            chosen.push(place);
            place = shape.end(place);
        } else {
            place += 1;
        }
    }
    chosen
}

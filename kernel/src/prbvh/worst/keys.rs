//! How bad an internal node is, and what became of it.
//!
//! A key is the bits of the measure with two of them put to other use: the sign says that the node is tired, the last digit that it is in the pool.

use crate::math::{max, min, reciprocal};
use crate::mem::AtomicU32;

/// Nobody has looked at the node.
pub const COLD: u32 = 0;
/// The node is on the fringe, and nobody has looked at it.
pub const ON_FRINGE: u32 = TIRED;

/// The node was searched in vain.
pub const TIRED: u32 = 0x8000_0000;
/// The node is in the pool.
pub const IN_POOL: u32 = 1;

/// Measure of a node whose links changed: unlike any other, so that its next one is new.
pub const STALE: u32 = 2;
/// Measure of a node that no move can make better: it is always tired.
const HOPELESS: u32 = 4;

/// The smallest of the two areas, and their mean, count as this part of the parent's at least.
const LEAST_PART: f32 = 1e-6;

/// The measure of a node: `A · (A / mean of the children's areas) · (A / the smaller of them)`, the product of the three of Bittner et al.; bits without
/// [`TIRED`] and [`IN_POOL`].
#[inline(always)]
#[must_use]
pub fn measure(area: f32, left_area: f32, right_area: f32) -> u32 {
    let least = LEAST_PART * area;
    let mean = max(0.5 * (left_area + right_area), least);
    let smaller = max(min(left_area, right_area), least);
    let measure = area * (area * reciprocal(mean)) * (area * reciprocal(smaller));
    // Not a number that is no area; its reciprocal has no meaning either.
    if area > f32::MIN_POSITIVE && measure > f32::MIN_POSITIVE {
        measure.to_bits() & !(TIRED | IN_POOL)
    } else {
        HOPELESS
    }
}

/// The key of a node that was not searched yet.
#[inline(always)]
#[must_use]
pub fn fresh(measure: u32) -> u32 {
    if measure == HOPELESS { HOPELESS | TIRED } else { measure }
}

/// Whether a node with this key waits for its search.
#[inline(always)]
#[must_use]
pub fn waits(key: u32) -> bool {
    key & TIRED == 0
}

/// The measure in a key.
#[inline(always)]
#[must_use]
pub fn measure_of(key: u32) -> u32 {
    key & !(TIRED | IN_POOL)
}

/// Two sides of `places` places, of which one is filled; its length is a word of the books.
#[inline(always)]
pub fn push(list: &[AtomicU32], places: u32, side: u32, length: &AtomicU32, v: u32) {
    let place = length.add(1);
    // A list has room for every internal node once. Beyond it there is nothing to write.
    if place < places {
        list[(side * places + place) as usize].store(v);
    }
}

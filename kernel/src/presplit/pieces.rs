//! The pieces of a triangle.
//!
//! Source: Karras & Aila 2013, §4.3: a piece is cut by the coarsest plane of the scene's grid that goes through it, so that pieces of different triangles end at the same planes, and its
//! splits go to both sides in proportion to their extents. Kind: map; each place is written by one invocation.

use super::clip::{is_inverted, sides};
use super::{Grid, MOST_SPLITS};
use crate::aabb::Aabb;
use crate::math::{max, reciprocal};
use crate::mem::Slot;
use crate::setup::Triangle;
use bytemuck::{Pod, Zeroable};

/// Triangle of a place that no piece needed: a box had no plane through it any more.
pub const NO_PIECE: u32 = u32::MAX;

/// Pieces that may wait. The side with fewer splits comes first, so that each waiting one has at most half the splits of the one below it.
const WAITING: usize = 13;
/// Cuts of an invocation; afterwards pieces stay as they are.
const MOST_CUTS: u32 = 2 * MOST_SPLITS;

/// Push constants of [`pieces`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PiecesParams {
    /// Invocations: one per triangle.
    pub count: u32,
    /// The scene's grid.
    pub grid: Grid,
}

/// A part of a triangle.
#[derive(Clone, Copy)]
struct Part {
    aabb: Aabb,
    /// Pieces that it is to become.
    pieces: u32,
}

/// Invocation `i` cuts triangle `i`. Reads `triangles[n]`, `splits[n]` and `places[n]`, writes the boxes of its pieces to `boxes` from its place on and its number to
/// `owners` beside them.
#[inline(always)]
pub fn pieces(
    i: u32,
    params: &PiecesParams,
    triangles: &[Triangle],
    splits: &[u32],
    places: &[u32],
    boxes: &[Slot<Aabb>],
    owners: &[Slot<u32>],
) {
    let triangle = triangles[i as usize];
    let grid = params.grid;
    let mut part = Part { aabb: triangle.aabb(), pieces: splits[i as usize] + 1 };
    let mut place = places[i as usize];
    let end = place + part.pieces;
    let mut waiting = [Part { aabb: Aabb::EMPTY, pieces: 0 }; WAITING];
    let mut depth = 0usize;
    let mut cuts = 0u32;
    // A piece or a cut each time.
    for _ in 0..MOST_CUTS + MOST_SPLITS + 1 {
        let mut is_piece = part.pieces == 1 || cuts == MOST_CUTS;
        if !is_piece {
            let plane = grid.plane(&part.aabb);
            is_piece = !plane.parts;
            if plane.parts {
                cuts += 1;
                let (below, above) = sides(&triangle, &part.aabb, &plane);
                if is_inverted(&below) {
                    part.aabb = above;
                } else if is_inverted(&above) {
                    part.aabb = below;
                } else {
                    let lower = share(part.pieces, &below, &above);
                    let upper = part.pieces - lower;
                    let (less, more) = if lower <= upper {
                        (Part { aabb: below, pieces: lower }, Part { aabb: above, pieces: upper })
                    } else {
                        (Part { aabb: above, pieces: upper }, Part { aabb: below, pieces: lower })
                    };
                    waiting[depth] = more;
                    depth += 1;
                    part = less;
                }
            }
        }
        if is_piece {
            boxes[place as usize].set(part.aabb);
            owners[place as usize].set(i);
            place += 1;
            if depth == 0 {
                break;
            }
            depth -= 1;
            part = waiting[depth];
        }
    }
    while place < end {
        boxes[place as usize].set(part.aabb);
        owners[place as usize].set(NO_PIECE);
        place += 1;
    }
}

/// Pieces of the lower of two sides, at least one of each.
#[inline(always)]
fn share(pieces: u32, below: &Aabb, above: &Aabb) -> u32 {
    let (lower, upper) = (longest(below), longest(above));
    let sum = lower + upper;
    if sum <= 0.0 {
        return 1;
    }
    let share = (pieces as f32 * (lower * reciprocal(sum)) + 0.5) as u32;
    if share < 1 {
        1
    } else if share > pieces - 1 {
        pieces - 1
    } else {
        share
    }
}

#[inline(always)]
fn longest(aabb: &Aabb) -> f32 {
    max(max(aabb.max[0] - aabb.min[0], aabb.max[1] - aabb.min[1]), aabb.max[2] - aabb.min[2])
}

//! k-means from the top down: each part becomes up to `k` clusters of boxes that are alike, and these a binary subtree by agglomeration.
//!
//! Source: Meister & Bittner 2016. A box is a point of six coordinates, its smallest and its largest corner (§3.1). A *part* is a run of places in the
//! order of the references. It is *large* with `4k` references or more; smaller ones are split in two, as in the paper.
//!
//! | kernel | kind | in → out |
//! |---|---|---|
//! | [`centres()`] | map over large parts | references → first centres, the frame of each part |
//! | [`assign()`] | workgroups over places | centres → nearest cluster of each reference, sums of these |
//! | [`means()`] | map over clusters | sums → centres |
//! | [`tally()`] | scatter over places | nearest clusters → boxes of the clusters |
//! | [`join()`] | a workgroup for each large part | clusters → binary subtree, next parts |
//! | [`relabel()`] | map over places | nearest clusters → the part that each place belongs to |
//! | `sort_*` | | parts of the places → references, part by part |
//! | [`halve()`] | map over small parts | references → subtree of each small part |
//!
//! All but the last are a level; each level is a few dispatches, whatever the number of its parts.
//!
//! # The same bits everywhere
//! Coordinates become whole numbers below 2²² in the *frame* of their part: its origin is the smallest corner of the part's box, its scale a power of two.
//! Sums of whole numbers have one result in any order, and so have their quotients. A float32 holds each coordinate, and differences of two, without error.
//!
//! # Numbers of nodes
//! A part of several references is the internal node of its last place if it is a left child, else that of its first (Karras 2012, §3). What belongs to
//! cluster `j` of a large part that begins at place `s` is in *slot* `s/4 + j`: a large part has four places for each of its clusters.

mod assign;
mod centres;
mod halve;
mod join;
mod means;

pub use assign::{ASSIGN_WORDS, AssignParams, CHUNK, TallyParams, assign, tally};
pub use centres::{CentresParams, centres};
pub use halve::{HalveParams, halve};
pub use join::{JOIN_WORDS, JoinParams, RelabelParams, join, relabel};
pub use means::{MeansParams, means};

use crate::aabb::Aabb;
use crate::math::{max, umin};
use crate::node::{AtomicNode, RIGHT};
use crate::trace::random::hash;
use bytemuck::{Pod, Zeroable};

/// Most clusters of a part.
pub const MOST_CLUSTERS: u32 = 64;
/// Most references that are drawn for a centre. With [`MOST_CLUSTERS`] the loops of [`centres()`] make fewer than 65,535 rounds.
pub const MOST_CANDIDATES: u32 = 30;
/// Fewest references of a large part for each cluster.
pub const PER_CLUSTER: u32 = 4;

/// Words of a slot of tallies: six sums of two words, the references, the box as numbers that grow as it does, and of the first slot of a part the last round
/// in which a reference came to another cluster, plus 1.
pub const TALLY_WORDS: u32 = 20;
const COUNT: u32 = 12;
const EXTENTS: u32 = 13;
const MOVED: u32 = 19;

/// Bit of a size: the part is a left child.
pub const LEFT: u32 = 1 << 31;
/// Label of a place that is in no large part.
const NONE: u32 = u32::MAX;

/// A large part, 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Part {
    /// Smallest corner of a box around it.
    pub min: [f32; 3],
    /// Its first place.
    pub start: u32,
    /// Largest corner.
    pub max: [f32; 3],
    /// References, with [`LEFT`].
    pub size: u32,
}

/// Where the points of a part lie, 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Frame {
    /// What becomes 0.
    pub origin: [f32; 3],
    /// Steps of a unit, a power of two.
    pub scale: f32,
}

/// A box in a frame: whole numbers below 2²².
pub type Point = [f32; 6];

/// Coordinates of a frame are below 2 to this.
const FRAME_BITS: u32 = 22;

impl Frame {
    /// Of what lies in a box.
    #[inline(always)]
    #[must_use]
    pub fn of(min: [f32; 3], max_corner: [f32; 3]) -> Self {
        let extent = max(max(max_corner[0] - min[0], max_corner[1] - min[1]), max_corner[2] - min[2]);
        // Of `m · 2^x` with `1 <= m < 2` the scale is `2^(21-x)`; coordinates of the safe range differ by 2^-62 or more.
        let exponent = extent.to_bits() >> 23;
        let scale = f32::from_bits(umin(2 * 127 + FRAME_BITS - 1 - exponent, 254) << 23);
        Self { origin: min, scale }
    }

    #[inline(always)]
    fn step(self, x: f32, axis: usize) -> f32 {
        ((x - self.origin[axis]) * self.scale) as u32 as f32
    }

    /// The box of a reference in the part.
    #[inline(always)]
    #[must_use]
    pub fn point(self, aabb: Aabb) -> Point {
        let Aabb { min, max } = aabb;
        [
            self.step(min[0], 0),
            self.step(min[1], 1),
            self.step(min[2], 2),
            self.step(max[0], 0),
            self.step(max[1], 1),
            self.step(max[2], 2),
        ]
    }
}

#[inline(always)]
fn square(x: f32) -> f32 {
    x * x
}

/// Squared.
#[inline(always)]
fn distance(a: Point, b: Point) -> f32 {
    square(a[0] - b[0])
        + square(a[1] - b[1])
        + square(a[2] - b[2])
        + square(a[3] - b[3])
        + square(a[4] - b[4])
        + square(a[5] - b[5])
}

/// What the draws of a part are made of: a part has a start and a length that no other one has.
#[inline(always)]
fn key(seed: u32, start: u32, size: u32) -> u32 {
    hash(hash(seed ^ start).wrapping_add(size))
}

/// The place, from the start of the part, that is drawn by this number.
#[inline(always)]
fn drawn(key: u32, number: u32, size: u32) -> u32 {
    hash(key.wrapping_add(number.wrapping_mul(0x9e37_79b9))) % size
}

/// The node of a part.
#[inline(always)]
fn node_of(start: u32, size: u32, is_left: bool, references: u32) -> u32 {
    if size == 1 {
        references - 1 + start
    } else if is_left {
        start + size - 1
    } else {
        start
    }
}

/// Makes the parts of `left` and `right` references from `start` on the children of a node.
#[inline(always)]
fn link(node: u32, start: u32, left: u32, right: u32, references: u32, nodes: &[AtomicNode]) {
    let left_node = node_of(start, left, true, references);
    let right_node = node_of(start + left, right, false, references);
    nodes[node as usize].set_down(left_node);
    nodes[left_node as usize].set_up(right_node);
    nodes[right_node as usize].set_up(node | RIGHT);
}

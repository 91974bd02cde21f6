//! Which nodes of a walk have a place below them, without a walk up from that place for each.

use super::rounds::Rounds;
use crate::math::select;
use crate::node::{Links, RIGHT};

/// Levels of a way that are kept, from the top: more than the trees of scenes have.
const LEVELS: u32 = 64;

/// The way from a subtree, a child of a pivot, down to a place in it: a bit for each level, whether it leads to the right.
#[derive(Clone, Copy)]
pub(super) struct Way {
    low: u32,
    high: u32,
    /// Levels between the subtree's root and the place.
    length: u32,
}

impl Way {
    /// To no place.
    pub(super) const NOWHERE: Self = Self { low: 0, high: 0, length: 0 };

    /// To `place`, which is below `pivot`.
    #[inline(always)]
    pub(super) fn to<T: Links + ?Sized>(place: u32, pivot: u32, nodes: &T, rounds: &mut Rounds) -> Self {
        let mut way = Self::NOWHERE;
        let mut w = place;
        while w != pivot && rounds.next() {
            let up = nodes.up(w);
            let is_right = up & RIGHT != 0;
            w = if is_right { up } else { nodes.up(up) } & !RIGHT;
            if w != pivot {
                // Those of the lowest levels fall out.
                way.high = way.high << 1 | way.low >> 31;
                way.low = way.low << 1 | is_right as u32;
                way.length += 1;
            }
        }
        way.length = select(way.length < LEVELS, way.length, LEVELS);
        way
    }

    /// Whether the node at `depth`, from 1 on, is a right child.
    #[inline(always)]
    fn is_right(&self, depth: u32) -> bool {
        let level = depth - 1;
        select(level < 32, self.low, self.high) >> (level & 31) & 1 != 0
    }
}

/// Where a walk through the subtree stands.
#[derive(Clone, Copy)]
pub(super) struct Stand {
    /// Levels below the subtree's root.
    depth: u32,
    /// As many nodes, from the root on, are on the way as well.
    joined: u32,
}

impl Stand {
    /// At the root of a subtree that the way leads through, or of another one.
    #[inline(always)]
    pub(super) fn new(is_on_way: bool) -> Self {
        Self { depth: 0, joined: is_on_way as u32 }
    }

    /// Whether the node is the place, or has it below it.
    #[inline(always)]
    pub(super) fn is_on_way(&self) -> bool {
        self.joined > self.depth
    }

    /// On to the left child.
    #[inline(always)]
    pub(super) fn down(&mut self, way: &Way) {
        self.depth += 1;
        self.enter(way, false);
    }

    /// From the left child to the right one.
    #[inline(always)]
    pub(super) fn aside(&mut self, way: &Way) {
        self.joined = select(self.joined < self.depth, self.joined, self.depth);
        self.enter(way, true);
    }

    /// Back to the parent.
    #[inline(always)]
    pub(super) fn up(&mut self) {
        self.joined = select(self.joined < self.depth, self.joined, self.depth);
        self.depth -= 1;
    }

    #[inline(always)]
    fn enter(&mut self, way: &Way, is_right: bool) {
        if self.joined == self.depth && self.depth <= way.length && way.is_right(self.depth) == is_right {
            self.joined += 1;
        }
    }
}

//! The walk of a search: the subtrees beside the way up, each in depth-first order, without a stack.
//!
//! Every step looks at one node, whatever for, so that invocations that do different things wait for memory together.

use crate::aabb::Aabb;
use crate::node::{Node, RIGHT};

/// A node is visited on the way down.
const ENTER: u32 = 0;
/// It is visited on the way up.
const LEAVE: u32 = 1;
/// It is the pivot, above which the next one is.
const CLIMB: u32 = 2;
/// It is the new pivot, whose left child is the subtree to search.
const ASIDE: u32 = 3;

/// Where a walk is.
#[derive(Clone, Copy)]
pub(super) struct Walk {
    /// The node to look at.
    pub(super) v: u32,
    /// An ancestor of the input.
    pub(super) pivot: u32,
    /// Its child that is searched.
    pub(super) top: u32,
    /// The box of the pivot without the input.
    pub(super) pivot_box: Aabb,
    step: u32,
}

impl Walk {
    /// A walk that begins with the `sibling` of the input.
    #[inline(always)]
    pub(super) fn new(sibling: u32, parent: u32) -> Self {
        Self { v: sibling, pivot: parent, top: sibling, pivot_box: Aabb::EMPTY, step: ENTER }
    }

    /// Whether the step only leads to the next pivot.
    #[inline(always)]
    pub(super) fn climbs(&mut self, node: &Node) -> bool {
        let climbs = self.step >= CLIMB;
        if self.step == CLIMB && node.up & RIGHT != 0 {
            self.pivot = node.up & !RIGHT;
            self.v = self.pivot;
            self.step = ASIDE;
        } else if climbs {
            self.top = if self.step == CLIMB { node.up } else { node.down };
            self.v = self.top;
            self.step = ENTER;
        }
        climbs
    }

    /// Whether the node is visited on the way down.
    #[inline(always)]
    pub(super) fn enters(&mut self, node: &Node) -> bool {
        let enters = self.step == ENTER;
        if enters && self.v == self.top {
            self.pivot_box = self.pivot_box.union(node.aabb());
            if node.up & RIGHT != 0 {
                self.pivot = node.up & !RIGHT;
            }
        }
        enters
    }

    /// On to the children.
    #[inline(always)]
    pub(super) fn descend(&mut self, node: &Node) {
        self.v = node.down;
        self.step = ENTER;
    }

    /// On to the next subtree in depth-first order, over its ancestors; whether there is one below the pivot.
    #[inline(always)]
    pub(super) fn goes_on(&mut self, node: &Node) -> bool {
        if self.v == self.top {
            return false;
        }
        self.step = if node.up & RIGHT == 0 { ENTER } else { LEAVE };
        self.v = node.up & !RIGHT;
        true
    }

    /// Whether the step looks at the pivot, to go on above it.
    #[inline(always)]
    pub(super) fn is_at_pivot(&self) -> bool {
        self.step == CLIMB
    }

    /// On to the next pivot.
    #[inline(always)]
    pub(super) fn climb(&mut self) {
        self.v = self.pivot;
        self.step = CLIMB;
    }
}

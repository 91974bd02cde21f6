//! Rotations: a node and a child of its sibling, or two cousins, change places wherever that makes the boxes between them smaller.
//!
//! ```text
//!        p                p                     p                p
//!      /   \            /   \                 /   \            /   \
//!     l     r    →     rl    r               l     r    →     l     r
//!          / \              / \             / \   / \        / \   / \
//!        rl   rr           l   rr         ll  lr rl  rr    rl  lr ll  rr
//! ```
//! Source: Kensler 2008; Kopta et al. 2012, who rotate in the refit of each frame. Kind: [`climb`](mod@crate::climb).
//!
//! A rotation below `p` changes the boxes of `l` and `r` and no other, since `p` has the same leaves before and after. So it is judged, and made,
//! by the invocation that completes `p`, when all below is done and nobody is there any more; links and boxes go through atomics as in every
//! climb, and what is decided depends on no order.
//!
//! # Annealing
//! At a temperature above 0 a node is offered one rotation at random, which is made if it lowers the areas, or by chance where it raises them, the
//! less often the more. The chance is that of Metropolis et al. 1953, `exp(-d/T)`, with `log2(1 + f)` taken as `f`: an exponential would have other
//! last digits on other devices. The numbers are a hash of node and pass.

use crate::aabb::Aabb;
use crate::climb::climb;
use crate::kept::AtomicKept;
use crate::mem::AtomicU32;
use crate::node::{AtomicNode, Links, RIGHT};
use crate::status::{self, APPLIED, GREW, SHRUNK};
use crate::sum::Sum;
use crate::trace::random::hash;
use bytemuck::{Pod, Zeroable};

/// Rotations of two cousins are tried, too (Kensler 2008); else of a child and a grandchild only.
pub const COUSINS: u32 = 1;
/// The children that a node had in the best tree are noted.
pub const KEEPS: u32 = 2;

/// The areas that a rotation changes must fall by this part of them: each is off by no more than 4 roundings of 2^-24.
pub const RELATIVE_THRESHOLD: f32 = 1.0 / (1 << 20) as f32;

/// Push constants of [`rotate`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RotateParams {
    /// Invocations: one per leaf, `n`.
    pub count: u32,
    /// [`COUSINS`], [`KEEPS`].
    pub flags: u32,
    /// Number of the pass, mixed with the seed: what random numbers are made of.
    pub key: u32,
    /// Temperature, scene units²; at 0 each node makes the best of its rotations.
    pub temperature: f32,
    /// Units of a sum in an area ([`crate::sum`]).
    pub scale: f32,
    /// Number of the best tree.
    pub epoch: u32,
    /// Which nodes are offered a rotation.
    pub offer: Offer,
}

/// Which nodes are offered a rotation in a refit: one pass over the tree after another need not come to all. Each level of a tree has about the same part of
/// its cost, and the lower ones have nearly all of its nodes: who is large is worth it in every pass.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Offer {
    /// Nodes whose number has the bits of `turn` in these places are; 0 offers to all.
    pub mask: u32,
    /// Whose turn it is.
    pub turn: u32,
    /// Nodes of at least this half area are in any case, scene units².
    pub area: f32,
}

impl Offer {
    /// To every node.
    pub const TO_ALL: Self = Self { mask: 0, turn: 0, area: 0.0 };

    /// Whether it is for node `p` with the box `aabb`.
    #[inline(always)]
    #[must_use]
    pub fn is_for(self, p: u32, aabb: Aabb) -> bool {
        (p ^ self.turn) & self.mask == 0 || aabb.half_area() >= self.area
    }
}

/// Invocation `i` climbs from leaf `i`, makes boxes anew and rotates. Reads and writes `nodes[2n-1]`, `arrivals[n-1]`, which starts as 0 and ends as 2
/// everywhere if the links are a tree, and with [`KEEPS`] `kept[n-1]`. Adds to the rotations made, and to what areas lost and gained, in `report`.
#[inline(always)]
pub fn rotate(
    i: u32,
    params: &RotateParams,
    nodes: &[AtomicNode],
    arrivals: &[AtomicU32],
    kept: &[AtomicKept],
    report: &[AtomicU32],
) {
    let params = *params;
    climb(i, params.count, nodes, arrivals, move |p, left, right| {
        let aabb = united(left, right, nodes);
        if !params.offer.is_for(p, aabb) {
            nodes[p as usize].set_aabb(aabb);
            return;
        }
        let family = Family::of(p, left, right, params.count - 1, nodes);
        let boxes = family.boxes(nodes);
        let choice =
            if params.temperature > 0.0 { family.random(&params, &boxes) } else { family.best(params.flags, &boxes) };
        if choice.kind == NONE {
            nodes[p as usize].set_aabb(boxes.left.union(boxes.right));
        } else {
            if params.flags & KEEPS != 0 {
                kept[p as usize].keep(left, right, params.epoch);
                if family.left_opens {
                    kept[left as usize].keep(family.ll, family.lr, params.epoch);
                }
                if family.right_opens {
                    kept[right as usize].keep(family.rl, family.rr, params.epoch);
                }
            }
            family.make(choice.kind, nodes);
            status::count(report, 0, APPLIED, 1);
            Sum::of(choice.decrease, params.scale).add_to(report, SHRUNK);
            Sum::of(-choice.decrease, params.scale).add_to(report, GREW);
        }
    });
}

/// The box around two nodes.
#[inline(always)]
pub(crate) fn united(left: u32, right: u32, nodes: &[AtomicNode]) -> Aabb {
    nodes[left as usize].aabb().union(nodes[right as usize].aabb())
}

/// Makes the best of the rotations of `p`, if there is one, and gives it its box.
#[inline(always)]
pub(crate) fn rotate_best(p: u32, left: u32, right: u32, internal: u32, flags: u32, nodes: &[AtomicNode]) {
    let family = Family::of(p, left, right, internal, nodes);
    let boxes = family.boxes(nodes);
    let choice = family.best(flags, &boxes);
    if choice.kind == NONE {
        nodes[p as usize].set_aabb(boxes.left.union(boxes.right));
    } else {
        family.make(choice.kind, nodes);
    }
}

/// How many kinds of rotations there are: each child with either child of the other, and two of the four pairs of cousins, which the others mirror.
const KINDS: u32 = 6;
/// Not to rotate.
const NONE: u32 = KINDS;

/// A rotation, and by how much the areas fall.
#[derive(Clone, Copy)]
struct Choice {
    kind: u32,
    /// Scene units².
    decrease: f32,
}

/// The boxes of a family.
#[derive(Clone, Copy)]
struct Boxes {
    left: Aabb,
    right: Aabb,
    ll: Aabb,
    lr: Aabb,
    rl: Aabb,
    rr: Aabb,
}

/// A node, its children and grandchildren. Those of a leaf are the leaf itself, and not used.
#[derive(Clone, Copy)]
struct Family {
    p: u32,
    left: u32,
    right: u32,
    left_opens: bool,
    right_opens: bool,
    ll: u32,
    lr: u32,
    rl: u32,
    rr: u32,
}

impl Family {
    #[inline(always)]
    fn of(p: u32, left: u32, right: u32, internal: u32, nodes: &[AtomicNode]) -> Self {
        let (left_opens, right_opens) = (left < internal, right < internal);
        let mut family = Self { p, left, right, left_opens, right_opens, ll: left, lr: left, rl: right, rr: right };
        if left_opens {
            family.ll = nodes.down(left);
            family.lr = nodes.up(family.ll);
        }
        if right_opens {
            family.rl = nodes.down(right);
            family.rr = nodes.up(family.rl);
        }
        family
    }

    #[inline(always)]
    fn boxes(self, nodes: &[AtomicNode]) -> Boxes {
        Boxes {
            left: nodes[self.left as usize].aabb(),
            right: nodes[self.right as usize].aabb(),
            ll: nodes[self.ll as usize].aabb(),
            lr: nodes[self.lr as usize].aabb(),
            rl: nodes[self.rl as usize].aabb(),
            rr: nodes[self.rr as usize].aabb(),
        }
    }

    /// By how much the areas of the children fall by a rotation that is possible.
    #[inline(always)]
    fn decrease(self, kind: u32, boxes: &Boxes) -> f32 {
        let Boxes { left, right, ll, lr, rl, rr } = *boxes;
        let from_left = |a: Aabb, b: Aabb| left.half_area() - a.union(b).half_area();
        let from_right = |a: Aabb, b: Aabb| right.half_area() - a.union(b).half_area();
        match kind {
            0 => from_right(left, rr),
            1 => from_right(rl, left),
            2 => from_left(right, lr),
            3 => from_left(ll, right),
            4 => from_left(rl, lr) + from_right(ll, rr),
            _ => from_left(rr, lr) + from_right(rl, ll),
        }
    }

    /// Whether a rotation is possible.
    #[inline(always)]
    fn has(self, kind: u32, flags: u32) -> bool {
        let cousins = self.left_opens && self.right_opens && flags & COUSINS != 0;
        (kind < 2 && self.right_opens) || ((kind == 2 || kind == 3) && self.left_opens) || (kind >= 4 && cousins)
    }

    /// The better one of two; the first of equals.
    #[inline(always)]
    fn better(self, best: Choice, kind: u32, flags: u32, least: f32, boxes: &Boxes) -> Choice {
        let mut best = best;
        if self.has(kind, flags) {
            let decrease = self.decrease(kind, boxes);
            // Written so that a NaN is none.
            if decrease > best.decrease && decrease > least {
                best = Choice { kind, decrease };
            }
        }
        best
    }

    /// The best of all rotations. No loop: a device may count its rounds.
    #[inline(always)]
    fn best(self, flags: u32, boxes: &Boxes) -> Choice {
        let (left, right) = (boxes.left.half_area(), boxes.right.half_area());
        let (of_left, of_right) = (left * RELATIVE_THRESHOLD, right * RELATIVE_THRESHOLD);
        let mut best = Choice { kind: NONE, decrease: 0.0 };
        // Whoever takes the other child in does not become smaller than that is.
        if left < right {
            best = self.better(best, 0, flags, of_right, boxes);
            best = self.better(best, 1, flags, of_right, boxes);
        } else {
            best = self.better(best, 2, flags, of_left, boxes);
            best = self.better(best, 3, flags, of_left, boxes);
        }
        best = self.better(best, 4, flags, of_left + of_right, boxes);
        self.better(best, 5, flags, of_left + of_right, boxes)
    }

    /// One of the rotations, or none.
    #[inline(always)]
    fn random(self, params: &RotateParams, boxes: &Boxes) -> Choice {
        let word = hash(self.p.wrapping_add(params.key));
        let kind = ((word >> 16) * KINDS) >> 16;
        let none = Choice { kind: NONE, decrease: 0.0 };
        if !self.has(kind, params.flags) {
            return none;
        }
        let decrease = self.decrease(kind, boxes);
        // Written so that a NaN is none.
        let is_made = decrease > 0.0 || -decrease < params.temperature * exponential(hash(word));
        if is_made { Choice { kind, decrease } } else { none }
    }

    /// Makes a rotation.
    #[inline(always)]
    fn make(self, kind: u32, nodes: &[AtomicNode]) {
        let Self { p, left, right, ll, lr, rl, rr, .. } = self;
        let (mut first, mut second) = (left, right);
        if kind == 0 {
            join(right, left, rr, nodes);
            first = rl;
        } else if kind == 1 {
            join(right, rl, left, nodes);
            first = rr;
        } else if kind == 2 {
            join(left, right, lr, nodes);
            second = ll;
        } else if kind == 3 {
            join(left, ll, right, nodes);
            second = lr;
        } else if kind == 4 {
            join(left, rl, lr, nodes);
            join(right, ll, rr, nodes);
        } else {
            join(left, rr, lr, nodes);
            join(right, rl, ll, nodes);
        }
        join(p, first, second, nodes);
    }
}

/// Makes `a` and `b` the children of `v`, left and right.
#[inline(always)]
fn join(v: u32, a: u32, b: u32, nodes: &[AtomicNode]) {
    nodes[v as usize].set_down(a);
    nodes[a as usize].set_up(b);
    nodes[b as usize].set_up(v | RIGHT);
    nodes[v as usize].set_aabb(nodes[a as usize].aabb().union(nodes[b as usize].aabb()));
}

/// About `-ln(u)` of the number `u` in (0, 1) that the bits of `word` are: the leading zeros tell its power of two, what follows them the place between
/// two of these.
#[inline(always)]
#[must_use]
pub fn exponential(word: u32) -> f32 {
    const LN_2: f32 = core::f32::consts::LN_2;
    let zeros = (word | 1).leading_zeros();
    let behind = ((word | 1) << zeros) << 1;
    let fraction = (behind >> 8) as f32 * (1.0 / (1u32 << 24) as f32);
    LN_2 * ((zeros + 1) as f32 - fraction)
}

/// [`RotateParams::key`] of a pass.
#[inline(always)]
#[must_use]
pub fn key(seed: u32, pass: u32) -> u32 {
    hash(hash(seed).wrapping_add(pass))
}

//! Which nodes of a walk have a place below them, without a walk up from that place for each.

use crate::math::select;
use crate::node::{Links, RIGHT};
use crate::prbvh::rounds::Rounds;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{NO_NODE, Node, ROOT};
    use bytemuck::Zeroable;

    /// Links of a tree of so many leaves, which splits where `split` says how many of them go to the left.
    fn tree(leaves: u32, mut split: impl FnMut(u32) -> u32) -> Vec<Node> {
        let mut nodes = vec![Node { up: NO_NODE, ..Node::zeroed() }];
        let mut open = vec![(ROOT, leaves)];
        while let Some((v, leaves)) = open.pop() {
            if leaves == 1 {
                nodes[v as usize].down = NO_NODE;
                continue;
            }
            let left = nodes.len() as u32;
            nodes[v as usize].down = left;
            nodes.push(Node { up: left + 1, ..Node::zeroed() });
            nodes.push(Node { up: v | RIGHT, ..Node::zeroed() });
            let left_leaves = split(leaves);
            open.extend([(left, left_leaves), (left + 1, leaves - left_leaves)]);
        }
        nodes
    }

    fn ancestors(nodes: &[Node], v: u32) -> Vec<u32> {
        std::iter::successors(Some(v), |&v| Some(nodes.parent(v)).filter(|&p| p != NO_NODE)).collect()
    }

    /// Walks through the subtree of a child of the root as a search does that descends everywhere, and compares each node, on the way down and up, with what its
    /// links say down to so many levels; below them none may be on the way that is not.
    fn walk(nodes: &[Node], top: u32, place: u32, levels: usize) {
        let ancestors_of_place = ancestors(nodes, place);
        let has_place = ancestors_of_place.contains(&top);
        let rounds = &mut Rounds { left: 1 << 20, visits: 0 };
        let way = if has_place { Way::to(place, ROOT, nodes, rounds) } else { Way::NOWHERE };
        let mut stand = Stand::new(has_place);
        let mut v = top;
        let check = |v: u32, stand: &Stand| {
            let expected = ancestors_of_place.contains(&v);
            let is_near = ancestors(nodes, v).len() - 2 <= levels;
            assert!(stand.is_on_way() == expected || expected && !is_near, "{v} on the way to {place}");
        };
        loop {
            check(v, &stand);
            if nodes.down(v) != NO_NODE {
                stand.down(&way);
                v = nodes.down(v);
                continue;
            }
            while v != top && nodes.up(v) & RIGHT != 0 {
                v = nodes.up(v) & !RIGHT;
                stand.up();
                check(v, &stand);
            }
            if v == top {
                return;
            }
            v = nodes.up(v);
            stand.aside(&way);
        }
    }

    #[test]
    fn nodes_on_the_way_are_the_ancestors_of_the_place() {
        let mut state = 7u32;
        let random = |leaves: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1 + (state >> 8) % (leaves - 1)
        };
        let nodes = tree(40, random);
        for place in 1..nodes.len() as u32 {
            for top in [1, 2] {
                walk(&nodes, top, place, usize::MAX);
            }
        }
    }

    #[test]
    fn a_way_longer_than_is_kept_leads_nowhere_else() {
        let mut k = 0;
        // To the left and to the right in turn.
        let chain = |leaves: u32| {
            k += 1;
            if k % 3 == 0 { 1 } else { leaves - 1 }
        };
        let nodes = tree(150, chain);
        for place in 1..nodes.len() as u32 {
            for top in [1, 2] {
                walk(&nodes, top, place, LEVELS as usize);
            }
        }
        let depth = (0..nodes.len() as u32).map(|v| ancestors(&nodes, v).len()).max();
        assert!(depth > Some(100), "{depth:?}");
    }
}

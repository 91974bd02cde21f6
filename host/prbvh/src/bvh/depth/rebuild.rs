//! One subtree, built anew within the levels that are left.

use super::super::quality::half_area;
use super::super::{Bvh, Content};
use super::shape::Shape;
use prbvh_kernel::aabb::Aabb;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

/// Most levels of a subtree: more would help no cost, and 2^32 items of 2^90 add up in 128 bits.
const MOST_LEVELS: u32 = 90;

/// Levels that the subtrees which stay whole leave to the splits above them: none, so that as much as can be stays; some; and all, so that
/// nothing stays but leaves.
const SPARES: [u32; 3] = [0, 2, MOST_LEVELS];

/// A subtree that stays whole.
struct Item {
    place: usize,
    aabb: Aabb,
    leaves: u32,
    height: u32,
}

impl Item {
    fn of(shape: &Shape, place: usize) -> Self {
        let (aabb, leaves, height) = (shape.aabb(place), shape.leaves(place), shape.height(place));
        Self { place, aabb, leaves, height }
    }

    /// Its part of 2^levels: items fit into `levels` if and only if these add up to no more (Kraft 1949).
    fn weight(&self) -> u128 {
        1 << self.height
    }
}

/// What a new node has as a child.
#[derive(Clone, Copy)]
enum Child {
    Item(u32),
    Node(u32),
}

/// A subtree with other internal nodes above subtrees that stay whole.
pub(super) struct Rebuilt {
    /// The internal nodes, the root of the subtree first.
    nodes: Vec<u32>,
    /// What they have as children, each after its parent.
    children: Vec<[Child; 2]>,
    /// Roots of the subtrees that stay.
    items: Vec<u32>,
    area_change: f64,
}

impl Rebuilt {
    /// The subtree at `place`, whose leaves are no more than its levels can hold, in the cheapest way of those tried.
    pub(super) fn of(shape: &Shape, place: usize) -> Self {
        let mut best = Self::with(shape, place, SPARES[0]);
        for spare in &SPARES[1..] {
            let other = Self::with(shape, place, *spare);
            if other.area_change < best.area_change {
                best = other;
            }
        }
        best
    }

    fn with(shape: &Shape, place: usize, spare: u32) -> Self {
        let levels = shape.levels_left(place).min(MOST_LEVELS);
        let (dissolved, items) = taken_apart(shape, place, levels, spare);
        let before: f64 = dissolved.iter().map(|&place| shape.area(place)).sum();
        let nodes = dissolved.into_iter().map(|place| shape.node(place)).collect();
        let roots = items.iter().map(|item| shape.node(item.place)).collect();
        let (children, area) = Split::new(items).run(levels);
        Self { nodes, children, items: roots, area_change: area - before }
    }

    /// Change of the sum of half areas of internal nodes, scene units².
    pub(super) fn area_change(&self) -> f64 {
        self.area_change
    }

    /// Internal nodes.
    pub(super) fn nodes(&self) -> u32 {
        self.nodes.len() as u32
    }

    /// Puts it into the tree that it was made of.
    pub(super) fn apply(&self, tree: &mut Bvh) {
        let id = |child: Child| match child {
            Child::Item(item) => self.items[item as usize],
            Child::Node(node) => self.nodes[node as usize],
        };
        for (&parent, &pair) in self.nodes.iter().zip(&self.children) {
            let [left, right] = pair.map(id);
            tree.nodes[parent as usize].content = Content::Internal { left, right };
            tree.nodes[left as usize].parent = parent;
            tree.nodes[right as usize].parent = parent;
        }
        for (&parent, &pair) in self.nodes.iter().zip(&self.children).rev() {
            let [left, right] = pair.map(|child| tree.nodes[id(child) as usize].aabb);
            tree.nodes[parent as usize].aabb = left.union(right);
        }
    }
}

/// The internal nodes that go, and the subtrees that stay, both in the order of their places. The tallest go first, until the others fit
/// with `spare` levels left, or only leaves are left.
fn taken_apart(shape: &Shape, root: usize, levels: u32, spare: u32) -> (Vec<usize>, Vec<Item>) {
    let most = 1u128 << levels.saturating_sub(spare);
    // What is too tall goes in any case, and first.
    let weight = |place| if shape.height(place) > levels { 0 } else { 1u128 << shape.height(place) };
    let mut whole = BinaryHeap::from([(shape.height(root), Reverse(root))]);
    let mut dissolved = Vec::new();
    let mut sum = weight(root);
    while let Some(&(height, Reverse(tallest))) = whole.peek() {
        let Some(children) = shape.children(tallest).filter(|_| height > levels || sum > most) else { break };
        whole.pop();
        dissolved.push(tallest);
        sum -= weight(tallest);
        for child in children {
            sum += weight(child);
            whole.push((shape.height(child), Reverse(child)));
        }
    }
    debug_assert!(sum <= 1 << levels, "more leaves than {levels} levels can hold");
    dissolved.sort_unstable();
    let mut places: Vec<usize> = whole.into_iter().map(|(_, Reverse(place))| place).collect();
    places.sort_unstable();
    (dissolved, places.into_iter().map(|place| Item::of(shape, place)).collect())
}

/// Splits by full sweeps of the SAH (MacDonald & Booth 1990), of which only those count that leave levels enough on both sides.
struct Split {
    items: Vec<Item>,
    /// Items along each axis, by their centres.
    orders: [Vec<u32>; 3],
    /// Half areas of what lies from a place of the range to its end.
    areas: Vec<f64>,
    is_left: Vec<bool>,
}

/// Items that become a subtree.
struct Part {
    range: Range<usize>,
    levels: u32,
    /// The node above, and which child of it this is.
    parent: Option<(usize, usize)>,
}

/// A split under consideration; of equally cheap ones the one closest to the middle is the best, then that of the first axis.
struct Best {
    cost: f64,
    off_middle: usize,
    axis: usize,
    left: usize,
}

impl Split {
    fn new(items: Vec<Item>) -> Self {
        let ids = || 0..items.len() as u32;
        let orders = [0, 1, 2].map(|axis| {
            let doubled_centre = |id: u32| {
                let Aabb { min, max } = items[id as usize].aabb;
                // The last zero makes one of both zeros.
                f64::from(min[axis]) + f64::from(max[axis]) + 0.0
            };
            let mut order: Vec<u32> = ids().collect();
            // Stable: items with one centre stay in depth-first order.
            order.sort_by(|&a, &b| doubled_centre(a).total_cmp(&doubled_centre(b)));
            order
        });
        let (areas, is_left) = (vec![0.0; items.len()], vec![false; items.len()]);
        Self { items, orders, areas, is_left }
    }

    /// Children of the new nodes, the root first, and the sum of their half areas.
    fn run(mut self, levels: u32) -> (Vec<[Child; 2]>, f64) {
        let mut children: Vec<[Child; 2]> = Vec::with_capacity(self.items.len() - 1);
        let mut area = 0.0;
        let mut parts = vec![Part { range: 0..self.items.len(), levels, parent: None }];
        while let Some(Part { range, levels, parent }) = parts.pop() {
            let child = if range.len() == 1 {
                Child::Item(self.orders[0][range.start])
            } else {
                let node = children.len();
                children.push([Child::Node(0); 2]);
                let left = range.start + self.split(range.clone(), levels);
                area += self.areas[range.start];
                let part = |range, side| Part { range, levels: levels - 1, parent: Some((node, side)) };
                parts.extend([part(left..range.end, 1), part(range.start..left, 0)]);
                Child::Node(node as u32)
            };
            if let Some((node, side)) = parent {
                children[node][side] = child;
            }
        }
        (children, area)
    }

    /// Orders the items of the range so that those of the left part come first on every axis. Returns how many these are.
    fn split(&mut self, range: Range<usize>, levels: u32) -> usize {
        let half = 1u128 << (levels - 1);
        let mut best: Option<Best> = None;
        for axis in 0..3 {
            self.sweep(axis, range.clone(), half, &mut best);
        }
        let left = match best {
            Some(Best { axis, left, .. }) => {
                for (k, &id) in self.orders[axis][range.clone()].iter().enumerate() {
                    self.is_left[id as usize] = k < left;
                }
                left
            }
            None => self.tallest_first(range.clone(), half),
        };
        for order in &mut self.orders {
            // Stable, so that the others stay in their order.
            order[range.clone()].sort_by_key(|&id| !self.is_left[id as usize]);
        }
        left
    }

    /// The best of the splits along an axis, if it beats the one so far.
    fn sweep(&mut self, axis: usize, range: Range<usize>, half: u128, best: &mut Option<Best>) {
        let ids = &self.orders[axis][range.clone()];
        let areas = &mut self.areas[range];
        let (mut aabb, mut leaves, mut weight) = (Aabb::EMPTY, 0u64, 0u128);
        for (&id, area) in ids.iter().zip(areas.iter_mut()).rev() {
            let item = &self.items[id as usize];
            aabb = aabb.union(item.aabb);
            leaves += u64::from(item.leaves);
            weight += item.weight();
            *area = half_area(&aabb);
        }
        let (mut aabb, mut left_leaves, mut left_weight) = (Aabb::EMPTY, 0u64, 0u128);
        for left in 1..ids.len() {
            let item = &self.items[ids[left - 1] as usize];
            aabb = aabb.union(item.aabb);
            left_leaves += u64::from(item.leaves);
            left_weight += item.weight();
            if left_weight > half {
                break;
            }
            if weight - left_weight > half {
                continue;
            }
            let cost = half_area(&aabb) * left_leaves as f64 + areas[left] * (leaves - left_leaves) as f64;
            let off_middle = (2 * left).abs_diff(ids.len());
            let beats = |best: &Best| cost < best.cost || (cost == best.cost && off_middle < best.off_middle);
            if best.as_ref().is_none_or(beats) {
                *best = Some(Best { cost, off_middle, axis, left });
            }
        }
    }

    /// A split that leaves levels enough where none along an axis does: with the tallest first, weights fill one half exactly, as each is a
    /// multiple of all that follow.
    fn tallest_first(&mut self, range: Range<usize>, half: u128) -> usize {
        let mut ids = self.orders[0][range].to_vec();
        ids.sort_by_key(|&id| Reverse(self.items[id as usize].height));
        let (mut left, mut weight) = (0, 0u128);
        for id in ids {
            let item = &self.items[id as usize];
            let is_left = weight + item.weight() <= half;
            self.is_left[id as usize] = is_left;
            if is_left {
                weight += item.weight();
                left += 1;
            }
        }
        left
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::Rng;
    use super::*;
    use proptest::prelude::*;

    /// Items of these heights in a row along x.
    fn in_a_row(heights: &[u32]) -> Vec<Item> {
        let item = |(place, &height): (usize, &u32)| {
            let aabb = Aabb { min: [place as f32, 0.0, 0.0], max: [place as f32 + 1.0, 1.0, 1.0] };
            Item { place, aabb, leaves: 1, height }
        };
        heights.iter().enumerate().map(item).collect()
    }

    /// Links above each item.
    fn depths(children: &[[Child; 2]]) -> Vec<u32> {
        let mut found = vec![0; children.len() + 1];
        let mut stack = vec![(0, 0)];
        while let Some((node, depth)) = stack.pop() {
            for child in children[node] {
                match child {
                    Child::Item(item) => found[item as usize] = depth + 1,
                    Child::Node(node) => stack.push((node as usize, depth + 1)),
                }
            }
        }
        found
    }

    #[test]
    fn a_tall_item_between_small_ones_fits_where_no_cut_along_an_axis_does() {
        let heights = [0, 3, 0];
        let (children, _) = Split::new(in_a_row(&heights)).run(4);
        assert_eq!(depths(&children), [2, 1, 2]);
    }

    proptest! {
        #[test]
        fn items_fit_where_the_inequality_of_kraft_says_so(levels in 1u32..12, cuts in 1usize..60, dropped in 0usize..20, seed: u64) {
            let mut rng = Rng::new(seed);
            // Pieces of the whole, halved by chance; then some are taken away.
            let mut heights = vec![levels];
            for _ in 0..cuts {
                let at = rng.below(heights.len());
                if heights[at] > 0 {
                    heights[at] -= 1;
                    heights.push(heights[at]);
                }
            }
            rng.shuffle(&mut heights);
            heights.truncate(heights.len().saturating_sub(dropped).max(2));
            prop_assume!(heights.len() > 1);
            let (children, _) = Split::new(in_a_row(&heights)).run(levels);
            prop_assert_eq!(children.len() + 1, heights.len());
            for (depth, height) in depths(&children).into_iter().zip(&heights) {
                prop_assert!(depth > 0 && depth + height <= levels, "{:?}", heights);
            }
        }
    }
}

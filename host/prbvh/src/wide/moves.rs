//! Subtrees moved where the wide tree gets cheaper by it.
//!
//! What a binary tree costs is the area of all its nodes, what a wide one costs that of the nodes which survive the collapse. So after an optimiser of the binary cost there are moves left that
//! lower the wide one. Source of the moves: rotations (Kensler 2008) and their generalisation to reinsertions within a neighbourhood (Bittner, Hapala & Havran 2013); they are judged by
//! the least costs of the collapse ([`join`]), which are kept right from a move up to the root.

use super::optimal::params;
use super::settings::WideSettings;
use crate::bvh::{Bvh, Content, NO_NODE, ROOT};
use crate::scene::SafeRange;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::collapse::area::{area_scale, relative_area};
use prbvh_kernel::collapse::widen::{Forest, WidenParams, join};
use prbvh_kernel::node::Node;

/// Most rounds over all subtrees.
const MOST_ROUNDS: usize = 8;
/// Part of the cost that a round lowers it by, or it is the last.
const LEAST_GAIN: f32 = 1.0 / 4096.0;
/// Levels above the neighbourhood up to which a move is judged: a tree may be a chain.
const MOST_LEVELS: usize = 64;

/// The tree after moves among what lies below the `reach`-th ancestor of a subtree's parent, with other links and boxes, but the same leaves.
pub(super) fn moved(tree: &Bvh, settings: &WideSettings) -> Bvh {
    let mut moves = Moves::new(tree, settings);
    let mut cost = moves.cost();
    for _ in 0..MOST_ROUNDS {
        moves.round(settings.reach as usize);
        let before = std::mem::replace(&mut cost, moves.cost());
        if cost > before * (1.0 - LEAST_GAIN) {
            break;
        }
    }
    moves.tree(tree)
}

/// A node: links, box in working coordinates, least costs of the subtree.
#[derive(Clone, Copy)]
struct Item {
    parent: u32,
    /// None of a leaf.
    children: Option<[u32; 2]>,
    aabb: Aabb,
    forest: Forest,
}

struct Moves {
    items: Vec<Item>,
    params: WidenParams,
    scale: f32,
    /// Items as they were before the move that is tried.
    journal: Vec<(u32, Item)>,
}

impl Moves {
    fn new(tree: &Bvh, settings: &WideSettings) -> Self {
        let root = &tree.nodes[ROOT as usize].aabb;
        let range = SafeRange::of_box(root);
        let scale = area_scale(range.apply_to_box(root).half_area());
        let params = params(settings, tree.nodes.len());
        let item = |node: &crate::bvh::BvhNode| {
            let aabb = range.apply_to_box(&node.aabb);
            let (children, triangles) = match node.content {
                Content::Internal { left, right } => (Some([left, right]), 0),
                Content::Leaf { count, .. } => (None, count),
            };
            let forest = Forest::leaf(&params, area(&aabb, scale), triangles);
            Item { parent: node.parent, children, aabb, forest }
        };
        let mut moves = Self { items: tree.nodes.iter().map(item).collect(), params, scale, journal: Vec::new() };
        for &v in tree.preorder().iter().rev() {
            moves.update(v);
        }
        moves.journal.clear();
        moves
    }

    fn item(&self, v: u32) -> &Item {
        &self.items[v as usize]
    }

    fn cost(&self) -> f32 {
        self.item(ROOT).forest.at_most[0]
    }

    /// The item to change, with its state noted.
    fn noted(&mut self, v: u32) -> &mut Item {
        self.journal.push((v, self.items[v as usize]));
        &mut self.items[v as usize]
    }

    fn undo(&mut self) {
        while let Some((v, item)) = self.journal.pop() {
            self.items[v as usize] = item;
        }
    }

    /// Box and costs of a node from its children's.
    fn update(&mut self, v: u32) {
        let Some([left, right]) = self.item(v).children else { return };
        let (left, right) = (self.item(left), self.item(right));
        let aabb = left.aabb.union(right.aabb);
        let (forest, _) = join(&self.params, area(&aabb, self.scale), &left.forest, &right.forest);
        let item = self.noted(v);
        (item.aabb, item.forest) = (aabb, forest);
    }

    /// From `v` up to `top`.
    fn update_up(&mut self, mut v: u32, top: u32) {
        self.update(v);
        while v != top {
            v = self.item(v).parent;
            self.update(v);
        }
    }

    fn sibling(&self, v: u32) -> u32 {
        match self.item(self.item(v).parent).children {
            Some([left, right]) => left ^ right ^ v,
            None => unreachable!("a parent has children"),
        }
    }

    /// Puts `to` in the place of a child of `parent`.
    fn replace(&mut self, parent: u32, from: u32, to: u32) {
        let item = self.noted(parent);
        item.children = item.children.map(|children| children.map(|child| if child == from { to } else { child }));
        self.noted(to).parent = parent;
    }

    /// Moves `x` beside `y`, both of which lie below `top`, where `x` is no child of it.
    fn make(&mut self, x: u32, y: u32, top: u32) {
        let (carrier, sibling) = (self.item(x).parent, self.sibling(x));
        let above = self.item(carrier).parent;
        self.replace(above, carrier, sibling);
        self.replace(self.item(y).parent, y, carrier);
        self.noted(carrier).children = Some([y, x]);
        self.noted(y).parent = carrier;
        self.update_up(above, top);
        self.update_up(carrier, top);
    }

    /// What the subtree where moves below `top` are judged costs after one, if that is less; `judge` is its root. Nothing is changed.
    fn tried(&mut self, x: u32, y: u32, top: u32, judge: u32) -> Option<f32> {
        let [before_top, before] = [top, judge].map(|v| self.item(v).forest);
        self.make(x, y, top);
        let is_less =
            |after: &Forest, before: &Forest| (0..after.at_most.len()).any(|k| after.at_most[k] < before.at_most[k]);
        let mut cost = None;
        if is_less(&self.item(top).forest, &before_top) {
            self.update_up(top, judge);
            let after = self.item(judge).forest;
            let is_good = judge == ROOT || !is_less(&before, &after);
            cost = (is_good && after.at_most[0] < before.at_most[0]).then_some(after.at_most[0]);
        }
        self.undo();
        cost
    }

    /// Tries every subtree in turn, and makes its best move.
    fn round(&mut self, reach: usize) {
        let (mut places, mut stack) = (Vec::new(), Vec::new());
        for x in 1..self.items.len() as u32 {
            let parent = self.item(x).parent;
            if parent == NO_NODE || parent == ROOT {
                continue;
            }
            let top = self.ancestor(parent, reach);
            let judge = self.ancestor(top, MOST_LEVELS);
            let sibling = self.sibling(x);
            places.clear();
            stack.push((top, 0));
            while let Some((v, depth)) = stack.pop() {
                if v == x {
                    continue;
                }
                if v != top && v != parent && v != sibling {
                    places.push(v);
                }
                if let Some(children) = self.item(v).children
                    && depth < 2 * reach
                {
                    stack.extend(children.map(|child| (child, depth + 1)));
                }
            }
            let mut best = None;
            for &y in &places {
                let cost = self.tried(x, y, top, judge);
                if let Some(cost) = cost
                    && best.is_none_or(|(least, _)| cost < least)
                {
                    best = Some((cost, y));
                }
            }
            if let Some((_, y)) = best {
                self.make(x, y, top);
                self.update_up(top, ROOT);
                self.journal.clear();
            }
        }
    }

    /// So many levels up, or the root.
    fn ancestor(&self, mut v: u32, levels: usize) -> u32 {
        for _ in 0..levels {
            if v == ROOT {
                break;
            }
            v = self.item(v).parent;
        }
        v
    }

    fn tree(&self, from: &Bvh) -> Bvh {
        let mut tree = from.clone();
        for (node, item) in tree.nodes.iter_mut().zip(&self.items) {
            node.parent = item.parent;
            if let Some([left, right]) = item.children {
                node.content = Content::Internal { left, right };
            }
        }
        tree.with_boxes_of_leaves()
    }
}

fn area(aabb: &Aabb, scale: f32) -> f32 {
    relative_area(&Node { min: aabb.min, up: NO_NODE, max: aabb.max, down: 0 }, scale)
}

#[cfg(test)]
mod tests {
    use super::super::{CollapseMethod, Layout, Width, collapse, quality, validate};
    use super::*;
    use crate::bvh::testing::{chain, tree};
    use crate::bvh::validate as validate_binary;
    use proptest::prelude::*;

    fn settings(width: Width, reach: u32, max_leaf: Option<u32>) -> WideSettings {
        WideSettings { width, layout: Layout::Soa, method: CollapseMethod::Optimal, reach, sah: None, max_leaf }
    }

    /// A tree of triangles put together at random has much to move; of a single one that can be little.
    #[test]
    fn moves_lower_the_cost_of_trees_put_together_at_random() {
        for (width, reach) in [(Width::Four, 1), (Width::Four, 3), (Width::Eight, 1), (Width::Eight, 3)] {
            let costs = |reach| {
                let cost = |seed| {
                    let with = settings(width, reach, None);
                    quality(&collapse(&tree(80, seed).1, &with).unwrap(), &with.costs()).sah_cost
                };
                (0..20).map(cost).sum::<f64>()
            };
            let [before, after] = [0, reach].map(costs);
            assert!(after < 0.98 * before, "{width:?}, {reach}: {before} {after}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn moves_lower_the_cost_and_keep_the_leaves(n in 1usize..120, seed: u64, reach in 1u32..4, max_leaf in 0u32..4) {
            let (triangles, tree) = tree(n, seed);
            for width in [Width::Four, Width::Eight] {
                let with = settings(width, reach, (max_leaf > 0).then_some(max_leaf));
                let moved = moved(&tree, &with);
                prop_assert!(validate_binary(&moved, Some(&triangles)).is_ok());
                let [before, after] = [0, reach].map(|reach| {
                    let wide = collapse(&tree, &WideSettings { reach, ..with }).unwrap();
                    assert_eq!(validate(&wide, Some(&triangles)), Ok(()));
                    quality(&wide, &with.costs()).sah_cost
                });
                prop_assert!(after <= before * (1.0 + 1e-6), "{before} {after}");
            }
        }

        #[test]
        fn what_is_carried_along_is_what_a_tree_costs(n in 3usize..60, seed: u64, reach in 1u32..4) {
            let settings = settings(Width::Eight, reach, Some(3));
            let mut moves = Moves::new(&tree(n, seed).1, &settings);
            let first = moves.cost();
            moves.round(reach as usize);
            let made = moves.tree(&tree(n, seed).1);
            let anew = Moves::new(&made, &settings);
            prop_assert!(moves.cost() <= first);
            for (kept, new) in moves.items.iter().zip(&anew.items) {
                prop_assert_eq!((kept.aabb, kept.forest), (new.aabb, new.forest));
            }
        }
    }

    #[test]
    fn a_move_that_is_tried_leaves_nothing_behind() {
        let tree = tree(50, 3).1;
        let mut moves = Moves::new(&tree, &settings(Width::Four, 2, None));
        let before = moves.tree(&tree);
        let x =
            (1..99).find(|&v| moves.item(v).parent != ROOT && moves.item(moves.item(v).parent).parent == ROOT).unwrap();
        let uncle = moves.sibling(moves.item(x).parent);
        let _ = moves.tried(x, uncle, ROOT, ROOT);
        assert!(moves.journal.is_empty() && moves.tree(&tree) == before);
        moves.make(x, uncle, ROOT);
        assert!(moves.tree(&tree) != before);
    }

    #[test]
    fn a_chain_takes_no_quadratic_time() {
        let (triangles, nodes) = chain(4000);
        let tree = Bvh::from_device(&nodes).unwrap();
        let wide = collapse(&tree, &settings(Width::Eight, 1, None)).unwrap();
        validate(&wide, Some(&triangles)).unwrap();
    }
}

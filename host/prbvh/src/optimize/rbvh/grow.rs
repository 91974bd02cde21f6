//! A tree that grows reference by reference.

use super::super::IterationRow;
use super::batch::reinsert;
use super::search::Search;
use super::select::Selection;
use super::tree::RbvhTree;
use crate::bvh::ROOT;
use crate::random::Random;
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;

/// How a reference finds its place.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Way {
    /// Nodes that the best-first search may open; with 0 the place is that of the greedy way down.
    pub(in super::super) most_steps: u32,
    /// Seed of the order, and of what tells equal ways apart.
    pub(in super::super) seed: u64,
}

/// What is done between batches of references.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Between {
    /// References of a batch, as a part of those that are in the tree.
    pub(in super::super) batch: f64,
    /// Part of the nodes, the worst ones, that are then reinserted.
    pub(in super::super) worst: f64,
}

/// Fewest references of a batch: picking nodes looks at all.
const SMALLEST_BATCH: f64 = 1024.0;

/// Most nodes on the greedy way down. Only made-up inputs have longer ways.
const LONGEST_WAY: usize = 256;

/// The tree over at least two boxes; none if an end was asked for.
pub(in super::super) fn grown(
    boxes: &[Aabb],
    way: Way,
    between: Option<Between>,
    stop: Option<&Stop>,
) -> Option<RbvhTree> {
    let is_asked = || stop.is_some_and(Stop::is_asked);
    let mut random = Random::new(way.seed);
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    random.shuffle(&mut order);
    let mut tree = RbvhTree::of_two(boxes, order);
    let mut search = Search::new(tree.internal());
    let mut selection = between.map(|between| (Selection::new(&tree, between.worst, way.seed), between.batch));
    let mut next = batch_end(&tree, selection.as_ref());
    while tree.placed() < tree.internal() {
        if is_asked() {
            return None;
        }
        let aabb = tree.node(tree.internal() + tree.placed() + 1).aabb;
        let mut target = greedy_place(&tree, aabb, random.bits());
        if way.most_steps > 0 {
            target = search.best_place(&tree, aabb, target, way.most_steps).target;
        }
        tree.place(target);
        if let Some((selection, _)) = &mut selection
            && (tree.placed() == next || tree.placed() == tree.internal())
        {
            selection.pick_worst(&tree);
            reinsert(&mut tree, (selection, &mut search), true, &is_asked, &mut IterationRow::default());
            tree.keep();
        }
        if tree.placed() >= next {
            next = batch_end(&tree, selection.as_ref());
        }
    }
    Some(tree)
}

/// Internal nodes at the end of the batch that begins.
fn batch_end(tree: &RbvhTree, selection: Option<&(Selection, f64)>) -> u32 {
    let batch = selection.map_or(0.0, |(_, batch)| batch * f64::from(tree.placed()));
    tree.placed().saturating_add(batch.max(SMALLEST_BATCH) as u32)
}

/// The cheapest place on the way to the child that grows least, then to the one with the nearer centre, then by a bit of `coin`; of equally cheap ones the
/// lowest.
fn greedy_place(tree: &RbvhTree, aabb: Aabb, coin: u64) -> u32 {
    let mut best = (ROOT, f32::INFINITY);
    let (mut v, mut induced) = (ROOT, 0.0);
    for level in 0..LONGEST_WAY {
        let node = tree.node(v);
        let direct = node.aabb.union(aabb).half_area();
        if induced + direct <= best.1 {
            best = (v, induced + direct);
        }
        if v >= tree.internal() {
            break;
        }
        induced += direct - node.aabb.half_area();
        let ways = node.children.map(|child| {
            let have = tree.node(child).aabb;
            (have.union(aabb).half_area() - have.half_area(), distance(&have, &aabb))
        });
        let is_right = match ways[1].partial_cmp(&ways[0]) {
            Some(std::cmp::Ordering::Less) => true,
            Some(std::cmp::Ordering::Greater) => false,
            _ => coin.rotate_right(level as u32) & 1 == 1,
        };
        v = node.children[usize::from(is_right)];
    }
    best.0
}

/// Between the centres, doubled and squared.
fn distance(a: &Aabb, b: &Aabb) -> f32 {
    let along = |k: usize| (a.min[k] + a.max[k]) - (b.min[k] + b.max[k]);
    [along(0), along(1), along(2)].map(|d| d * d).iter().sum()
}

#[cfg(test)]
mod tests {
    use super::super::search::cost_at;
    use super::*;
    use crate::scene::built_in;

    /// A tree over boxes in their order, placed by `place`, which sees the tree, the box and the nodes that are in the tree.
    fn placed(boxes: &[Aabb], mut place: impl FnMut(&RbvhTree, Aabb, &[u32]) -> u32) -> RbvhTree {
        let mut tree = RbvhTree::of_two(boxes, (0..boxes.len() as u32).collect());
        while tree.placed() < tree.internal() {
            let leaf = tree.internal() + tree.placed() + 1;
            let nodes: Vec<u32> = (0..tree.placed()).chain(tree.internal()..leaf).collect();
            let target = place(&tree, boxes[leaf as usize - tree.internal() as usize], &nodes);
            tree.place(target);
        }
        tree
    }

    fn boxes(count: usize) -> Vec<Aabb> {
        built_in(count).triangles.iter().map(prbvh_kernel::setup::Triangle::aabb).collect()
    }

    #[test]
    fn branch_and_bound_finds_the_cheapest_place_of_all() {
        let boxes = boxes(400);
        let mut search = Search::new(boxes.len() as u32);
        let mut is_better = 0;
        let tree = placed(&boxes, |tree, aabb, nodes| {
            let greedy = greedy_place(tree, aabb, 5);
            let best = search.best_place(tree, aabb, greedy, u32::MAX).target;
            let least = nodes.iter().map(|&v| cost_at(tree, aabb, v)).fold(f32::INFINITY, f32::min);
            let cost = cost_at(tree, aabb, best);
            assert!(cost <= least * (1.0 + 1e-5), "{cost} is not {least}");
            is_better += usize::from(cost < cost_at(tree, aabb, greedy) * (1.0 - 1e-5));
            best
        });
        // What the greedy way misses is seen here.
        assert!(is_better > 20, "{is_better}");
        let sum: f64 = (0..tree.internal()).map(|v| f64::from(tree.node(v).aabb.half_area())).sum();
        assert!((sum - tree.internal_area()).abs() < 1e-4 * sum);
    }

    #[test]
    fn a_search_that_is_cut_short_is_no_worse_than_the_greedy_way() {
        let boxes = boxes(600);
        let mut search = Search::new(boxes.len() as u32);
        placed(&boxes, |tree, aabb, _| {
            let greedy = greedy_place(tree, aabb, 7);
            let place = search.best_place(tree, aabb, greedy, 3);
            assert!(place.steps <= 3 && place.cost <= cost_at(tree, aabb, greedy) * (1.0 + 1e-5));
            place.target
        });
    }
}

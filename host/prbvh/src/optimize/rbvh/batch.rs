//! The reinsertions of a batch, one after another.

use super::super::IterationRow;
use super::search::Search;
use super::select::Selection;
use super::tree::RbvhTree;

/// A relative change of the sum of areas that rounding alone may make.
const NOISE: f64 = 1e-14;

/// Reinserts the nodes that are picked, and counts in `row`: [`rbvh`](super::rbvh) says what. With `undo` what does not lower the cost is taken back.
pub(super) fn reinsert(
    tree: &mut RbvhTree,
    (selection, search): (&mut Selection, &mut Search),
    undo: bool,
    is_stopped: &dyn Fn() -> bool,
    row: &mut IterationRow,
) {
    let found = selection.batch.len();
    row.found = found as u32;
    for k in 0..found {
        if is_stopped() {
            break;
        }
        let v = selection.batch[k];
        if selection.is_due(tree, v) {
            let mark = tree.begin();
            let steps = reinsert_one(tree, selection, search, v);
            let is_better = tree.internal_area() < mark.internal_area * (1.0 - NOISE);
            if undo && !is_better {
                tree.undo(mark);
            }
            row.owned += 1;
            row.applied += u32::from(is_better);
            row.most_steps = row.most_steps.max(steps);
        }
    }
}

/// Removes a node with a grandparent and inserts its children again. Returns the steps of the longer search.
fn reinsert_one(tree: &mut RbvhTree, selection: &mut Selection, search: &mut Search, v: u32) -> u32 {
    let mut removed = tree.remove(v);
    selection.recycled(removed.slots);
    let area = |v: u32| tree.node(v).aabb.half_area();
    if area(removed.children[0]) < area(removed.children[1]) {
        removed.children.swap(0, 1);
    }
    let mut most_steps = 0;
    for (node, slot) in removed.children.into_iter().zip(removed.slots) {
        let place = search.best_place(tree, tree.node(node).aabb, removed.sibling, u32::MAX);
        tree.insert(node, place.target, slot);
        most_steps = most_steps.max(place.steps);
    }
    most_steps
}

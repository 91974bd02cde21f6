//! Reinsert, refit and restore on every device.

use crate::compare::Case;
use crate::oracle::{NaiveTree, half_area};
use prbvh_kernel::Kernel;
use prbvh_kernel::kept::{Kept, RestoreParams};
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::worst::books::{BOOKS_WORDS, EPOCH};
use prbvh_kernel::prbvh::{Move, PrbvhParams};
use prbvh_kernel::status::{APPLIED, GREW, MARKED, REFITTED, REPORT_WORDS, SHRUNK};
use prbvh_kernel::sum::to_f64;

/// A tree that moves have changed; boxes are stale.
#[derive(Clone, Debug)]
pub struct Moved {
    /// Its nodes.
    pub nodes: Vec<Node>,
    /// In place of the moves: where boxes change.
    pub found: Vec<Move>,
    /// Children of nodes in the best tree.
    pub kept: Vec<Kept>,
    /// Moves made.
    pub applied: usize,
}

/// Nothing kept yet.
#[must_use]
pub fn nothing_kept(nodes: usize) -> Vec<Kept> {
    vec![Kept { epoch: 0, left: 0, right: 0 }; (nodes / 2).max(1)]
}

/// Makes the moves that have won, while tree number `epoch` is the best one.
#[must_use]
pub fn reinsert(nodes: &[Node], found: &[Move], kept: &[Kept], epoch: u32, params: &PrbvhParams) -> Moved {
    let mut books = vec![0; BOOKS_WORDS as usize];
    books[EPOCH] = epoch;
    let case = Case::new(Kernel::PrbvhReinsert, params.count, params).with(found).with(nodes).with(kept).with(&books);
    let result = case.zeros(REPORT_WORDS as usize).run_everywhere();
    let applied = result.get::<u32>("report")[APPLIED] as usize;
    Moved { nodes: result.get("nodes"), found: result.get("found"), kept: result.get("kept"), applied }
}

/// What is wrong with what is kept of `before`, the best tree number `epoch`, by one dispatch: restoring leads back to it, and nothing that stayed is noted.
#[must_use]
pub fn kept_fault(before: &NaiveTree, moved: &Moved, epoch: u32) -> Option<String> {
    let after = NaiveTree::decode(&moved.nodes);
    for (v, children) in before.children.iter().enumerate().take(before.children.len() / 2) {
        let Kept { epoch: noted, left, right } = moved.kept[v];
        if noted != epoch && after.children[v] != *children {
            return Some(format!("{v} changed and is not noted"));
        }
        if noted == epoch && *children != [left, right] {
            return Some(format!("{v} had {children:?}, not {left} and {right}"));
        }
    }
    None
}

/// Brings tree number `epoch` back, boxes left as they are.
#[must_use]
pub fn restore(nodes: &[Node], kept: &[Kept], epoch: u32) -> Vec<Node> {
    let params = RestoreParams { count: nodes.len() as u32 / 2, epoch };
    Case::new(Kernel::KeptRestore, params.count, &params).with(kept).with(nodes).run_everywhere().get("nodes")
}

/// What is wrong with a refit of the paths above moves that were made, against a refit of all: boxes, or counts that stay.
#[must_use]
pub fn paths_fault(moved: &Moved, params: &PrbvhParams) -> Option<String> {
    let internal = moved.nodes.len() / 2;
    let mut expected = NaiveTree::decode(&moved.nodes);
    expected.refit(0);
    let case = |kernel| Case::new(kernel, params.count, params).with(&moved.found).with(&moved.nodes);
    let marked = case(Kernel::PrbvhMark).zeros(internal.max(1)).zeros(REPORT_WORDS as usize).run_everywhere();
    let ways: Vec<u32> = marked.get("ways");
    if ways.iter().any(|&ways| ways > 0) != (moved.applied > 0) {
        return Some("ways lead up from moves and from nowhere else".to_owned());
    }
    let result = case(Kernel::PrbvhRefit).with(&ways).with(&marked.get::<u32>("report")).run_everywhere();
    let report: Vec<u32> = result.get("report");
    let refitted = NaiveTree::decode(&result.get::<Node>("nodes"));
    if let Some(v) = (0..moved.nodes.len()).find(|&v| refitted.boxes[v] != expected.boxes[v]) {
        return Some(format!("box of {v}: {:?}, not {:?}", refitted.boxes[v], expected.boxes[v]));
    }
    if let Some(v) = result.get::<u32>("ways").iter().position(|&ways| ways != 0) {
        return Some(format!("{v} still waits"));
    }
    sums_fault(&report, &NaiveTree::decode(&moved.nodes), &expected, params.scale)
}

/// What is wrong with the report of a refit between two trees of the same links: counts of nodes, or sums of what areas lost and gained.
fn sums_fault(report: &[u32], before: &NaiveTree, after: &NaiveTree, scale: f32) -> Option<String> {
    if report[MARKED] != report[REFITTED] {
        return Some(format!("{} of {} marked nodes were refitted", report[REFITTED], report[MARKED]));
    }
    let internal = before.boxes.len() / 2;
    let areas = (0..internal).map(|v| [before, after].map(|tree| half_area(&tree.boxes[v])));
    let changed = areas.filter(|[before, after]| before != after);
    let (lost, rounded) =
        changed.fold((0.0, 0.0), |(lost, all), [before, after]| (lost + before - after, all + before + after));
    let sum = |word| to_f64(report[word], report[word + 1], scale);
    let summed = sum(SHRUNK) - sum(GREW);
    // Areas in f32, and each term is cut to a whole number of units.
    let allowed = f64::from(report[REFITTED]) / f64::from(scale) + 3e-7 * rounded;
    ((lost - summed).abs() > allowed).then(|| format!("areas lost {lost}, not {summed}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::soup;
    use crate::oracle::tree_of;
    use prbvh_kernel::prbvh::WON;
    use prbvh_kernel::sum::scale_of;

    /// One move in a small tree.
    fn moved() -> (NaiveTree, Moved, PrbvhParams) {
        let tree = tree_of(&soup(12, 0.3, 2), 2);
        let (input, output) = (20, tree.outputs(20)[3]);
        let found = [Move { area_decrease: 1.0, input: input | WON, output, other: output }];
        let nodes = tree.encode();
        let scale = scale_of(half_area(&tree.boxes[0]));
        let params = PrbvhParams { count: 1, scale, ..PrbvhParams::every(1, 0, nodes.len() as u32) };
        let moved = reinsert(&nodes, &found, &nothing_kept(nodes.len()), 1, &params);
        (tree, moved, params)
    }

    #[test]
    fn a_node_that_is_not_noted_is_a_fault() {
        let (tree, mut moved, _) = moved();
        assert_eq!(kept_fault(&tree, &moved, 1), None);
        let noted = moved.kept.iter().position(|kept| kept.epoch == 1).unwrap();
        let right = std::mem::replace(&mut moved.kept[noted].right, 0);
        assert!(kept_fault(&tree, &moved, 1).is_some_and(|fault| fault.contains("had")));
        moved.kept[noted] = Kept { epoch: 0, left: 0, right };
        let faults = (0..moved.kept.len()).filter(|&v| {
            moved.kept[v].epoch = 0;
            kept_fault(&tree, &moved, 1).is_some()
        });
        assert!(faults.count() > 0);
    }

    #[test]
    fn a_box_that_is_left_and_a_count_that_stays_are_faults() {
        let (_, mut moved, params) = moved();
        assert_eq!(paths_fault(&moved, &params), None);
        let found = std::mem::replace(&mut moved.found, vec![Move::NONE]);
        assert!(paths_fault(&moved, &params).is_some(), "no way leads up");
        moved.found = found;
        // Where no move says that boxes change, they stay.
        let leaf = moved.nodes.len() - 1;
        moved.nodes[leaf].max = [9.0; 3];
        moved.found[0] = Move { input: WON, output: 0, other: 0, ..moved.found[0] };
        assert!(paths_fault(&moved, &params).is_some_and(|fault| fault.starts_with("box of")));
    }

    #[test]
    fn a_sum_that_is_off_is_a_fault() {
        let (_, moved, params) = moved();
        let before = NaiveTree::decode(&moved.nodes);
        let mut after = NaiveTree::decode(&moved.nodes);
        after.refit(0);
        let marked = |fault: Option<String>| fault.is_some_and(|fault| fault.contains("marked"));
        let lost = |fault: Option<String>| fault.is_some_and(|fault| fault.starts_with("areas lost"));
        let mut report = [0; REPORT_WORDS as usize];
        assert!(lost(sums_fault(&report, &before, &after, params.scale)), "nothing was summed up");
        assert_eq!(sums_fault(&report, &before, &before, params.scale), None);
        report[SHRUNK + 1] = 1;
        assert!(lost(sums_fault(&report, &before, &before, params.scale)));
        report[GREW + 1] = 1;
        assert_eq!(sums_fault(&report, &before, &before, params.scale), None);
        report[MARKED] = 1;
        assert!(marked(sums_fault(&report, &before, &before, params.scale)));
    }
}

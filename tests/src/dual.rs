//! What a dual reinsertion changes, from its definition: by doing it alone.

use crate::oracle::NaiveTree;
use prbvh_kernel::prbvh::dual::DualMove;

/// Dissolves the input and inserts its children again (boxes stale).
///
/// # Panics
/// If the input has no grandparent.
pub fn reinsert(tree: &mut NaiveTree, dual: &DualMove) {
    let parent = tree.parent(dual.input).expect("the root is not dissolved");
    let sibling = tree.sibling(dual.input).expect("a child has a sibling");
    let grandparent = tree.parent(parent).expect("the parent is not the root");
    let replace = |tree: &mut NaiveTree, above: u32, old: u32, new: u32| {
        tree.children[above as usize].iter_mut().filter(|child| **child == old).for_each(|child| *child = new);
    };
    replace(tree, grandparent, parent, sibling);
    tree.children[parent as usize].clear();
    tree.children[dual.input as usize].clear();
    let inserts = [(dual.first, dual.first_output, parent), (dual.second, dual.second_output, dual.input)];
    for (child, output, new) in inserts {
        let above = tree.parent(output).expect("the root is no output");
        replace(tree, above, output, new);
        tree.children[new as usize] = vec![output, child];
    }
}

/// How much the sum of internal half areas falls by a move: by doing it.
#[must_use]
pub fn measured_area_decrease(tree: &NaiveTree, dual: &DualMove) -> f64 {
    let mut moved = tree.clone();
    reinsert(&mut moved, dual);
    moved.refit(0);
    tree.internal_area() - moved.internal_area()
}

/// All dual moves of an input: both orders, and every pair of outputs that are no ancestors of it.
#[must_use]
pub fn moves(tree: &NaiveTree, input: u32) -> Vec<DualMove> {
    let mut moves = Vec::new();
    let Some(parent) = tree.parent(input).filter(|&parent| parent != 0) else { return moves };
    let [left, right] = tree.children[input as usize][..] else { return moves };
    let all = 1..tree.children.len() as u32;
    let outputs: Vec<u32> = all.filter(|&v| !tree.is_below(v, input) && !tree.is_below(input, v)).collect();
    for (first, second) in [(left, right), (right, left)] {
        for &first_output in &outputs {
            for &second_output in outputs.iter().chain([&parent, &first]) {
                moves.push(DualMove { input, first, first_output, second, second_output });
            }
        }
    }
    moves
}

/// Nodes whose links a move reads or writes.
#[must_use]
pub fn topology(tree: &NaiveTree, dual: &DualMove) -> Vec<u32> {
    let above = |v: u32| tree.parent(v).expect("not the root");
    let parent = above(dual.input);
    let mut nodes = vec![dual.input, parent, above(parent)];
    nodes.extend(&tree.children[parent as usize]);
    nodes.extend(&tree.children[dual.input as usize]);
    nodes.extend([dual.first_output, above(dual.first_output), dual.second_output, above(dual.second_output)]);
    nodes
}

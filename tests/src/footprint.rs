//! What a reinsertion changes and what it relies on, from the definitions: by doing it alone.

use crate::oracle::NaiveTree;
use std::collections::BTreeSet;

/// Nodes whose links a reinsertion reads or writes, from the text of the paper, §4.3.1.
///
/// # Panics
/// If `input` or `output` is the root.
#[must_use]
pub fn topology(tree: &NaiveTree, input: u32, output: u32) -> Vec<u32> {
    let parent = tree.parent(input).unwrap();
    let sibling = tree.sibling(input).unwrap();
    let mut nodes = vec![input, sibling, parent, output, tree.parent(output).unwrap()];
    match tree.parent(parent) {
        Some(grandparent) => nodes.push(grandparent),
        None => nodes.extend(&tree.children[sibling as usize]),
    }
    nodes
}

/// A reinsertion, and what it does to the tree if it is the only one.
#[derive(Clone, Debug)]
pub struct Footprint {
    /// The node that moves.
    pub input: u32,
    /// Its new sibling.
    pub output: u32,
    /// The lowest node above both.
    pub pivot: u32,
    /// The child of the pivot above the output, or the output.
    pub top: u32,
    /// Nodes between input and pivot, upwards.
    pub up: Vec<u32>,
    /// Nodes between output and pivot, upwards.
    pub down: Vec<u32>,
    /// The tree after it.
    pub alone: NaiveTree,
    /// See [`topology`].
    pub topology: BTreeSet<u32>,
    /// The first of `up` above the parent that keeps its box.
    pub shrunk_to: Option<u32>,
    /// The first of `down` that keeps its box, or the pivot.
    pub grown_to: u32,
    /// Nodes that no compatible reinsertion may use.
    pub written: BTreeSet<u32>,
    /// Other nodes that no compatible reinsertion may write.
    pub read: BTreeSet<u32>,
}

impl Footprint {
    /// Of the move of `input` beside `output`.
    ///
    /// # Panics
    /// If there is no such move.
    #[must_use]
    pub fn of(tree: &NaiveTree, input: u32, output: u32) -> Self {
        let mut alone = tree.clone();
        alone.reinsert(input, output);
        alone.refit(0);
        let (mut up, mut down) = (tree.ancestors(input), tree.ancestors(output));
        let pivot = *up.iter().find(|v| down.contains(v)).expect("both are below the root");
        up.truncate(up.iter().position(|&v| v == pivot).unwrap());
        down.truncate(down.iter().position(|&v| v == pivot).unwrap());
        let top = down.last().copied().unwrap_or(output);
        let changes = |v: u32| {
            let links = |tree: &NaiveTree| tree.children[v as usize].iter().copied().collect::<BTreeSet<u32>>();
            tree.boxes[v as usize] != alone.boxes[v as usize] || links(tree) != links(&alone)
        };
        let keeps_box = |v: &u32| tree.boxes[*v as usize] == alone.boxes[*v as usize];
        let shrunk_to = up.iter().copied().skip(1).find(keeps_box);
        let grown_to = down.iter().copied().find(keeps_box).unwrap_or(pivot);
        let topology: BTreeSet<u32> = topology(tree, input, output).into_iter().collect();
        let mut written: BTreeSet<u32> = (0..tree.children.len() as u32).filter(|&v| changes(v)).collect();
        assert!(written.iter().all(|v| topology.contains(v) || up.contains(v) || down.contains(v)));
        written.extend(topology.iter().copied().chain(shrunk_to));
        let read = [top, grown_to].into_iter().filter(|v| !written.contains(v)).collect();
        Self { input, output, pivot, top, up, down, alone, topology, shrunk_to, grown_to, written, read }
    }

    /// Whether neither writes what the other uses.
    #[must_use]
    pub fn is_compatible(&self, other: &Self) -> bool {
        let meets = |a: &Self, b: &Self| a.written.iter().any(|v| b.written.contains(v) || b.read.contains(v));
        !meets(self, other) && !meets(other, self)
    }
}

/// What is wrong with the claim that these moves, made together, give every node the box that the one that writes it gives it alone,
/// that the others keep theirs, and that the sum of the areas falls by the sum of what each takes off alone.
#[must_use]
pub fn additivity_fault(tree: &NaiveTree, moves: &[Footprint]) -> Option<String> {
    for (k, a) in moves.iter().enumerate() {
        if let Some(b) = moves[k + 1..].iter().find(|b| !a.is_compatible(b)) {
            return Some(format!("{} → {} and {} → {} conflict", a.input, a.output, b.input, b.output));
        }
    }
    let mut together = tree.clone();
    for a in moves {
        together.reinsert(a.input, a.output);
    }
    together.refit(0);
    for v in 0..tree.children.len() {
        let writer = moves.iter().find(|a| a.written.contains(&(v as u32)));
        let expected = writer.map_or(tree.boxes[v], |a| a.alone.boxes[v]);
        if together.boxes[v] != expected {
            return Some(format!("box of {v}: {:?}, not {expected:?}", together.boxes[v]));
        }
    }
    sum_fault(tree, &together, moves)
}

/// What is wrong with the claim that the areas of `tree` fall to those of `together` by what each move takes off alone.
#[must_use]
pub fn sum_fault(tree: &NaiveTree, together: &NaiveTree, moves: &[Footprint]) -> Option<String> {
    let before = tree.internal_area();
    let falls = before - together.internal_area();
    let predicted: f64 = moves.iter().map(|a| before - a.alone.internal_area()).sum();
    // Sums of up to a thousand areas in f64, each move's own among them.
    let rounding = 1e-15 * (moves.len() + 2) as f64 * tree.children.len() as f64 * before;
    ((falls - predicted).abs() > rounding).then(|| format!("falls by {falls}, not by {predicted}"))
}

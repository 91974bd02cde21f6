//! Naive, obviously right versions of what the kernels do.

use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{NO_NODE, Node, RIGHT};
use prbvh_kernel::setup::Triangle;
use std::collections::BTreeSet;

/// A binary tree as lists of children, for tests that change it step by step.
#[derive(Clone, Debug, PartialEq)]
pub struct NaiveTree {
    /// Children of the internal nodes, left first; empty for leaves.
    pub children: Vec<Vec<u32>>,
    /// Boxes of all nodes.
    pub boxes: Vec<Aabb>,
    /// Reference of each leaf; unused for internal nodes.
    pub references: Vec<u32>,
}

impl NaiveTree {
    /// Reads device nodes, checking the links as it goes.
    ///
    /// # Panics
    /// If the nodes are no tree.
    #[must_use]
    pub fn decode(nodes: &[Node]) -> Self {
        let internal = nodes.len() / 2;
        assert_eq!(nodes[0].up, NO_NODE);
        let mut children = vec![Vec::new(); nodes.len()];
        let mut seen = vec![false; nodes.len()];
        let mut pending = vec![0u32];
        while let Some(v) = pending.pop() {
            assert!(!std::mem::replace(&mut seen[v as usize], true), "node {v} is reached twice");
            if (v as usize) < internal {
                let left = nodes[v as usize].down;
                let right = nodes[left as usize].up;
                assert_eq!(right & RIGHT, 0, "left child {left} of {v}");
                assert_eq!(nodes[right as usize].up, v | RIGHT, "right child {right} of {v}");
                children[v as usize] = vec![left, right];
                pending.extend([left, right]);
            }
        }
        assert!(seen.iter().all(|&seen| seen), "every node is reached");
        Self {
            children,
            boxes: nodes.iter().map(Node::aabb).collect(),
            references: (0..).zip(nodes).map(|(v, node)| if v < internal { 0 } else { node.down }).collect(),
        }
    }

    /// Writes device nodes.
    #[must_use]
    pub fn encode(&self) -> Vec<Node> {
        let mut nodes: Vec<Node> = self
            .boxes
            .iter()
            .zip(&self.references)
            .map(|(aabb, &down)| Node { min: aabb.min, up: NO_NODE, max: aabb.max, down })
            .collect();
        for (v, children) in self.children.iter().enumerate() {
            if let [left, right] = children[..] {
                nodes[v].down = left;
                nodes[left as usize].up = right;
                nodes[right as usize].up = v as u32 | RIGHT;
            }
        }
        nodes
    }

    /// Parent of `v`.
    #[must_use]
    pub fn parent(&self, v: u32) -> Option<u32> {
        self.children.iter().position(|children| children.contains(&v)).map(|p| p as u32)
    }

    /// The nodes above `v`, upwards.
    #[must_use]
    pub fn ancestors(&self, v: u32) -> Vec<u32> {
        std::iter::successors(self.parent(v), |&parent| self.parent(parent)).collect()
    }

    /// The other child of the parent of `v`.
    #[must_use]
    pub fn sibling(&self, v: u32) -> Option<u32> {
        let children = &self.children[self.parent(v)? as usize];
        children.iter().copied().find(|&child| child != v)
    }

    /// Whether `v` lies in the subtree of `top`, itself included.
    #[must_use]
    pub fn is_below(&self, v: u32, top: u32) -> bool {
        v == top || self.parent(v).is_some_and(|parent| self.is_below(parent, top))
    }

    /// Recomputes the boxes of internal nodes below `v`.
    pub fn refit(&mut self, v: u32) {
        if let [left, right] = self.children[v as usize][..] {
            self.refit(left);
            self.refit(right);
            self.boxes[v as usize] = self.boxes[left as usize].union(self.boxes[right as usize]);
        }
    }

    /// Sum of half areas of the internal nodes, f64.
    #[must_use]
    pub fn internal_area(&self) -> f64 {
        (0..self.children.len()).filter(|&v| !self.children[v].is_empty()).map(|v| half_area(&self.boxes[v])).sum()
    }

    /// The references below each internal node, in their order: what a tree is but for the numbers of its nodes.
    #[must_use]
    pub fn clades(&self) -> BTreeSet<Vec<u32>> {
        let mut all = BTreeSet::new();
        self.clade(0, &mut all);
        all
    }

    fn clade(&self, v: usize, all: &mut BTreeSet<Vec<u32>>) -> Vec<u32> {
        let [left, right] = self.children[v][..] else { return vec![self.references[v]] };
        let mut references = self.clade(left as usize, all);
        references.extend(self.clade(right as usize, all));
        references.sort_unstable();
        all.insert(references.clone());
        references
    }

    /// Moves the subtree of `input` beside `output` (boxes stale), following the text of the paper, §4.2.
    ///
    /// # Panics
    /// If `input` is the root.
    pub fn reinsert(&mut self, input: u32, output: u32) {
        let parent = self.parent(input).expect("the root does not move");
        let sibling = self.sibling(input).expect("a child has a sibling");
        let freed = if let Some(grandparent) = self.parent(parent) {
            self.replace_child(grandparent, parent, sibling);
            parent
        } else {
            self.children[parent as usize] = std::mem::take(&mut self.children[sibling as usize]);
            sibling
        };
        let above = self.parent(output).expect("the root is no output");
        self.replace_child(above, output, freed);
        self.children[freed as usize] = vec![output, input];
    }

    fn replace_child(&mut self, parent: u32, old: u32, new: u32) {
        for child in &mut self.children[parent as usize] {
            if *child == old {
                *child = new;
            }
        }
    }

    /// Every output that `input` may move to: not its own subtree, its sibling, the root or another ancestor.
    #[must_use]
    pub fn outputs(&self, input: u32) -> Vec<u32> {
        let all = 1..self.children.len() as u32;
        all.filter(|&v| !self.is_below(v, input) && Some(v) != self.sibling(input) && !self.is_below(input, v))
            .collect()
    }

    /// How much the sum of internal half areas falls if `input` moves beside `output`: by doing it.
    #[must_use]
    pub fn measured_area_decrease(&self, input: u32, output: u32) -> f64 {
        let mut moved = self.clone();
        moved.reinsert(input, output);
        moved.refit(0);
        self.internal_area() - moved.internal_area()
    }
}

/// Half surface area in f64.
#[must_use]
pub fn half_area(aabb: &Aabb) -> f64 {
    let extent = |k: usize| f64::from(aabb.max[k]) - f64::from(aabb.min[k]);
    extent(0) * extent(1) + extent(1) * extent(2) + extent(2) * extent(0)
}

/// A [`random_tree`] over triangles.
#[must_use]
pub fn tree_of(triangles: &[Triangle], seed: u64) -> NaiveTree {
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    random_tree(&boxes, seed)
}

/// A random tree over boxes: two random subtrees are joined until one is left. Leaf `n-1+k` holds reference `k`.
///
/// # Panics
/// If there are no boxes.
#[must_use]
pub fn random_tree(leaf_boxes: &[Aabb], seed: u64) -> NaiveTree {
    let n = leaf_boxes.len();
    let mut random = crate::fixtures::Random(seed);
    let mut tree = NaiveTree {
        children: vec![Vec::new(); 2 * n - 1],
        boxes: vec![Aabb { min: [0.0; 3], max: [0.0; 3] }; n - 1],
        references: vec![0; n - 1],
    };
    tree.boxes.extend(leaf_boxes);
    tree.references.extend(0..n as u32);
    let mut roots: Vec<u32> = (n as u32 - 1..2 * n as u32 - 1).collect();
    for v in (0..n as u32 - 1).rev() {
        let mut take = || roots.swap_remove((random.bits() % roots.len() as u64) as usize);
        tree.children[v as usize] = vec![take(), take()];
        roots.push(v);
    }
    tree.refit(0);
    tree
}

/// A comb: internal node `k` holds leaf `k` and the rest, and the last two leaves end it.
///
/// # Panics
/// If there are fewer than two boxes.
#[must_use]
pub fn comb(boxes: &[Aabb]) -> NaiveTree {
    let n = boxes.len();
    let mut tree = NaiveTree {
        children: vec![Vec::new(); 2 * n - 1],
        boxes: vec![Aabb { min: [0.0; 3], max: [0.0; 3] }; n - 1],
        references: vec![0; n - 1],
    };
    tree.boxes.extend(boxes);
    tree.references.extend(0..n as u32);
    for v in (0..n - 1).rev() {
        let rest = if v + 2 < n { v + 1 } else { 2 * n - 2 };
        tree.children[v] = vec![(n - 1 + v) as u32, rest as u32];
        // From below: the refit of [`NaiveTree`] would need a deep stack.
        tree.boxes[v] = tree.boxes[n - 1 + v].union(tree.boxes[rest]);
    }
    tree
}

/// A comb over boxes in a row: as deep as a tree can be.
#[must_use]
pub fn row_comb(n: u32) -> NaiveTree {
    let aabb = |k: u32| Aabb { min: [k as f32, 0.0, 0.0], max: [k as f32 + 0.5, 1.0, 1.0] };
    comb(&(0..n).map(aabb).collect::<Vec<_>>())
}

/// The radix tree of sorted codes, by definition: split where the highest differing bit changes; equal codes are told apart by
/// position.
#[must_use]
pub fn radix_tree_leaf_sets(codes: &[u64]) -> BTreeSet<(usize, usize)> {
    fn split(codes: &[u128], first: usize, last: usize, sets: &mut BTreeSet<(usize, usize)>) {
        sets.insert((first, last));
        if first < last {
            let top = 127 - (codes[first] ^ codes[last]).leading_zeros();
            let ones = codes[first..=last].iter().filter(|&&code| code >> top & 1 == 0).count();
            split(codes, first, first + ones - 1, sets);
            split(codes, first + ones, last, sets);
        }
    }
    let keys: Vec<u128> = codes.iter().enumerate().map(|(k, &code)| u128::from(code) << 32 | k as u128).collect();
    let mut sets = BTreeSet::new();
    split(&keys, 0, codes.len() - 1, &mut sets);
    sets
}

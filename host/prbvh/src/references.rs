//! Trees of any leaves as trees of one reference per leaf, which is what an optimiser takes, and back.
//!
//! A reference is a box and what is in it: a whole leaf, or the piece of one primitive in it. A primitive that is in several leaves has a
//! reference in each (spatial splits). References move, and stay what they are; so what a ray met in a leaf it meets in the optimised tree.

use crate::bvh::{Bvh, BvhNode, Content, TreeFault, pieces, reference_faults};
use prbvh_kernel::aabb::Aabb;

/// References of which there is no tree yet.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pieces {
    /// Their boxes.
    pub(crate) boxes: Vec<Aabb>,
    /// The primitive that each is a piece of.
    pub(crate) primitives: Vec<u32>,
}

/// A tree over references.
#[derive(Clone, Debug)]
pub(crate) struct References {
    /// A reference in each leaf.
    pub(crate) tree: Bvh,
    /// Their boxes.
    pub(crate) boxes: Vec<Aabb>,
    held: Held,
}

/// What the references hold.
#[derive(Clone, Debug)]
enum Held {
    /// The primitives of their numbers.
    Same,
    /// A primitive each.
    Primitives(Vec<u32>),
    /// Leaves, each a range of the order.
    Leaves { ranges: Vec<(u32, u32)>, order: Vec<u32> },
}

impl References {
    /// Each leaf is a reference.
    ///
    /// # Errors
    /// All faults of links and leaves, or of the leaves' boxes.
    pub(crate) fn leaves(tree: &Bvh) -> Result<Self, Vec<TreeFault>> {
        let faults = reference_faults(tree, None);
        if !faults.is_empty() {
            return Err(faults);
        }
        let (mut nodes, mut boxes, mut ranges) = (tree.nodes.clone(), Vec::new(), Vec::new());
        for node in &mut nodes {
            if let Content::Leaf { first, count } = node.content {
                node.content = Content::Leaf { first: boxes.len() as u32, count: 1 };
                boxes.push(node.aabb);
                ranges.push((first, count));
            }
        }
        let triangle_order = (0..boxes.len() as u32).collect();
        let held = Held::Leaves { ranges, order: tree.triangle_order.clone() };
        Ok(Self { tree: Bvh { nodes, triangle_order }, boxes, held })
    }

    /// Each primitive of a leaf is a reference; leaves of several become subtrees of halves. `boxes` are those of the primitives.
    ///
    /// # Errors
    /// All faults of links and leaves, then of the leaves' boxes, then of the pieces in them.
    pub(crate) fn split(tree: &Bvh, boxes: &[Aabb]) -> Result<Self, Vec<TreeFault>> {
        let faults = reference_faults(tree, Some(boxes.len()));
        if !faults.is_empty() {
            return Err(faults);
        }
        let pieces = pieces(tree, boxes)?;
        let primitives = &tree.triangle_order;
        // As many as there are, and each of them: each once.
        let is_each_once = primitives.len() == boxes.len();
        let mut split = Self {
            tree: Bvh { nodes: tree.nodes.clone(), triangle_order: (0..pieces.len() as u32).collect() },
            boxes: pieces,
            held: Held::Primitives(primitives.clone()),
        };
        split.halve_leaves();
        if is_each_once {
            split.number_by_primitives();
        }
        Ok(split)
    }

    fn halve_leaves(&mut self) {
        let Self { tree: Bvh { nodes, triangle_order }, boxes, .. } = self;
        let leaves = 0..nodes.len();
        let mut stack: Vec<usize> = leaves.filter(|&v| matches!(nodes[v].content, Content::Leaf { .. })).collect();
        while let Some(v) = stack.pop() {
            let Content::Leaf { first, count } = nodes[v].content else { continue };
            let order = &mut triangle_order[first as usize..][..count as usize];
            let (left, right) = (nodes.len() as u32, nodes.len() as u32 + 1);
            let middle = halve(order, boxes);
            let of = |references: &[u32]| references.iter().fold(Aabb::EMPTY, |sum, &k| sum.union(boxes[k as usize]));
            nodes[v].aabb = of(order);
            if count == 1 {
                continue;
            }
            let child = |part: &[u32], first| {
                let content = Content::Leaf { first, count: part.len() as u32 };
                BvhNode { aabb: of(part), parent: v as u32, content }
            };
            let children = [child(&order[..middle], first), child(&order[middle..], first + middle as u32)];
            nodes.extend(children);
            nodes[v].content = Content::Internal { left, right };
            stack.extend([left as usize, right as usize]);
        }
    }

    /// Where each primitive has one reference, the reference has its number.
    fn number_by_primitives(&mut self) {
        let Held::Primitives(primitives) = std::mem::replace(&mut self.held, Held::Same) else { return };
        let mut boxes = self.boxes.clone();
        for (&primitive, &aabb) in primitives.iter().zip(&self.boxes) {
            boxes[primitive as usize] = aabb;
        }
        self.boxes = boxes;
        self.tree.triangle_order.iter_mut().for_each(|reference| *reference = primitives[*reference as usize]);
    }

    /// Whether references are primitives, by number.
    #[cfg(test)]
    pub(crate) fn are_primitives(&self) -> bool {
        matches!(self.held, Held::Same)
    }

    /// The references, where they are pieces of primitives of which some have several.
    pub(crate) fn pieces(&self) -> Option<Pieces> {
        let Held::Primitives(primitives) = &self.held else { return None };
        Some(Pieces { boxes: self.boxes.clone(), primitives: primitives.clone() })
    }

    /// A tree over the references as one over what they hold; boxes stay.
    pub(crate) fn given_back(&self, mut tree: Bvh) -> Bvh {
        match &self.held {
            Held::Same => {}
            Held::Primitives(primitives) => {
                tree.triangle_order.iter_mut().for_each(|reference| *reference = primitives[*reference as usize]);
            }
            Held::Leaves { ranges, order } => {
                // One after another in the order of the new leaves.
                let mut moved = Vec::with_capacity(order.len());
                for node in &mut tree.nodes {
                    if let Content::Leaf { first, .. } = node.content {
                        let (from, count) = ranges[tree.triangle_order[first as usize] as usize];
                        node.content = Content::Leaf { first: moved.len() as u32, count };
                        moved.extend_from_slice(&order[from as usize..][..count as usize]);
                    }
                }
                tree.triangle_order = moved;
            }
        }
        tree
    }
}

/// Parts the references in the middle along the axis on which their centres lie furthest apart; returns where.
fn halve(order: &mut [u32], boxes: &[Aabb]) -> usize {
    let middle = order.len() / 2;
    if order.len() > 2 {
        // Halves of either, so that no sum is infinite.
        let centre = |k: u32, axis: usize| 0.5 * boxes[k as usize].min[axis] + 0.5 * boxes[k as usize].max[axis];
        let spread = |axis: usize| {
            let centres = order.iter().map(|&k| centre(k, axis));
            let (least, most) =
                centres.fold((f32::INFINITY, f32::NEG_INFINITY), |(least, most), x| (least.min(x), most.max(x)));
            most - least
        };
        let spreads = [spread(0), spread(1), spread(2)];
        let widest = (0..3).fold(0, |best, axis| if spreads[axis] > spreads[best] { axis } else { best });
        let by_centre = |a: &u32, b: &u32| centre(*a, widest).total_cmp(&centre(*b, widest)).then(a.cmp(b));
        order.select_nth_unstable_by(middle, by_centre);
    }
    middle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::sah_sweep;
    use crate::bvh::{topology_hash, validate, validate_references};
    use crate::scene::{built_in, stand_in};
    use prbvh_kernel::setup::Triangle;
    use proptest::prelude::*;

    fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
        triangles.iter().map(Triangle::aabb).collect()
    }

    fn stand_ins(references: &References) -> Vec<Triangle> {
        references.boxes.iter().map(stand_in).collect()
    }

    /// A tree whose leaves hold up to `most` of the triangles.
    fn with_leaves(triangles: &[Triangle], most: usize) -> Bvh {
        let fine = Bvh::from_device(&sah_sweep(triangles)).unwrap().with_boxes_of(triangles);
        let below = |v: u32| {
            let (mut stack, mut found) = (vec![v], Vec::new());
            while let Some(v) = stack.pop() {
                match fine.nodes[v as usize].content {
                    Content::Internal { left, right } => stack.extend([right, left]),
                    Content::Leaf { first, .. } => found.push(fine.triangle_order[first as usize]),
                }
            }
            found
        };
        let mut tree = Bvh { nodes: vec![fine.nodes[0]], triangle_order: Vec::new() };
        let mut stack = vec![(0u32, 0usize)];
        while let Some((from, to)) = stack.pop() {
            let held = below(from);
            match fine.nodes[from as usize].content {
                Content::Internal { left, right } if held.len() > most => {
                    let first = tree.nodes.len() as u32;
                    for child in [left, right] {
                        tree.nodes.push(BvhNode { parent: to as u32, ..fine.nodes[child as usize] });
                    }
                    tree.nodes[to].content = Content::Internal { left: first, right: first + 1 };
                    stack.extend([(left, first as usize), (right, first as usize + 1)]);
                }
                _ => {
                    let first = tree.triangle_order.len() as u32;
                    tree.nodes[to].content = Content::Leaf { first, count: held.len() as u32 };
                    tree.triangle_order.extend(held);
                }
            }
        }
        tree
    }

    /// Leaves of one primitive in two halves along x, where the box is wide.
    fn in_halves(tree: &Bvh) -> Bvh {
        let mut halved = tree.clone();
        for v in 0..tree.nodes.len() {
            let Content::Leaf { first, count: 1 } = tree.nodes[v].content else { continue };
            let Aabb { min, max } = tree.nodes[v].aabb;
            let middle = 0.5 * (min[0] + max[0]);
            let (left, right) = (halved.nodes.len() as u32, halved.nodes.len() as u32 + 1);
            let again = halved.triangle_order.len() as u32;
            halved.triangle_order.push(tree.triangle_order[first as usize]);
            let child = |aabb, first| BvhNode { aabb, parent: v as u32, content: Content::Leaf { first, count: 1 } };
            let children = [
                child(Aabb { min, max: [middle, max[1], max[2]] }, first),
                child(Aabb { min: [middle, min[1], min[2]], max }, again),
            ];
            halved.nodes.extend(children);
            halved.nodes[v].content = Content::Internal { left, right };
        }
        halved
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn whole_leaves_come_back_as_they_were(n in 1usize..80, most in 1usize..9) {
            let triangles = &built_in(1000).triangles[..n];
            let tree = with_leaves(triangles, most);
            validate(&tree, Some(triangles)).unwrap();
            let references = References::leaves(&tree).unwrap();
            validate(&references.tree, Some(&stand_ins(&references))).unwrap();
            let back = references.given_back(references.tree.clone());
            validate(&back, Some(triangles)).unwrap();
            prop_assert_eq!(topology_hash(&back), topology_hash(&tree));
        }

        #[test]
        fn split_leaves_hold_one_primitive_each(n in 1usize..80, most in 1usize..9) {
            let triangles = &built_in(1000).triangles[..n];
            let references = References::split(&with_leaves(triangles, most), &boxes_of(triangles)).unwrap();
            prop_assert!(references.are_primitives());
            prop_assert_eq!(&references.boxes, &boxes_of(triangles));
            prop_assert_eq!(references.tree.nodes.len(), 2 * n - 1);
            validate(&references.tree, Some(triangles)).unwrap();
        }

        #[test]
        fn pieces_of_a_primitive_are_references_of_it(n in 1usize..60) {
            let triangles = &built_in(1000).triangles[..n];
            let boxes = boxes_of(triangles);
            let tree = in_halves(&with_leaves(triangles, 1));
            validate_references(&tree, &boxes).unwrap();
            let references = References::split(&tree, &boxes).unwrap();
            prop_assert!(!references.are_primitives());
            prop_assert_eq!(references.boxes.len(), 2 * n);
            validate(&references.tree, Some(&stand_ins(&references))).unwrap();
            let back = references.given_back(references.tree.clone());
            validate_references(&back, &boxes).unwrap();
            prop_assert_eq!(topology_hash(&back), topology_hash(&tree));
        }
    }

    #[test]
    fn broken_trees_are_refused() {
        let triangles = &built_in(1000).triangles[..50];
        let mut tree = with_leaves(triangles, 4);
        tree.nodes[3].parent = 0;
        assert!(References::leaves(&tree).is_err());
        assert!(References::split(&tree, &boxes_of(triangles)).is_err());
    }

    #[test]
    fn equal_boxes_are_halved_too() {
        let triangles = vec![built_in(10).triangles[0]; 33];
        let leaf = BvhNode {
            aabb: triangles[0].aabb(),
            parent: crate::bvh::NO_NODE,
            content: Content::Leaf { first: 0, count: 33 },
        };
        let tree = Bvh { nodes: vec![leaf], triangle_order: (0..33).collect() };
        let references = References::split(&tree, &boxes_of(&triangles)).unwrap();
        let stats = validate(&references.tree, Some(&triangles)).unwrap();
        assert_eq!((stats.leaves, stats.max_depth), (33, 6));
    }
}

//! Boxes of the original triangles.

use super::{Bvh, Content, without_negative_zeros};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;

impl Bvh {
    /// The same tree with every box computed anew from `triangles`, bottom-up. A device may have worked on scaled triangles.
    ///
    /// Boxes made here hold no -0.0: equal boxes have equal bits whatever the order of children and corners.
    ///
    /// # Panics
    /// If the links are no tree or a triangle id is not below `triangles.len()`.
    #[must_use]
    pub fn with_boxes_of(mut self, triangles: &[Triangle]) -> Self {
        for &v in self.preorder().iter().rev() {
            self.nodes[v as usize].aabb = match self.nodes[v as usize].content {
                Content::Internal { left, right } => {
                    self.nodes[left as usize].aabb.union(self.nodes[right as usize].aabb)
                }
                Content::Leaf { first, count } => {
                    let boxes = self.triangles_of(first, count).iter().map(|&t| triangles[t as usize].aabb());
                    without_negative_zeros(boxes.fold(Aabb::EMPTY, Aabb::union))
                }
            };
        }
        self
    }

    /// The same tree with the boxes of internal nodes made anew from those of the leaves, which stay.
    ///
    /// # Panics
    /// If the links are no tree.
    #[must_use]
    pub fn with_boxes_of_leaves(mut self) -> Self {
        for &v in self.preorder().iter().rev() {
            if let Content::Internal { left, right } = self.nodes[v as usize].content {
                self.nodes[v as usize].aabb = self.nodes[left as usize].aabb.union(self.nodes[right as usize].aabb);
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{chain, tree};
    use super::super::validate;
    use super::*;
    use proptest::prelude::*;

    fn scaled(triangles: &[Triangle], by: f32) -> Vec<Triangle> {
        let point = |p: [f32; 3]| p.map(|x| x * by);
        triangles.iter().map(|t| Triangle { a: point(t.a), b: point(t.b), c: point(t.c) }).collect()
    }

    proptest! {
        #[test]
        fn boxes_are_those_of_the_triangles(n in 1usize..100, seed: u64) {
            let (triangles, tree) = tree(n, seed);
            let larger = scaled(&triangles, 3.7);
            prop_assert!(validate(&tree, Some(&larger)).is_err());
            let refitted = tree.clone().with_boxes_of(&larger);
            prop_assert!(validate(&refitted, Some(&larger)).is_ok());
            let coordinates = refitted.nodes.iter().flat_map(|node| node.aabb.min.into_iter().chain(node.aabb.max));
            prop_assert!(coordinates.into_iter().all(|x| x.to_bits() != (-0.0f32).to_bits()));
            prop_assert_eq!(refitted.with_boxes_of(&triangles), tree);
        }
    }

    #[test]
    fn a_chain_does_not_overflow_the_stack() {
        let (triangles, nodes) = chain(100_000);
        let tree = Bvh::from_device(&nodes).unwrap().with_boxes_of(&triangles);
        assert!(validate(&tree, Some(&triangles)).is_ok());
    }
}

//! A tree as its depth-first order: a subtree is a range of places, its root the first of them.

use super::super::quality::half_area;
use super::super::{Bvh, Content};
use prbvh_kernel::aabb::Aabb;

/// Levels and heights of a tree that is to have at most `most` links between the root and a leaf.
pub(super) struct Shape {
    most: u32,
    /// Nodes by place.
    nodes: Vec<u32>,
    /// Their boxes.
    boxes: Vec<Aabb>,
    /// Links to the root.
    levels: Vec<u32>,
    /// Most links to a leaf below.
    heights: Vec<u32>,
    /// The place after the last one below.
    ends: Vec<u32>,
}

impl Shape {
    pub(super) fn of(tree: &Bvh, most: u32) -> Self {
        let nodes = tree.preorder();
        let count = nodes.len();
        let boxes = nodes.iter().map(|&v| tree.nodes[v as usize].aabb).collect();
        let mut shape =
            Self { most, nodes, boxes, levels: vec![0; count], heights: vec![0; count], ends: vec![0; count] };
        for place in (0..count).rev() {
            shape.ends[place] = place as u32 + 1;
            if let Content::Internal { .. } = tree.nodes[shape.nodes[place] as usize].content {
                let [left, right] = shape.below(place);
                shape.ends[place] = shape.ends[right];
                shape.heights[place] = 1 + shape.heights[left].max(shape.heights[right]);
            }
        }
        for place in 0..count {
            if let Some(children) = shape.children(place) {
                for child in children {
                    shape.levels[child] = shape.levels[place] + 1;
                }
            }
        }
        shape
    }

    /// Places.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(super) fn node(&self, place: usize) -> u32 {
        self.nodes[place]
    }

    pub(super) fn aabb(&self, place: usize) -> Aabb {
        self.boxes[place]
    }

    /// Half the surface area, scene units².
    pub(super) fn area(&self, place: usize) -> f64 {
        half_area(&self.boxes[place])
    }

    pub(super) fn height(&self, place: usize) -> u32 {
        self.heights[place]
    }

    pub(super) fn end(&self, place: usize) -> usize {
        self.ends[place] as usize
    }

    /// None of a leaf.
    pub(super) fn children(&self, place: usize) -> Option<[usize; 2]> {
        (self.heights[place] > 0).then(|| self.below(place))
    }

    /// Children of an internal node whose left child has its end.
    fn below(&self, place: usize) -> [usize; 2] {
        [place + 1, self.end(place + 1)]
    }

    /// Leaves below, or the leaf itself.
    pub(super) fn leaves(&self, place: usize) -> u32 {
        // One internal node fewer than leaves.
        (self.ends[place] - place as u32).div_ceil(2)
    }

    /// Links that may lie below.
    pub(super) fn levels_left(&self, place: usize) -> u32 {
        self.most.saturating_sub(self.levels[place])
    }

    /// Whether the subtree is within the bound where it is.
    pub(super) fn fits(&self, place: usize) -> bool {
        u64::from(self.levels[place]) + u64::from(self.heights[place]) <= u64::from(self.most)
    }
}

//! The crate `bvh` 0.13: binned SAH, one triangle per leaf, built in parallel.

use super::PeerTree;
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::{Bvh, BvhNode};
use nalgebra::Point3;
use prbvh::bvh::Content;
use prbvh_kernel::setup::Triangle;
use std::time::Instant;

struct Shape {
    triangle: Triangle,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        let aabb = self.triangle.aabb();
        Aabb::with_bounds(Point3::from(aabb.min), Point3::from(aabb.max))
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

pub(super) fn build(triangles: &[Triangle]) -> PeerTree {
    let mut shapes: Vec<Shape> = triangles.iter().map(|&triangle| Shape { triangle, node: 0 }).collect();
    let start = Instant::now();
    let tree = Bvh::build_par(&mut shapes);
    let build_s = start.elapsed().as_secs_f64();
    let content = |node: &BvhNode<f32, 3>| match *node {
        BvhNode::Leaf { shape_index, .. } => Content::Leaf { first: shape_index as u32, count: 1 },
        BvhNode::Node { child_l_index, child_r_index, .. } => {
            Content::Internal { left: child_l_index as u32, right: child_r_index as u32 }
        }
    };
    PeerTree {
        build_s,
        nodes: tree.nodes.iter().map(content).collect(),
        triangle_order: (0..triangles.len() as u32).collect(),
    }
}

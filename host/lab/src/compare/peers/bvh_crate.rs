//! The crate `bvh` 0.13: binned SAH, one triangle per leaf, built in parallel.

use super::PeerTree;
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::Bvh;
use nalgebra::Point3;
use prbvh::interop::bvh::from_bvh;
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
    PeerTree::of(from_bvh(&tree), build_s)
}

//! obvhs 0.4 with its feature `parallel`: PLOC, then reinsertion in batches of the largest nodes.

use super::PeerTree;
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use prbvh::interop::obvhs::from_bvh2;
use prbvh_kernel::setup::Triangle;
use std::time::{Duration, Instant};

/// Its medium preset: PLOC of radius 14, reinsertion of one node in twenty, and of one in ten once more.
pub(super) const DEFAULT: &str = "obvhs default";
/// PLOC of radius 32 on all levels, then [`PASSES`] passes of reinsertion over all nodes.
pub(super) const BEST: &str = "obvhs best r=32 x20";
const PASSES: u32 = 20;

pub(super) fn default(triangles: &[Triangle]) -> PeerTree {
    let triangles = converted(triangles);
    let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
    let start = Instant::now();
    let tree = build_bvh2_from_tris(&triangles, params, &mut Duration::default());
    handed_out(&tree, start.elapsed())
}

pub(super) fn best(triangles: &[Triangle]) -> PeerTree {
    let triangles = converted(triangles);
    let start = Instant::now();
    let indices: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut builder = PlocBuilder::with_capacity(triangles.len());
    let mut tree = builder.build(PlocSearchDistance::VeryHigh, &triangles, indices, SortPrecision::U64, 0);
    let mut optimizer = ReinsertionOptimizer::default();
    for _ in 0..PASSES {
        optimizer.run(&mut tree, 1.0, Some(vec![1.0]));
    }
    handed_out(&tree, start.elapsed())
}

fn converted(triangles: &[Triangle]) -> Vec<obvhs::triangle::Triangle> {
    let corner = Vec3A::from_array;
    let convert = |t: &Triangle| obvhs::triangle::Triangle { v0: corner(t.a), v1: corner(t.b), v2: corner(t.c) };
    triangles.iter().map(convert).collect()
}

fn handed_out(tree: &Bvh2, took: Duration) -> PeerTree {
    PeerTree::of(from_bvh2(tree), took.as_secs_f64())
}

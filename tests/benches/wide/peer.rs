//! The trees of obvhs, and rays through them.

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;
use prbvh::bvh::{Bvh, summary};
use prbvh::interop::obvhs::from_bvh2;
use prbvh::scene::Scene;
use prbvh::trace::{NO_TRIANGLE, Ray};
use prbvh_tests::bench::obvhs::{ploc, triangles};
use rayon::prelude::*;
use std::time::Duration;

/// PLOC and reinsertion of all nodes, one triangle per leaf, without spatial splits.
pub(crate) fn best(scene: &Scene) -> Bvh {
    let mut tree = ploc(&triangles(scene));
    ReinsertionOptimizer::default().run(&mut tree, 1.0, None);
    let tree = from_bvh2(&tree).unwrap_or_else(|faults| panic!("{}", summary(&faults)));
    tree.with_boxes_of(&scene.triangles)
}

/// Its slowest preset, with spatial splits, in both of its layouts.
pub(crate) fn built(scene: &Scene) -> (Bvh2, CwBvh) {
    let (triangles, params) = (triangles(scene), BvhBuildParams::very_slow_build());
    let mut time = Duration::ZERO;
    (build_bvh2_from_tris(&triangles, params, &mut time), build_cwbvh_from_tris(&triangles, params, &mut time))
}

/// A tree of obvhs.
pub(crate) enum Peer<'a> {
    Binary(&'a Bvh2),
    Compressed(&'a CwBvh),
}

impl Peer<'_> {
    /// The nearest triangle of each ray and where it is hit; `any`: whether there is one.
    pub(crate) fn hits(&self, triangles: &[Triangle], rays: &[Ray], any: bool) -> Vec<(f32, u32)> {
        let order: &[u32] = match self {
            Self::Binary(tree) => &tree.primitive_indices,
            Self::Compressed(tree) => &tree.primitive_indices,
        };
        let of = |position: usize| &triangles[order[position] as usize];
        let one = |ray: &Ray| {
            let peer = obvhs::ray::Ray::new_inf(Vec3A::from_array(ray.origin), Vec3A::from_array(ray.direction));
            let test = |ray: &obvhs::ray::Ray, position: usize| of(position).intersect(ray);
            if any {
                let misses = match self {
                    Self::Binary(tree) => tree.ray_traverse_miss(peer, test),
                    Self::Compressed(tree) => tree.ray_traverse_miss(peer, test),
                };
                return (0.0, if misses { NO_TRIANGLE } else { 0 });
            }
            let mut hit = RayHit::none();
            match self {
                Self::Binary(tree) => tree.ray_traverse(peer, &mut hit, test),
                Self::Compressed(tree) => tree.ray_traverse(peer, &mut hit, test),
            };
            if hit.t.is_finite() { (hit.t, order[hit.primitive_id as usize]) } else { (0.0, NO_TRIANGLE) }
        };
        rays.par_iter().map(one).collect()
    }
}

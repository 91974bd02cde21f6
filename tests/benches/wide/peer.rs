//! The trees of obvhs, and rays through them.

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use prbvh::bvh::{Bvh, summary};
use prbvh::interop::obvhs::from_bvh2;
use prbvh::scene::Scene;
use prbvh::trace::{NO_TRIANGLE, Query, Ray};
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
pub(crate) fn built(scene: &Scene) -> [Peer; 2] {
    let (all, params) = (triangles(scene), BvhBuildParams::very_slow_build());
    let mut time = Duration::ZERO;
    let binary = build_bvh2_from_tris(&all, params, &mut time);
    let compressed = build_cwbvh_from_tris(&all, params, &mut time);
    [Peer::of(scene, Form::Binary(binary)), Peer::of(scene, Form::Compressed(compressed))]
}

enum Form {
    Binary(Bvh2),
    Compressed(CwBvh),
}

/// A tree of obvhs with its triangles in the order of the leaves, in the form that it has for rays.
pub(crate) struct Peer {
    form: Form,
    triangles: Vec<RtTriangle>,
}

impl Peer {
    pub(crate) fn compressed(scene: &Scene, tree: CwBvh) -> Self {
        Self::of(scene, Form::Compressed(tree))
    }

    fn of(scene: &Scene, form: Form) -> Self {
        let all = triangles(scene);
        let order = match &form {
            Form::Binary(tree) => &tree.primitive_indices,
            Form::Compressed(tree) => &tree.primitive_indices,
        };
        let triangles = order.iter().map(|&id| (&all[id as usize]).into()).collect();
        Self { form, triangles }
    }

    /// The nearest triangle of each ray and where it is hit; of any hits whether there is one.
    pub(crate) fn hits(&self, rays: &[Ray], query: Query) -> Vec<(f32, u32)> {
        let order = match &self.form {
            Form::Binary(tree) => &tree.primitive_indices,
            Form::Compressed(tree) => &tree.primitive_indices,
        };
        let test = |ray: &obvhs::ray::Ray, position: usize| self.triangles[position].intersect(ray);
        let one = |ray: &Ray| {
            let (origin, direction) = (Vec3A::from_array(ray.origin), Vec3A::from_array(ray.direction));
            let ray = obvhs::ray::Ray::new(origin, direction, ray.t_min, ray.t_max);
            if query == Query::Any {
                let misses = match &self.form {
                    Form::Binary(tree) => tree.ray_traverse_miss(ray, test),
                    Form::Compressed(tree) => tree.ray_traverse_miss(ray, test),
                };
                return (0.0, if misses { NO_TRIANGLE } else { 0 });
            }
            let mut hit = RayHit::none();
            match &self.form {
                Form::Binary(tree) => tree.ray_traverse(ray, &mut hit, test),
                Form::Compressed(tree) => tree.ray_traverse(ray, &mut hit, test),
            };
            if hit.t.is_finite() { (hit.t, order[hit.primitive_id as usize]) } else { (0.0, NO_TRIANGLE) }
        };
        rays.par_iter().with_min_len(16).map(one).collect()
    }
}

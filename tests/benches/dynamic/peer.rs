//! obvhs on the same frames: its own refit, and its reinsertion of one node in a hundred.

use crate::{Measured, cost_of};
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use prbvh::interop::obvhs::from_bvh2;
use prbvh::scene::{Scene, Triangle};
use prbvh_tests::bench::obvhs::{PROGRAM, ploc, triangles};
use prbvh_tests::bench::stats::median;
use std::time::Instant;

/// Part of the nodes that a frame reinserts.
const BATCH: f32 = 0.01;

pub(crate) fn follow(scene: &Scene, frames: &[Vec<Triangle>], threads: usize) -> Measured {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut bvh = ploc(&triangles(scene));
        // As good a start as it makes.
        let mut optimizer = ReinsertionOptimizer::default();
        (0..20).for_each(|_| optimizer.run(&mut bvh, 1.0, None));
        let (mut refits, mut steps) = (Vec::new(), Vec::new());
        for frame in frames {
            let start = Instant::now();
            for k in 0..bvh.nodes.len() {
                if bvh.nodes[k].is_leaf() {
                    let t = frame[bvh.primitive_indices[bvh.nodes[k].first_index as usize] as usize];
                    let [a, b, c] = [t.a, t.b, t.c].map(Vec3A::from_array);
                    bvh.nodes[k].set_aabb(Aabb { min: a.min(b).min(c), max: a.max(b).max(c) });
                }
            }
            bvh.refit_all();
            let refitted = start.elapsed();
            optimizer.run(&mut bvh, BATCH, Some(vec![1.0]));
            refits.push(refitted.as_secs_f64());
            steps.push((start.elapsed() - refitted).as_secs_f64());
        }
        let last = &frames[frames.len() - 1];
        let most_s = refits.iter().zip(&steps).map(|(refit, step)| refit + step).fold(0.0, f64::max);
        let tree = from_bvh2(&bvh).expect("the peer's tree is one");
        let cost = cost_of(&tree.with_boxes_of(last), last);
        Measured { name: PROGRAM.to_owned(), refit_s: median(&refits), step_s: median(&steps), most_s, cost }
    })
}

//! obvhs on the same triangles: PLOC with radius 32, then reinsertion at several settings. Costs come from our f64 evaluator.

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use prbvh::scene::Scene;
use prbvh_tests::bench::obvhs::{cost, ploc, triangles};
use prbvh_tests::bench::stats::median;
use serde::Serialize;
use std::time::Instant;

/// What obvhs did.
#[derive(Debug, Serialize)]
pub(crate) struct PeerMeasured {
    pub(crate) ploc_s: f64,
    pub(crate) ploc_cost: f64,
    /// Reinsertion from the PLOC tree: setting, seconds, cost.
    pub(crate) reinsertion: Vec<(String, f64, f64)>,
}

impl PeerMeasured {
    /// The lowest cost of any setting.
    pub(crate) fn best_cost(&self) -> f64 {
        self.reinsertion.iter().map(|row| row.2).fold(self.ploc_cost, f64::min)
    }
}

/// Builds `repetitions` times after a warm-up; each reinsertion setting runs once, since its cost is what counts here.
pub(crate) fn measure(scene: &Scene, repetitions: usize) -> PeerMeasured {
    let triangles = triangles(scene);
    let mut times = Vec::new();
    let mut initial = Bvh2::default();
    for repetition in 0..=repetitions {
        let start = Instant::now();
        initial = ploc(&triangles);
        if repetition > 0 {
            times.push(start.elapsed().as_secs_f64());
        }
    }
    let default_sequence = |ratio: f32| (format!("ratio {ratio}, default sequence"), ratio, None, 1);
    let settings = [
        default_sequence(0.05),
        default_sequence(0.2),
        default_sequence(1.0),
        ("ratio 1, 20 passes".to_owned(), 1.0, Some(vec![1.0]), 20),
    ];
    let cost = |tree: &Bvh2| cost(tree, scene).unwrap_or_else(|error| panic!("{}: {error}", scene.name));
    let reinsertion = settings
        .into_iter()
        .map(|(setting, ratio, sequence, runs)| {
            let mut tree = initial.clone();
            let start = Instant::now();
            let mut optimizer = ReinsertionOptimizer::default();
            for _ in 0..runs {
                optimizer.run(&mut tree, ratio, sequence.clone());
            }
            (setting, start.elapsed().as_secs_f64(), cost(&tree))
        })
        .collect();
    PeerMeasured { ploc_s: median(&times), ploc_cost: cost(&initial), reinsertion }
}

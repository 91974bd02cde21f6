//! obvhs 0.4 (`parallel`) on the same triangles: PLOC with radius 32, then reinsertion at several settings. Costs come from our f64
//! evaluator, over boxes recomputed from the triangles.

use glam::Vec3A;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use obvhs::triangle::Triangle;
use prbvh::bvh::{Bvh, BvhNode, Content, NO_NODE, SahModel, quality, validate};
use prbvh::compare::median;
use prbvh::scene::Scene;
use prbvh_kernel::aabb::Aabb;
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
    let corner = |p: [f32; 3]| Vec3A::from_array(p);
    let triangles: Vec<Triangle> =
        scene.triangles.iter().map(|t| Triangle { v0: corner(t.a), v1: corner(t.b), v2: corner(t.c) }).collect();
    let mut times = Vec::new();
    let mut ploc = Bvh2::default();
    for repetition in 0..=repetitions {
        let start = Instant::now();
        let indices: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut builder = PlocBuilder::with_capacity(triangles.len());
        ploc = builder.build(PlocSearchDistance::VeryHigh, &triangles, indices, SortPrecision::U64, 0);
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
    let reinsertion = settings
        .into_iter()
        .map(|(setting, ratio, sequence, runs)| {
            let mut tree = ploc.clone();
            let start = Instant::now();
            let mut optimizer = ReinsertionOptimizer::default();
            for _ in 0..runs {
                optimizer.run(&mut tree, ratio, sequence.clone());
            }
            (setting, start.elapsed().as_secs_f64(), cost(&tree, scene))
        })
        .collect();
    PeerMeasured { ploc_s: median(&times).unwrap_or(f64::NAN), ploc_cost: cost(&ploc, scene), reinsertion }
}

/// Cost of a tree of obvhs by our evaluator; the tree is validated first.
fn cost(tree: &Bvh2, scene: &Scene) -> f64 {
    let nowhere = Aabb { min: [0.0; 3], max: [0.0; 3] };
    let mut nodes: Vec<BvhNode> = tree
        .nodes
        .iter()
        .map(|node| {
            let first = node.first_index;
            let content = if node.prim_count == 0 {
                Content::Internal { left: first, right: first + 1 }
            } else {
                Content::Leaf { first, count: node.prim_count }
            };
            BvhNode { aabb: nowhere, parent: NO_NODE, content }
        })
        .collect();
    for v in 0..nodes.len() {
        if let Content::Internal { left, right } = nodes[v].content {
            nodes[left as usize].parent = v as u32;
            nodes[right as usize].parent = v as u32;
        }
    }
    let tree = Bvh { nodes, triangle_order: tree.primitive_indices.clone() }.with_boxes_of(&scene.triangles);
    validate(&tree, Some(&scene.triangles)).unwrap_or_else(|faults| panic!("obvhs: {faults:?}"));
    quality(&tree, &SahModel::default()).sah_cost
}

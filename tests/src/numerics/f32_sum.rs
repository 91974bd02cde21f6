//! Sums of areas: over fixed chunks in f32 and from there in f64, or in f32 all the way.

use super::document::Block;
use super::{initial_tree, markdown, part, texts};
use prbvh::scene::built_in;
use prbvh_kernel::cost::COST_CHUNK;
use prbvh_lab::accuracy::F32_COST_BOUND;

/// Relative errors of a sum of half areas against f64.
#[derive(Clone, Copy, Debug)]
pub struct SumErrors {
    /// Of one running f32 sum.
    pub running: f64,
    /// Of f32 sums over chunks, added in f64.
    pub chunked: f64,
}

/// The sum over the internal nodes of the LBVH of the built-in scene.
#[must_use]
pub fn errors(triangles: usize) -> SumErrors {
    let nodes = initial_tree(&built_in(triangles));
    let areas: Vec<f32> = nodes[..nodes.len() / 2].iter().map(|node| node.aabb().half_area()).collect();
    let exact: f64 = areas.iter().copied().map(f64::from).sum();
    let running: f32 = areas.iter().sum();
    let chunked: f64 = areas.chunks(COST_CHUNK as usize).map(|chunk| f64::from(chunk_sum(chunk))).sum();
    let error = |sum: f64| (sum / exact - 1.0).abs();
    SumErrors { running: error(f64::from(running)), chunked: error(chunked) }
}

/// The sum of a chunk of areas as a device makes it: a binary tree over [`COST_CHUNK`] terms, of which those at the end may be 0.
///
/// # Panics
/// If there are more.
#[must_use]
pub fn chunk_sum(areas: &[f32]) -> f32 {
    assert!(areas.len() <= COST_CHUNK as usize, "a chunk has {COST_CHUNK} areas, not {}", areas.len());
    let mut sums = areas.to_vec();
    sums.resize(COST_CHUNK as usize, 0.0);
    while sums.len() > 1 {
        sums = sums.chunks(2).map(|pair| pair[0] + pair[1]).collect();
    }
    sums[0]
}

/// A row per size.
#[must_use]
pub fn block() -> Block {
    let mut rows = vec![texts(&["built-in scene, triangles", "one f32 sum", "chunks", "bound"])];
    for triangles in [2_500, 25_000, 250_000, 1_000_000] {
        let errors = errors(triangles);
        rows.push(vec![triangles.to_string(), part(errors.running), part(errors.chunked), part(F32_COST_BOUND)]);
    }
    Block::new("f32-sum", markdown(&rows))
}

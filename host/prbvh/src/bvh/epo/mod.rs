//! End-point overlap (Aila, Karras & Laine 2013, *On Quality Metrics of Bounding Volume Hierarchies*).

mod sample;
mod walk;
mod watch;

pub use watch::EpoProgress;

use super::clip::{corners, polygon_area};
use super::{Bvh, SahModel};
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use sample::sampled;
use std::ops::ControlFlow;
use walk::{Held, Walk};
use watch::{End, Watch};

/// Distinct triangles whose shares are summed by one thread; fixed, so that the result does not depend on the threads.
const CHUNK: usize = 256;

/// Tests that are done whatever the scene, and for each triangle and level of a balanced tree.
const LEAST_BUDGET: u64 = 1 << 24;
const TESTS_PER_LEVEL: u64 = 64;

/// Seed of the sample.
const SEED: u64 = 0x45_50_4f;

/// End-point overlap of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Epo {
    /// The overlap, unitless.
    pub value: f64,
    /// Half the width of its 95 % confidence interval, unitless; 0 where it is exact.
    pub error: f64,
    /// Triangles that were drawn to estimate it; 0 where it is exact.
    pub drawn: u32,
    /// Tests of a triangle against a box that this took.
    pub tests: u64,
}

impl Epo {
    /// Whether every triangle was measured.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.drawn == 0
    }
}

/// Tests of a triangle against a box after which [`epo`] is content with an estimate: 2^24, or 64 for each triangle and each level of a balanced
/// tree, if that is more.
#[must_use]
pub fn epo_budget(triangles: usize) -> u64 {
    let levels = u64::from(triangles.max(1).ilog2()) + 1;
    LEAST_BUDGET.max(TESTS_PER_LEVEL * levels * triangles as u64)
}

/// [`epo_watched`] with the usual budget, to its end.
///
/// # Panics
/// If the links are no tree over the triangles.
#[must_use]
pub fn epo(tree: &Bvh, triangles: &[Triangle], model: &SahModel) -> Epo {
    let go_on = |_| ControlFlow::Continue(());
    match epo_watched(tree, triangles, model, epo_budget(triangles.len()), &go_on) {
        Some(epo) => epo,
        None => unreachable!("nothing breaks"),
    }
}

/// End-point overlap of a valid tree over `triangles`, unitless: what a ray that ends on a surface pays for nodes that hold the end point, but
/// not the triangle it lies on.
///
/// `EPO = Σ C(n) · area((S \ Q(n)) ∩ n) / area(S)` over all nodes `n`, where `S` are all triangles, `Q(n)` those in the subtree of `n`, and
/// `C(n)` is `c_traversal` for an internal node and `c_intersect` times its triangles for a leaf. A box is closed: a triangle that lies in
/// one of its faces is inside. Coincident triangles count each. Where `S` has no area the result is 0.
///
/// Where a triangle is in several leaves (spatial splits), each of these holds what of it lies in the leaf's box, its piece, and `Q(n)` are the pieces in the subtree: a node that holds one
/// piece of a triangle is visited in vain by a ray that ends on another piece in it. Where pieces of a triangle in one subtree overlap, the overlap is counted as held twice.
///
/// The sum is taken in f64 in the order of the corners, and for each triangle in depth-first order: one tree has one value, however its
/// nodes are numbered and on however many threads. Coordinates of any finite f32 neither overflow nor underflow. Copies of a triangle
/// share a walk through the tree, which would be quadratic in their number; near copies have one each.
///
/// Triangles that are much larger than the boxes make the exact value quadratic. Where it takes more than `budget` tests of a triangle against a box,
/// it is estimated with about as many once more (a few hundred triangles at least), from a sample that is the same every time: [`Epo::error`] says how
/// well. Work is counted and never timed, so the result is the same on every machine.
///
/// `observe` is told now and then, on any thread, and may break: then there is no result.
///
/// # Panics
/// If the links are no tree over the triangles.
#[must_use]
pub fn epo_watched(
    tree: &Bvh,
    triangles: &[Triangle],
    model: &SahModel,
    budget: u64,
    observe: &(dyn Fn(EpoProgress) -> ControlFlow<()> + Sync),
) -> Option<Epo> {
    let walk = Walk::new(tree, triangles.len(), model);
    let mut groups = groups(triangles, &walk);
    match exact(&walk, &groups, &Watch::new(budget, observe)) {
        Ok(epo) => Some(epo),
        Err(End::Cancelled) => None,
        Err(End::OverBudget) => {
            groups.retain(|group| group.area > 0.0);
            // Neighbours in the tree are alike, which makes for small errors.
            groups.par_sort_unstable_by_key(|group| group.held.ranks[0]);
            sampled(&walk, &groups, budget, SEED, observe).ok()
        }
    }
}

/// The triangles in the order of their corners, copies together.
fn groups(triangles: &[Triangle], walk: &Walk) -> Vec<Group> {
    let bits = |id: u32| corners(&triangles[id as usize]).map(|corner| corner.map(f64::to_bits));
    let mut ids: Vec<u32> = (0..triangles.len() as u32).collect();
    ids.par_sort_unstable_by_key(|&id| (bits(id), walk.first_rank(id)));
    let copies: Vec<&[u32]> = ids.chunk_by(|&a, &b| bits(a) == bits(b)).collect();
    let group = |ids: &&[u32]| {
        let triangle = &triangles[ids[0] as usize];
        let corners = corners(triangle);
        Group { area: polygon_area(&corners), corners, held: walk.held(ids, triangle) }
    };
    copies.par_iter().map(group).collect()
}

/// Copies of a triangle.
struct Group {
    corners: [[f64; 3]; 3],
    /// Of one of them.
    area: f64,
    /// Where they are.
    held: Held,
}

/// Every triangle against every box that it may meet.
fn exact(walk: &Walk, groups: &[Group], watch: &Watch<'_>) -> Result<Epo, End> {
    watch.begins(false, groups.len());
    let chunk = |groups: &[Group]| -> Result<[f64; 2], End> {
        let mut sums = [0.0; 2];
        for Group { corners, area, held } in groups {
            sums[0] += area * held.copies as f64;
            let mut tests = 0;
            if *area > 0.0 {
                let (overlap, looked_at) = walk.overlap(corners, held);
                sums[1] += overlap;
                tests = looked_at;
            }
            watch.has_done(tests)?;
        }
        Ok(sums)
    };
    let sums: Vec<[f64; 2]> = groups.par_chunks(CHUNK).map(chunk).collect::<Result<_, End>>()?;
    let [area, overlap] = sums.iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    let value = if area > 0.0 { overlap / area } else { 0.0 };
    Ok(Epo { value, tests: watch.tests(), ..Epo::default() })
}

#[cfg(test)]
mod tests;

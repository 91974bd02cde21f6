//! An estimate from some of the triangles.
//!
//! Source: Cochran 1977, *Sampling Techniques*, sections 5A.5 and 9A.3. The end-point overlap is a mean over the points of all surfaces. Their area, in the order of
//! the tree, is cut into strata of equal size; two points are drawn in each, and the triangle of each point is measured. The mean of all is unbiased,
//! and the two of a stratum say how far it may be off: its variance is `Σ (f₁ - f₂)² / (4 H²)` over `H` strata.

use super::watch::{End, EpoProgress, Watch};
use super::{Epo, Group, Walk};
use crate::scene::Noise;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Strata at least, and those from whose work it follows how many more there may be.
pub(super) const LEAST_STRATA: usize = 100;
const PILOT_STRATA: usize = 32;

/// Student's t for 95 % and as many degrees of freedom as there are strata at least.
const T_95: f64 = 1.984;

/// The overlap from a sample that takes about `budget` tests; groups in the order of the tree.
pub(super) fn sampled(
    walk: &Walk,
    groups: &[Group],
    budget: u64,
    seed: u64,
    observe: &(dyn Fn(EpoProgress) -> ControlFlow<()> + Sync),
) -> Result<Epo, End> {
    // The number of strata bounds the work.
    let watch = Watch::new(u64::MAX, observe);
    let sample = Sample::new(walk, groups);
    watch.begins(true, 2 * PILOT_STRATA);
    // Its values are not used: how many are drawn must not depend on what they say.
    sample.draw(PILOT_STRATA, seed ^ 1, &watch)?;
    let of_a_stratum = (watch.tests() / PILOT_STRATA as u64).max(1);
    let strata = ((budget / of_a_stratum) as usize).clamp(LEAST_STRATA, groups.len().max(LEAST_STRATA));
    watch.begins(true, 2 * strata);
    let pairs = sample.draw(strata, seed, &watch)?;
    let [value, error] = estimate(&pairs);
    Ok(Epo { value, error, drawn: 2 * strata as u32, tests: watch.tests() })
}

/// Mean of the pairs and half the width of its 95 % confidence interval.
pub(super) fn estimate(pairs: &[[f64; 2]]) -> [f64; 2] {
    let strata = pairs.len() as f64;
    let mean = pairs.iter().map(|[a, b]| 0.5 * (a + b)).sum::<f64>() / strata;
    let variance = pairs.iter().map(|[a, b]| 0.25 * (a - b) * (a - b)).sum::<f64>() / (strata * strata);
    [mean, T_95 * variance.sqrt()]
}

/// What is drawn from.
pub(super) struct Sample<'a> {
    walk: &'a Walk,
    groups: &'a [Group],
    /// Area of each group and all before it.
    ends: Vec<f64>,
}

impl<'a> Sample<'a> {
    pub(super) fn new(walk: &'a Walk, groups: &'a [Group]) -> Self {
        let mut area = 0.0;
        let end = |group: &Group| {
            area += group.area * group.held.copies as f64;
            area
        };
        let ends = groups.iter().map(end).collect();
        Self { walk, groups, ends }
    }

    /// The overlap at two points of each stratum.
    pub(super) fn draw(&self, strata: usize, seed: u64, watch: &Watch<'_>) -> Result<Vec<[f64; 2]>, End> {
        let mut noise = Noise::new(seed);
        let all = self.ends.last().copied().unwrap_or(0.0);
        let point = |k: usize, part: f64| (k as f64 + part) / strata as f64 * all;
        let points: Vec<[f64; 2]> = (0..strata).map(|k| [(); 2].map(|()| point(k, noise.unit()))).collect();
        let measure = |&at: &f64| -> Result<f64, End> {
            let group = &self.groups[self.ends.partition_point(|&end| end <= at).min(self.groups.len() - 1)];
            let (overlap, tests) = self.walk.overlap(&group.corners, &group.held);
            watch.has_done(tests)?;
            Ok(overlap / (group.area * group.held.copies as f64))
        };
        points.par_iter().map(|[a, b]| Ok([measure(a)?, measure(b)?])).collect()
    }
}

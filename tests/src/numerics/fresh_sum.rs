//! The sum of the walk: afresh at every pivot, or one running sum as published.

use super::document::Block;
use super::{case, device, initial_tree, markdown, part, scene_of, texts};
use crate::other_searches::{published, published_and_recomputed, published_walk, with_search};
use prbvh::device::Device;
use prbvh::optimize::PrbvhSettings;
use prbvh::pipeline::{self, Settings};
use prbvh::scene::{Scene, built_in};
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::PrbvhParams;
use prbvh_lab::accuracy::{Offer, SearchAccuracy, Walk, kernel_walk, offers};
use std::ops::ControlFlow;

/// A relative difference of two decreases that is more than rounding of one.
const WORSE: f64 = 1e-3;

/// The two walks over one tree.
#[derive(Clone, Debug)]
pub struct Walks {
    /// Afresh at every pivot, as in the kernel.
    pub fresh: SearchAccuracy,
    /// One running sum.
    pub running: SearchAccuracy,
    /// Searches in which the running sum led to an output that is worse in f64, by more than a thousandth of the better one.
    pub worse: usize,
    /// Searches in which the fresh sum did.
    pub fresh_worse: usize,
}

impl Walks {
    /// Searches for every node of the initial tree of a case of the catalogue.
    #[must_use]
    pub fn of_case(name: &str) -> Self {
        Self::over(&initial_tree(&scene_of(case(name))))
    }

    /// Searches for every node of a tree.
    #[must_use]
    pub fn over(nodes: &[Node]) -> Self {
        let count = nodes.len() as u32;
        let params = PrbvhParams::every(1, 0, count);
        let found = |walk: Walk<'_>| offers(nodes, &params, walk);
        let (fresh, running) = (found(&kernel_walk), found(&published_walk));
        let mut exact = vec![[0.0f64; 2]; nodes.len()];
        for (k, found) in [&fresh, &running].into_iter().enumerate() {
            for &Offer { input, exact: decrease, .. } in found {
                exact[input as usize][k] = decrease;
            }
        }
        let worse = |k: usize| {
            let is_worse = |pair: &&[f64; 2]| pair[1 - k] - pair[k] > WORSE * pair[1 - k].abs();
            exact.iter().filter(is_worse).count()
        };
        Self {
            fresh: SearchAccuracy::of(count, &fresh),
            running: SearchAccuracy::of(count, &running),
            worse: worse(1),
            fresh_worse: worse(0),
        }
    }
}

/// Two tables: sums of the walks in the initial tree, and how a run ends.
#[must_use]
pub fn block() -> Block {
    let mut scenes: Vec<Scene> =
        ["scale-1", "teapot-in-stadium", "huge-and-tiny-8", "chain-2^k"].map(|name| scene_of(case(name))).into();
    scenes.push(built_in(20_000));
    let mut sums =
        vec![texts(&["scene", "sum", "candidates", "lower no cost", "drift: half", "99 %", "all", "worse output"])];
    let mut ends = vec![texts(&["scene", "fresh, recomputed", "running, recomputed", "running, as it is"])];
    for scene in &scenes {
        let name = format!("`{}`", scene.name);
        let walks = Walks::over(&initial_tree(scene));
        let named = [("fresh", &walks.fresh, walks.fresh_worse), ("running", &walks.running, walks.worse)];
        for (sum, search, worse) in named {
            let SearchAccuracy { candidates, refused_noise, raising, drift, .. } = search;
            let mut row = vec![name.clone(), sum.to_owned(), candidates.to_string()];
            row.push((refused_noise + raising).to_string());
            row.extend([drift.bound_of(0.5), drift.bound_of(0.99), drift.max].map(part));
            row.push(worse.to_string());
            sums.push(row);
        }
        let recomputed: Box<dyn Device> = Box::new(with_search(device(), published_and_recomputed));
        let as_it_is: Box<dyn Device> = Box::new(with_search(device(), published));
        let mut row = vec![name];
        row.extend([device(), recomputed, as_it_is].map(|device| end(scene, device)));
        ends.push(row);
    }
    Block::new("fresh-sum", format!("{}\n{}", markdown(&sums), markdown(&ends)))
}

/// Cost of the best tree, iterations and the end of a run.
fn end(scene: &Scene, mut device: Box<dyn Device>) -> String {
    let settings = Settings::default().with(|s| s.prbvh = PrbvhSettings::published().with(|s| s.mu = 1));
    match pipeline::optimize(scene, &mut *device, &settings, &mut |_| ControlFlow::Continue(())) {
        Err(error) => error.to_string(),
        Ok(result) => {
            let rows = &result.outcome.rows;
            let offered: u64 = rows.iter().map(|row| u64::from(row.found)).sum();
            let cost = result.quality.sah_cost;
            format!("{cost:.4}, {} iterations, {offered} moves found", rows.len() - 1)
        }
    }
}

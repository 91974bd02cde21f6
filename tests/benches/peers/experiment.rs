//! Both programs on one scene, in turn, with the same threads.

use crate::ours::{self, Configuration, Family, OurRuns};
use crate::theirs::{self, TheirRuns};
use obvhs::triangle::Triangle;
use prbvh::bvh::{self, Bvh};
use prbvh::device::{Device, on_host};
use prbvh::interop::obvhs::from_bvh2;
use prbvh::scene::{SafeRange, Scene};
use prbvh_kernel::node::Node;
use prbvh_tests::bench::curve::{Curve, Point, first_to_reach, lowest, time_to_reach};
use prbvh_tests::bench::obvhs::{cost, ploc, triangles};
use prbvh_tests::bench::targets::{AgainstPublished, PeerPoint, SceneResult};
use serde::Serialize;
use std::time::Duration;

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Experiment {
    /// The optimisers alone, on the same initial tree.
    SameTree,
    /// From triangles, each with its own builders.
    Pipelines,
}

impl Experiment {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::SameTree => "same tree",
            Self::Pipelines => "pipelines",
        }
    }
}

/// How often, and for how long.
pub(crate) struct Effort {
    pub(crate) repeat: usize,
    /// Repetitions of RBVH.
    pub(crate) repeat_slow: usize,
    /// Our runs end after the time of the slowest peer times this; none: they end by themselves.
    pub(crate) limit: Option<f64>,
    /// Only our configurations whose names contain this.
    pub(crate) ours: String,
}

/// One of our configurations on a scene.
pub(crate) struct Ours {
    pub(crate) curve: Curve,
    pub(crate) family: Family,
    pub(crate) repetitions: usize,
    pub(crate) final_cost: f64,
    pub(crate) device_error: f64,
    pub(crate) end_s: f64,
    pub(crate) is_cut: bool,
    pub(crate) stop: String,
    /// Nodes that the searches looked at until the end of the published order.
    pub(crate) visits: Option<u64>,
}

/// All points of both.
pub(crate) struct Outcome {
    pub(crate) experiment: Experiment,
    /// Cost of the tree that both start from.
    pub(crate) initial_cost: Option<f64>,
    /// Time limit of our runs, seconds.
    pub(crate) limit_s: Option<f64>,
    pub(crate) repeat: usize,
    pub(crate) theirs: Vec<(String, Point, bool)>,
    pub(crate) ours: Vec<Ours>,
    pub(crate) result: SceneResult,
}

/// The tree that both start from, in the form of either.
struct Given {
    theirs: obvhs::bvh2::Bvh2,
    ours: Vec<Node>,
    cost: f64,
}

impl Given {
    fn new(scene: &Scene, triangles: &[Triangle], device: &dyn Device) -> Self {
        let theirs = on_host(device, || ploc(triangles));
        let cost = cost(&theirs, scene).unwrap_or_else(|error| panic!("{}: {error}", scene.name));
        let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
        let tree: Bvh = from_bvh2(&theirs).unwrap_or_else(|faults| panic!("{}: {}", scene.name, bvh::summary(&faults)));
        let ours = tree.with_boxes_of(&working).to_device().unwrap_or_else(|error| panic!("{}: {error}", scene.name));
        Self { theirs, ours, cost }
    }
}

/// Runs an experiment on a scene.
pub(crate) fn run(experiment: Experiment, scene: &Scene, device: &mut dyn Device, effort: &Effort) -> Outcome {
    let triangles = triangles(scene);
    let given = (experiment == Experiment::SameTree).then(|| Given::new(scene, &triangles, device));
    let (peers, configurations) = match experiment {
        Experiment::SameTree => (theirs::reinsertion(), ours::optimizers()),
        Experiment::Pipelines => (theirs::pipelines(), ours::pipelines()),
    };
    let their_start = given.as_ref().map_or(theirs::Start::Triangles(&triangles), |g| theirs::Start::Tree(&g.theirs));
    let our_start = given.as_ref().map_or(ours::Start::Triangles, |g| ours::Start::Tree(&g.ours));
    let warm_up = |peer| on_host(device, || TheirRuns::warm_up(peer, their_start, scene));
    let mut theirs: Vec<TheirRuns<'_>> = peers.iter().map(warm_up).collect();
    let slowest = theirs.iter().map(TheirRuns::warm_up_s).fold(0.0, f64::max);
    let limit_s = effort.limit.map(|factor| factor * slowest);
    let limit = limit_s.map(Duration::from_secs_f64);
    let is_wanted = |configuration: &&Configuration| configuration.name.contains(&effort.ours);
    let mut ours: Vec<OurRuns<'_>> = configurations
        .iter()
        .filter(is_wanted)
        .map(|configuration| OurRuns::warm_up(configuration, device, scene, our_start, limit))
        .collect();
    for repetition in 0..effort.repeat {
        for k in 0..theirs.len().max(ours.len()) {
            if let Some(runs) = theirs.get_mut(k) {
                on_host(device, || runs.run(their_start, scene));
            }
            if let Some(runs) = ours.get_mut(k)
                && (!runs.configuration.is_slow() || repetition < effort.repeat_slow)
            {
                runs.run(device, scene, our_start, limit);
            }
        }
    }
    let theirs: Vec<_> = theirs.iter().flat_map(TheirRuns::points).collect();
    let published = ours.iter().filter(|runs| runs.configuration.family == Family::Published);
    let published_cost = published.map(|runs| lowest(&runs.curve().points)).min_by(f64::total_cmp);
    let ran = ours.iter().filter(|runs| runs.repetitions() > 0);
    let ours: Vec<Ours> = ran.map(|runs| summed_up(runs, published_cost)).collect();
    let result = result(scene, &theirs, &ours);
    let initial_cost = given.map(|given| given.cost);
    Outcome { experiment, initial_cost, limit_s, repeat: effort.repeat, theirs, ours, result }
}

fn summed_up(runs: &OurRuns<'_>, published_cost: Option<f64>) -> Ours {
    Ours {
        curve: runs.curve(),
        family: runs.configuration.family,
        repetitions: runs.repetitions(),
        final_cost: runs.final_cost,
        device_error: runs.device_error,
        end_s: runs.end_s(),
        is_cut: runs.is_cut(),
        stop: runs.stop.map_or_else(String::new, |stop| stop.to_string()),
        visits: published_cost.and_then(|cost| runs.visits_to(cost)),
    }
}

fn result(scene: &Scene, theirs: &[(String, Point, bool)], ours: &[Ours]) -> SceneResult {
    let curves: Vec<Curve> = ours.iter().map(|ours| ours.curve.clone()).collect();
    let points = theirs.iter().filter(|(_, _, is_judged)| *is_judged).map(|(setting, point, _)| {
        let reached = first_to_reach(&curves, point.cost);
        PeerPoint {
            setting: setting.clone(),
            time_s: point.time_s,
            cost: point.cost,
            our_time_s: reached.map(|(_, time_s)| time_s),
            by: reached.map_or_else(String::new, |(name, _)| name.to_owned()),
        }
    });
    let lowest_of = |is_meant: &dyn Fn(&Ours) -> bool| {
        let costs = ours.iter().filter(|ours| is_meant(ours)).map(|ours| ours.final_cost);
        costs.min_by(f64::total_cmp)
    };
    let whole = |family| lowest_of(&|ours| ours.family == family && !ours.is_cut);
    SceneResult {
        scene: scene.name.clone(),
        triangles: scene.triangles.len(),
        points: points.collect(),
        peer_best: lowest(&theirs.iter().map(|(_, point, _)| *point).collect::<Vec<_>>()),
        worst_first: lowest_of(&|ours| ours.family == Family::WorstFirst).unwrap_or(f64::NAN),
        lowest: lowest_of(&|_| true).unwrap_or(f64::NAN),
        rbvh: whole(Family::Rbvh),
        rbvh_undo: whole(Family::RbvhUndo),
        published: against_published(ours),
        sequential: against_sequential(ours),
    }
}

/// The first of a family's curves, of which worst first has several.
fn curves_of(ours: &[Ours], is_meant: impl Fn(Family) -> bool) -> Vec<Curve> {
    ours.iter().filter(|ours| is_meant(ours.family)).map(|ours| ours.curve.clone()).collect()
}

/// How soon, and after how many visits, worst first is where the published order ends.
fn against_published(ours: &[Ours]) -> Option<AgainstPublished> {
    let published = ours.iter().find(|ours| ours.family == Family::Published && !ours.is_cut)?;
    let cost = lowest(&published.curve.points);
    let theirs = time_to_reach(&published.curve.points, cost)?;
    let (_, time) = first_to_reach(&curves_of(ours, |family| family == Family::WorstFirst), cost)?;
    let visits = ours.iter().filter(|ours| ours.family == Family::WorstFirst).filter_map(|ours| ours.visits).min()?;
    Some(AgainstPublished { cost, time: time / theirs, visits: visits as f64 / published.visits? as f64 })
}

/// Our time ÷ RBVH's to each cost on its curves, the largest.
fn against_sequential(ours: &[Ours]) -> Option<f64> {
    let worst_first = curves_of(ours, |family| family == Family::WorstFirst);
    let rbvh = curves_of(ours, |family| matches!(family, Family::Rbvh | Family::RbvhUndo));
    let initial = worst_first.first()?.points.first()?.cost;
    let points = rbvh.iter().flat_map(|curve| &curve.points).filter(|point| point.cost < initial && point.time_s > 0.0);
    let ratios = points.map(|point| match first_to_reach(&worst_first, point.cost) {
        Some((_, time)) => time / point.time_s,
        None => f64::INFINITY,
    });
    ratios.max_by(f64::total_cmp)
}

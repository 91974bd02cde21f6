//! obvhs: settings, and their runs.

use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::triangle::Triangle;
use prbvh::scene::Scene;
use prbvh_tests::bench::curve::{Point, median_of_runs};
use prbvh_tests::bench::obvhs::{cost, ploc};
use std::time::{Duration, Instant};

/// A way through obvhs.
pub(crate) struct Peer {
    name: String,
    how: How,
    /// After how many runs of the optimiser the tree is a setting that is judged; the others are points of the curve alone.
    judged: Vec<usize>,
}

enum How {
    /// The reinsertion optimiser, run again and again: batch ratio, sequence, runs.
    Reinsertion(f32, Option<Vec<f32>>, usize),
    /// A preset of its builder.
    Preset(BvhBuildParams),
}

/// Where the clock starts.
#[derive(Clone, Copy)]
pub(crate) enum Start<'a> {
    /// With a tree in the peer's own form.
    Tree(&'a Bvh2),
    /// With triangles in the peer's own form.
    Triangles(&'a [Triangle]),
}

impl Peer {
    fn default_sequence(ratio: f32) -> Self {
        let name = format!("ratio {ratio}, default sequence");
        Self { name, how: How::Reinsertion(ratio, None, 1), judged: vec![1] }
    }

    fn preset(name: &str, params: BvhBuildParams) -> Self {
        // Only trees with each triangle in one leaf of its own can be compared.
        let params = BvhBuildParams { max_prims_per_leaf: 1, pre_split: false, ..params };
        Self { name: format!("preset {name}, single leaves, no splits"), how: How::Preset(params), judged: vec![1] }
    }

    fn setting(&self, runs: usize) -> String {
        match &self.how {
            How::Reinsertion(_, Some(_), _) => format!("{} × {runs}", self.name),
            How::Reinsertion(_, None, _) | How::Preset(_) => self.name.clone(),
        }
    }
}

/// The sweep of the reinsertion optimiser.
pub(crate) fn reinsertion() -> Vec<Peer> {
    let mut peers: Vec<Peer> = [0.02, 0.05, 0.2, 1.0].map(Peer::default_sequence).into();
    let how = How::Reinsertion(1.0, Some(vec![1.0]), 20);
    peers.push(Peer { name: "ratio 1, full passes".to_owned(), how, judged: vec![6, 20] });
    peers
}

/// Whole pipelines: the presets, and its best PLOC before the sweep.
pub(crate) fn pipelines() -> Vec<Peer> {
    let mut peers = vec![
        Peer::preset("fastest", BvhBuildParams::fastest_build()),
        Peer::preset("very fast", BvhBuildParams::very_fast_build()),
        Peer::preset("fast", BvhBuildParams::fast_build()),
        Peer::preset("medium", BvhBuildParams::medium_build()),
        Peer::preset("slow", BvhBuildParams::slow_build()),
        Peer::preset("very slow", BvhBuildParams::very_slow_build()),
    ];
    peers.extend(reinsertion().into_iter().map(|peer| Peer { name: format!("PLOC r=32, {}", peer.name), ..peer }));
    peers
}

/// The runs of a peer.
pub(crate) struct TheirRuns<'a> {
    peer: &'a Peer,
    /// Costs after each run of the optimiser.
    costs: Vec<f64>,
    times: Vec<Vec<f64>>,
    warm_up_s: f64,
}

impl<'a> TheirRuns<'a> {
    /// Warms up, and takes the cost of every tree on the way.
    pub(crate) fn warm_up(peer: &'a Peer, start: Start<'_>, scene: &Scene) -> Self {
        let (mut costs, mut warm_up_s) = (Vec::new(), 0.0);
        run(&peer.how, start, &mut |seconds, tree| {
            warm_up_s = seconds;
            costs.push(checked_cost(tree, scene));
        });
        Self { peer, costs, times: Vec::new(), warm_up_s }
    }

    /// How long the warm-up took, seconds.
    pub(crate) fn warm_up_s(&self) -> f64 {
        self.warm_up_s
    }

    /// Runs once more, on the clock. A tree that is better than that of the warm-up counts.
    pub(crate) fn run(&mut self, start: Start<'_>, scene: &Scene) {
        let mut times = Vec::new();
        let tree = run(&self.peer.how, start, &mut |seconds, _| times.push(seconds));
        self.times.push(times);
        let again = checked_cost(&tree, scene);
        if let Some(last) = self.costs.last_mut() {
            *last = last.min(again);
        }
    }

    /// Every tree on the way: setting, its median time and its cost, and whether it is judged.
    pub(crate) fn points(&self) -> Vec<(String, Point, bool)> {
        let points = median_of_runs(&self.times, &self.costs).into_iter();
        (1..).zip(points).map(|(k, point)| (self.peer.setting(k), point, self.peer.judged.contains(&k))).collect()
    }
}

fn checked_cost(tree: &Bvh2, scene: &Scene) -> f64 {
    cost(tree, scene).unwrap_or_else(|error| panic!("{}: {error}", scene.name))
}

/// Runs with the threads of the current pool. `observe` sees each tree on the way and the time until it, without its own.
fn run(how: &How, start: Start<'_>, observe: &mut dyn FnMut(f64, &Bvh2)) -> Bvh2 {
    match (how, start) {
        (How::Preset(params), Start::Triangles(triangles)) => {
            let clock = Instant::now();
            let tree = build_bvh2_from_tris(triangles, *params, &mut Duration::default());
            observe(clock.elapsed().as_secs_f64(), &tree);
            tree
        }
        (How::Preset(_), Start::Tree(_)) => panic!("a preset starts from triangles"),
        (How::Reinsertion(ratio, sequence, runs), start) => {
            let copy = match start {
                Start::Tree(tree) => tree.clone(),
                Start::Triangles(_) => Bvh2::default(),
            };
            let mut clock = Instant::now();
            let mut tree = match start {
                Start::Tree(_) => copy,
                Start::Triangles(triangles) => ploc(triangles),
            };
            let mut seconds = 0.0;
            let mut optimizer = ReinsertionOptimizer::default();
            for _ in 0..*runs {
                optimizer.run(&mut tree, *ratio, sequence.clone());
                seconds += clock.elapsed().as_secs_f64();
                observe(seconds, &tree);
                clock = Instant::now();
            }
            tree
        }
    }
}

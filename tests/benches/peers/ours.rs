//! prbvh on the CPU device: configurations, and their runs.

use prbvh::build::{self, CodeCensus, DEFAULT_RADIUS, DeviceTree, MortonBits, TreeletSize};
use prbvh::device::{Device, DeviceError, on_host};
use prbvh::optimize::{
    Order, PrbvhSettings, RbvhSettings, StopReason, TreeAreas, WorstFirst, measure_unchecked, prbvh_unchecked, rbvh,
};
use prbvh::pipeline::{Initial, Optimizer};
use prbvh::scene::{SafeRange, Scene};
use prbvh_kernel::node::Node;
use prbvh_tests::bench::agree::{confirmed, cost_of_boxes, evaluated, same_costs};
use prbvh_tests::bench::curve::{Curve, median_of_runs};
use prbvh_tests::bench::stats::median;
use std::num::NonZeroU32;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// How far the device's f32 cost may be from the f64 one.
const DEVICE_TOLERANCE: f64 = 1e-4;
/// How far two sums of the same areas in f64 may be apart.
const F64_TOLERANCE: f64 = 1e-9;

/// What a configuration counts as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    WorstFirst,
    /// The published order.
    Published,
    /// RBVH as published.
    Rbvh,
    RbvhUndo,
    Builder,
}

/// A way through prbvh.
#[derive(Clone, Debug)]
pub(crate) struct Configuration {
    pub(crate) name: String,
    pub(crate) family: Family,
    /// For runs from triangles.
    initial: Initial,
    optimizer: Optimizer,
    prbvh: PrbvhSettings,
}

impl Configuration {
    /// RBVH runs on one thread for as long as all others together.
    pub(crate) fn is_slow(&self) -> bool {
        matches!(self.family, Family::Rbvh | Family::RbvhUndo)
    }

    fn rbvh(undo: bool) -> Self {
        Self {
            name: if undo { "rbvh undo" } else { "rbvh" }.to_owned(),
            family: if undo { Family::RbvhUndo } else { Family::Rbvh },
            initial: Initial::default(),
            optimizer: Optimizer::Rbvh(RbvhSettings::default().with(|s| s.undo = undo)),
            prbvh: PrbvhSettings::default(),
        }
    }

    fn from(self, name: &str, initial: Initial) -> Self {
        let name = if self.family == Family::Builder { name.to_owned() } else { format!("{name}, {}", self.name) };
        Self { name, initial, ..self }
    }
}

/// The schedules of PRBVH that are tried. A new one is a new line.
fn schedules() -> Vec<Configuration> {
    let worst_first = |name: &str, worst_first| {
        let settings = PrbvhSettings::default().with(|s| {
            s.order = Order::WorstFirst;
            s.worst_first = worst_first;
        });
        (format!("worst first{name}"), Family::WorstFirst, settings)
    };
    let default = WorstFirst::default();
    let tried = [
        worst_first("", default),
        worst_first(" from 64", default.with(|s| s.first = 64)),
        ("published µ=9 ε=0.0001".to_owned(), Family::Published, PrbvhSettings::published()),
    ];
    let configuration = |(name, family, prbvh)| Configuration {
        name,
        family,
        initial: Initial::default(),
        optimizer: Optimizer::Prbvh,
        prbvh,
    };
    tried.into_iter().map(configuration).collect()
}

/// Optimisers of a given tree.
pub(crate) fn optimizers() -> Vec<Configuration> {
    let mut all = schedules();
    all.extend([false, true].map(Configuration::rbvh));
    all
}

/// Whole pipelines: every builder alone, the quickest before one schedule, the better ones before all.
pub(crate) fn pipelines() -> Vec<Configuration> {
    const SMALL: NonZeroU32 = NonZeroU32::new(2).unwrap();
    const LARGE: NonZeroU32 = NonZeroU32::new(32).unwrap();
    let ploc = |radius: NonZeroU32| (format!("ploc r={radius}"), Initial::Ploc { radius });
    let lbvh = ("lbvh".to_owned(), Initial::Lbvh);
    let atrbvh = ("atrbvh".to_owned(), Initial::Atrbvh { treelet: TreeletSize::default() });
    let nothing = Configuration {
        name: String::new(),
        family: Family::Builder,
        initial: Initial::default(),
        optimizer: Optimizer::None,
        prbvh: PrbvhSettings::default(),
    };
    let (one, all) = (1, usize::MAX);
    let mut pipelines = Vec::new();
    for ((name, initial), schedules_of_it) in
        [(lbvh, one), (ploc(SMALL), 0), (ploc(DEFAULT_RADIUS), all), (ploc(LARGE), 0), (atrbvh.clone(), all)]
    {
        pipelines.push(nothing.clone().from(&name, initial.clone()));
        let tried = schedules().into_iter().take(schedules_of_it);
        pipelines.extend(tried.map(|schedule| schedule.from(&name, initial.clone())));
    }
    pipelines.extend([false, true].map(|undo| Configuration::rbvh(undo).from(&atrbvh.0, atrbvh.1.clone())));
    pipelines
}

/// Where the clock starts.
#[derive(Clone, Copy)]
pub(crate) enum Start<'a> {
    /// With the nodes of a tree on the device.
    Tree(&'a [Node]),
    /// With the triangles of the scene.
    Triangles,
}

/// The runs of a configuration.
pub(crate) struct OurRuns<'a> {
    pub(crate) configuration: &'a Configuration,
    /// Costs of the trees on the way, in f64.
    costs: Vec<f64>,
    /// The same as the device says them: equal bits in every run.
    device_costs: Vec<f64>,
    times: Vec<Vec<f64>>,
    ends: Vec<f64>,
    /// Nodes that the searches had looked at by then; 0 where nobody counts.
    visits: Vec<u64>,
    /// Cost of the best tree handed out, by the f64 evaluator.
    pub(crate) final_cost: f64,
    /// Device's cost of that tree ÷ its cost in f64 - 1, the largest of all runs.
    pub(crate) device_error: f64,
    pub(crate) stop: Option<StopReason>,
}

impl<'a> OurRuns<'a> {
    /// Warms up, and takes the cost of every tree on the way in f64. RBVH counts in f64 by itself and needs no warm-up.
    pub(crate) fn warm_up(
        configuration: &'a Configuration,
        device: &mut dyn Device,
        scene: &Scene,
        start: Start<'_>,
        limit: Option<Duration>,
    ) -> Self {
        let mut runs = Self {
            configuration,
            costs: Vec::new(),
            device_costs: Vec::new(),
            times: Vec::new(),
            ends: Vec::new(),
            visits: Vec::new(),
            final_cost: f64::INFINITY,
            device_error: 0.0,
            stop: None,
        };
        if !configuration.is_slow() {
            // Taking the costs takes time, too.
            let sample = sample(configuration, device, scene, start, limit.map(|limit| limit * 4), true);
            runs.costs.clone_from(&sample.exact);
            runs.note(&sample, scene);
        }
        runs
    }

    /// Runs once more, on the clock.
    pub(crate) fn run(&mut self, device: &mut dyn Device, scene: &Scene, start: Start<'_>, limit: Option<Duration>) {
        let sample = sample(self.configuration, device, scene, start, limit, false);
        self.note(&sample, scene);
        if self.configuration.is_slow() && sample.costs.len() > self.costs.len() {
            self.costs.clone_from(&sample.costs);
        }
        if sample.visits.len() > self.visits.len() {
            self.visits.clone_from(&sample.visits);
        }
        self.stop = Some(sample.stop);
        self.times.push(sample.times);
        self.ends.push(sample.end_s);
    }

    /// Checks the run against the earlier ones and the tree against its costs.
    fn note(&mut self, sample: &Sample, scene: &Scene) {
        let noted = self.checked(sample, scene);
        noted.unwrap_or_else(|error| panic!("{}: {}: {error}", scene.name, self.configuration.name));
    }

    fn checked(&mut self, sample: &Sample, scene: &Scene) -> Result<(), String> {
        same_costs(&self.device_costs, &sample.costs)?;
        if sample.costs.len() > self.device_costs.len() {
            self.device_costs.clone_from(&sample.costs);
        }
        let cost = evaluated(&sample.nodes, scene)?;
        let best = (0..sample.costs.len()).min_by(|&a, &b| sample.costs[a].total_cmp(&sample.costs[b]));
        let best = best.ok_or("not even the initial tree has a cost")?;
        let tolerance = if self.configuration.is_slow() { F64_TOLERANCE } else { DEVICE_TOLERANCE };
        let device_error = confirmed(sample.costs[best], cost, tolerance)?;
        if let Some(&exact) = self.costs.get(best) {
            confirmed(exact, cost, F64_TOLERANCE)?;
        }
        self.final_cost = self.final_cost.min(cost);
        self.device_error = self.device_error.max(device_error.abs());
        Ok(())
    }

    /// Medians of the times, costs in f64.
    pub(crate) fn curve(&self) -> Curve {
        Curve { name: self.configuration.name.clone(), points: median_of_runs(&self.times, &self.costs) }
    }

    /// Nodes that the searches looked at until the first tree of at most this cost.
    pub(crate) fn visits_to(&self, cost: f64) -> Option<u64> {
        let reached = self.costs.iter().position(|&own| own <= cost)?;
        self.visits.get(reached).copied()
    }

    pub(crate) fn repetitions(&self) -> usize {
        self.times.len()
    }

    /// Median of the times until the best tree is back in place.
    pub(crate) fn end_s(&self) -> f64 {
        median(&self.ends)
    }

    /// Whether the time limit ended it.
    pub(crate) fn is_cut(&self) -> bool {
        self.stop == Some(StopReason::MaxTime)
    }
}

/// A run.
struct Sample {
    /// Times of the trees on the way, seconds; the first is the initial tree.
    times: Vec<f64>,
    /// Their costs as the optimiser says them.
    costs: Vec<f64>,
    /// Their costs in f64, where that was asked for.
    exact: Vec<f64>,
    /// Nodes that the searches had looked at by then.
    visits: Vec<u64>,
    end_s: f64,
    nodes: Vec<Node>,
    stop: StopReason,
}

/// Runs a configuration; with `is_exact` the clock means nothing.
fn sample(
    configuration: &Configuration,
    device: &mut dyn Device,
    scene: &Scene,
    start: Start<'_>,
    limit: Option<Duration>,
    is_exact: bool,
) -> Sample {
    let made = match start {
        Start::Tree(nodes) => DeviceTree::upload(device, nodes).and_then(|tree| {
            // A tree in our form knows its areas.
            let (areas, _) = measure_unchecked(device, &tree)?;
            let clock = Instant::now();
            optimized(configuration, device, (tree, areas), clock, 0.0, limit, is_exact)
        }),
        Start::Triangles => {
            let clock = Instant::now();
            built(&configuration.initial, device, scene).and_then(|tree| {
                let (areas, _) = measure_unchecked(device, &tree)?;
                let start_s = clock.elapsed().as_secs_f64();
                optimized(configuration, device, (tree, areas), clock, start_s, limit, is_exact)
            })
        }
    };
    made.unwrap_or_else(|error| panic!("{}: {}: {error}", scene.name, configuration.name))
}

/// All that lies between triangles and an initial tree on the device.
fn built(initial: &Initial, device: &mut dyn Device, scene: &Scene) -> Result<DeviceTree, DeviceError> {
    let (working, codes) = on_host(device, || {
        let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
        let census = CodeCensus::of(&scene.triangles, scene.census.min, scene.census.max);
        (working, census.enough(MortonBits::default()))
    });
    match initial {
        Initial::Lbvh => Ok(build::lbvh(device, &working, codes)?.0),
        Initial::Ploc { radius } => Ok(build::ploc(device, &working, codes, *radius)?.0),
        Initial::Atrbvh { treelet } => Ok(build::atrbvh(device, &working, codes, *treelet)?.0),
        other => panic!("{other} is not among the configurations"),
    }
}

/// Optimises a tree on the device, on a clock that runs. `start_s` is when the tree was there.
fn optimized(
    configuration: &Configuration,
    device: &mut dyn Device,
    (tree, areas): (DeviceTree, TreeAreas),
    clock: Instant,
    start_s: f64,
    limit: Option<Duration>,
    is_exact: bool,
) -> Result<Sample, DeviceError> {
    let (mut times, mut costs, mut exact, mut visits) = (vec![start_s], Vec::new(), Vec::new(), vec![0, 0]);
    let stop = match &configuration.optimizer {
        Optimizer::Prbvh => {
            let mut settings = configuration.prbvh.clone();
            settings.limits.max_time = limit;
            if is_exact {
                settings.news = Duration::ZERO;
            }
            // Rows of one submission are seen together, and know their times.
            let mut set_up_s = None;
            let outcome = prbvh_unchecked(device, &tree, Some(areas), &settings, &mut |row, tree, device| {
                let set_up_s = *set_up_s.get_or_insert(clock.elapsed().as_secs_f64() - row.time_s);
                times.push(set_up_s + row.time_s);
                costs.push(row.cost);
                visits.push(visits.last().map_or(0, |before| before + u64::from(row.visits)));
                if is_exact {
                    exact.push(cost_of_boxes(&tree.download(device).expect("the device works")));
                }
                ControlFlow::Continue(())
            })?;
            outcome.stop
        }
        Optimizer::Rbvh(settings) => {
            let mut settings = settings.clone();
            settings.limits.max_time = limit;
            let mut nodes = tree.download(device)?;
            let outcome = rbvh(&mut nodes, &settings, &mut |row, _| {
                if costs.last().is_none_or(|best| row.cost < *best) {
                    times.push(clock.elapsed().as_secs_f64());
                    costs.push(row.cost);
                }
                ControlFlow::Continue(())
            });
            let outcome = outcome.unwrap_or_else(|error| panic!("{error}"));
            device.upload(&tree.nodes, bytemuck::cast_slice(&nodes))?;
            outcome.stop
        }
        _ => StopReason::NoOptimizer,
    };
    let end_s = clock.elapsed().as_secs_f64();
    let nodes = tree.download(device)?;
    tree.free(device);
    if configuration.optimizer == Optimizer::None {
        costs.push(cost_of_boxes(&nodes));
        exact.clone_from(&costs);
    } else {
        // The initial tree is at hand before the optimiser has looked at it.
        costs.insert(0, costs[0]);
        if is_exact {
            exact.insert(0, exact[0]);
        }
    }
    // The initial tree is there twice.
    visits.remove(0);
    Ok(Sample { times, costs, exact, visits, end_s, nodes, stop })
}

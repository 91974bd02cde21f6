//! One method on one scene: the tree, measured.

use super::methods::{Builder, Job};
use super::on_host::HostBuilder;
use super::peers::{self, PeerError, PeerHost};
use super::{MethodError, OptimizerRun, Purpose};
use crate::phases::PhaseTimes;
use prbvh::build::DeviceTree;
use prbvh::bvh::{self, Bvh, DepthBound, MaxDepth, Quality, SahModel};
use prbvh::collapse::{CollapseSettings, collapse};
use prbvh::device::{Device, DeviceError, DeviceKind, Meter, Timing};
use prbvh::optimize::{IterationRow, StopReason};
use prbvh::pipeline::{self, Optimizer, Settings};
use prbvh::scene::{SafeRange, Scene};
use prbvh::stop::Stop;
use prbvh::wide::PackedTree;
use prbvh_kernel::setup::Triangle;
use std::ops::ControlFlow;
use std::time::Instant;

/// A scene, and its triangles in the safe range.
#[derive(Debug)]
pub(super) struct Subject<'a> {
    pub(super) scene: &'a Scene,
    working: Vec<Triangle>,
}

/// What methods run with.
#[derive(Clone, Debug, Default)]
pub(super) struct Host {
    /// Threads of what runs on the CPU; 0: one per core.
    pub(super) threads: usize,
    /// Bound on the depth of trees of our own.
    pub(super) max_depth: MaxDepth,
    /// How peers are run.
    pub(super) peers: Option<PeerHost>,
    /// Whether the comparison is to end.
    pub(super) stop: Stop,
}

/// A tree with one triangle per leaf, and how it came about.
#[derive(Clone, Debug)]
pub(super) struct Made {
    pub(super) tree: Bvh,
    /// The tree that rays go through in place of the one with adaptive leaves.
    pub(super) wide: Option<PackedTree>,
    pub(super) quality: Quality,
    /// What the bound on the depth changed.
    pub(super) bound: Option<DepthBound>,
    pub(super) hash: String,
    /// Wall time from the triangles, seconds.
    pub(super) wall_s: f64,
    /// Of it, time of the kernels, seconds, without those of new tops.
    pub(super) device_s: Option<f64>,
    /// Most bytes of device buffers.
    pub(super) bytes: Option<u64>,
    pub(super) threads: u32,
    pub(super) run: OptimizerRun,
}

impl<'a> Subject<'a> {
    pub(super) fn new(scene: &'a Scene) -> Self {
        Self { scene, working: SafeRange::of(&scene.triangles).apply(&scene.triangles) }
    }

    /// Runs a method. `device` is for those that run on one.
    pub(super) fn make(&self, job: &Job, device: &mut dyn Device, host: &Host) -> Result<Made, MethodError> {
        let is_cpu = device.info().kind == DeviceKind::Cpu;
        let threads = u32::try_from(if is_cpu { host.threads } else { 0 }).unwrap_or(u32::MAX);
        let mut made = match &job.builder {
            Builder::Pipeline(settings) => {
                let settings = Settings::clone(settings).with(|s| s.max_depth = host.max_depth);
                self.by_pipeline(&settings, device, &host.stop)?
            }
            Builder::Host { threads, build } => {
                return self.on_host(job, threads.unwrap_or(host.threads), *build, host);
            }
            Builder::Peer(peer) => return self.by_peer(job, peer, host),
        };
        made.threads = threads;
        made.run.method.clone_from(&job.method);
        made.run.mu = job.mu.unwrap_or(0);
        Ok(made)
    }

    fn by_pipeline(&self, settings: &Settings, device: &mut dyn Device, stop: &Stop) -> Result<Made, MethodError> {
        let mut meter = Meter::new(device);
        let mut settings = settings.clone();
        settings.limits_mut().stop = Some(stop.clone());
        let result = pipeline::optimize(self.scene, &mut meter, &settings, &mut |_| ControlFlow::Continue(()))?;
        if result.outcome.stop == StopReason::Cancelled {
            // What it had by then is not what the method makes.
            return Err(DeviceError::Stopped.into());
        }
        let run = OptimizerRun {
            initial: settings.initial.to_string(),
            strategy: match settings.optimizer {
                Optimizer::Prbvh => settings.prbvh.strategy.to_string(),
                _ => String::new(),
            },
            build_device_s: Some(seconds(&result.build_timings)),
            rows: result.outcome.rows,
            plan: result.plan.lines(),
            ..run_of_builder(&result.quality, result.build_s)
        };
        let wide = result.wide.map(|wide| wide.tree);
        let made = metered(&meter, result.tree, result.quality, result.build_s + result.optimize_s, run);
        Ok(Made { bound: result.bound, wide, ..made })
    }

    fn on_host(&self, job: &Job, threads: usize, build: HostBuilder, host: &Host) -> Result<Made, MethodError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let start = Instant::now();
        let built = pool.install(|| build(&self.working, &host.stop))?;
        let mut wall_s = start.elapsed().as_secs_f64();
        let tree = Bvh::from_device(&built.nodes).map_err(MethodError::InvalidTree)?;
        let (mut tree, mut quality) = checked(tree, self.scene)?;
        let start = Instant::now();
        let bound = pool.install(|| bvh::bound_depth(&mut tree, host.max_depth, &SahModel::default()))?;
        wall_s += start.elapsed().as_secs_f64();
        if bound.is_some() {
            (tree, quality) = checked(tree, self.scene)?;
        }
        let mut run = run_of_builder(&quality, wall_s);
        if let Some((build_s, rows)) = built.optimizer {
            (run.build_s, run.rows) = (build_s, rows);
        }
        let made = self.by_others(job, "cpu (host)", threads, (tree, quality), wall_s, run);
        Ok(Made { bound, ..made })
    }

    fn by_peer(&self, job: &Job, peer: &str, host: &Host) -> Result<Made, MethodError> {
        let program = host.peers.as_ref().ok_or(PeerError::NoHost)?;
        let built = peers::run(program, peer, &self.scene.triangles, host.threads, &host.stop)?;
        let wall_s = built.build_s;
        let (tree, quality) = checked(built.into_bvh(), self.scene)?;
        let run = run_of_builder(&quality, wall_s);
        Ok(self.by_others(job, "cpu (peer)", host.threads, (tree, quality), wall_s, run))
    }

    fn by_others(
        &self,
        job: &Job,
        device: &str,
        threads: usize,
        (tree, quality): (Bvh, Quality),
        wall_s: f64,
        run: OptimizerRun,
    ) -> Made {
        Made {
            hash: bvh::tree_hash(&tree),
            tree,
            wide: None,
            quality,
            bound: None,
            wall_s,
            device_s: None,
            bytes: None,
            threads: u32::try_from(threads).unwrap_or(u32::MAX),
            run: OptimizerRun { method: job.method.clone(), device: device.to_owned(), ..run },
        }
    }

    /// The tree with adaptive leaves as the paper has them, made on a device, and its quality.
    pub(super) fn adaptive(&self, tree: &Bvh, device: &mut dyn Device) -> Result<(Bvh, Quality), MethodError> {
        if tree.has_splits(self.scene.triangles.len()) {
            return self.adaptive_with_splits(tree, device);
        }
        let nodes = tree.clone().with_boxes_of(&self.working).to_device()?;
        let mut meter = Meter::new(device);
        let uploaded = DeviceTree::upload(&mut meter, &nodes)?;
        let collapsed = collapse(&mut meter, &uploaded, &CollapseSettings::default())?.free(&mut meter);
        checked(collapsed, self.scene)
    }

    /// The same of a tree whose leaves hold pieces.
    fn adaptive_with_splits(&self, tree: &Bvh, device: &mut dyn Device) -> Result<(Bvh, Quality), MethodError> {
        let settings = Settings::default().with(|s| {
            s.initial = tree.clone().into();
            s.optimizer = Optimizer::None;
            s.adaptive = Some(CollapseSettings::default());
            s.max_depth = MaxDepth::OFF;
        });
        let made = pipeline::optimize(self.scene, device, &settings, &mut |_| ControlFlow::Continue(()))?;
        checked(made.tree, self.scene)
    }
}

fn seconds(timings: &[Timing]) -> f64 {
    timings.iter().map(|timing| timing.seconds).sum()
}

/// What a builder's run looks like: one row.
fn run_of_builder(quality: &Quality, build_s: f64) -> OptimizerRun {
    OptimizerRun {
        method: String::new(),
        purpose: Purpose::Table,
        initial: String::new(),
        strategy: String::new(),
        mu: 0,
        device: String::new(),
        build_s,
        build_device_s: None,
        rows: vec![IterationRow::default().with(|row| row.cost = quality.sah_cost)],
        phases: Vec::new(),
        plan: Vec::new(),
    }
}

fn metered(meter: &Meter<'_>, tree: Bvh, quality: Quality, wall_s: f64, run: OptimizerRun) -> Made {
    let mut phases = PhaseTimes::default();
    phases.add(meter.timings());
    Made {
        hash: bvh::tree_hash(&tree),
        tree,
        wide: None,
        quality,
        bound: None,
        wall_s,
        // Nothing ran on it, as with a builder on the host.
        device_s: Some(meter.device_s()).filter(|&seconds| seconds > 0.0),
        bytes: Some(meter.memory().peak_bytes),
        threads: 0,
        run: OptimizerRun { device: meter.info().name.clone(), phases: phases.phases(), ..run },
    }
}

/// The tree with the boxes of the scene's triangles, if it is one over them; with splits those of its pieces stay. Its links are not trusted.
fn checked(tree: Bvh, scene: &Scene) -> Result<(Bvh, Quality), MethodError> {
    if tree.has_splits(scene.triangles.len()) {
        bvh::validate_tree(&tree, &scene.triangles).map_err(MethodError::InvalidTree)?;
        let quality = bvh::quality(&tree, &SahModel::default());
        return Ok((tree, quality));
    }
    let faults = bvh::links_and_leaves(&tree, scene.triangles.len());
    if !faults.is_empty() {
        return Err(MethodError::InvalidTree(faults));
    }
    let tree = tree.with_boxes_of(&scene.triangles);
    bvh::validate(&tree, Some(&scene.triangles)).map_err(MethodError::InvalidTree)?;
    let quality = bvh::quality(&tree, &SahModel::default());
    Ok((tree, quality))
}

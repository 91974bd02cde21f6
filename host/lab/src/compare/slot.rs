//! A method on a device: its repetitions, and the rows that come of them.

use super::data::with_mu;
use super::error::in_a_line;
use super::measure::{Host, Made, Subject};
use super::methods::{Builder, Job};
use super::rays::{Hits, Traced, Views, sees_nothing};
use super::{MethodError, MethodRow, OptimizerRun, RayRates, RaySettings, median};
use crate::render::TracedTree;
use prbvh::bvh::{self, DepthBound, Epo, Quality, SahModel};
use prbvh::device::{Device, DeviceError};
use std::ops::ControlFlow;

/// What the repetitions of all methods on a scene share.
pub(super) struct SceneState<'a> {
    pub(super) subject: Subject<'a>,
    pub(super) views: Views,
    /// What the rays must hit, and the method that said so first.
    pub(super) reference: Option<(String, Hits)>,
    pub(super) host: &'a Host,
    pub(super) rays: Option<(RaySettings, usize)>,
    /// Whether pictures are wanted.
    pub(super) pictures: bool,
}

/// A method, the device that builds, and the devices that trace.
pub(super) struct Slot<'a> {
    job: &'a Job,
    /// The device that builds and makes the adaptive leaves. A method that runs on the host has rows for all devices that trace.
    device: usize,
    traces: Vec<Trace>,
    walls: Vec<f64>,
    kernels: Vec<f64>,
    first: Option<First>,
    runs: Vec<OptimizerRun>,
    status: Option<String>,
    has_heat_map: bool,
}

/// What every repetition must find again.
struct First {
    hash: String,
    quality: Quality,
    bound: Option<DepthBound>,
    adaptive: Option<Quality>,
    epo: Epo,
    bytes: Option<u64>,
    references: u32,
    threads: u32,
}

struct Trace {
    device: usize,
    seconds: Vec<[f64; 3]>,
    traced: Option<Traced>,
}

/// The slots of the jobs, in the order of the table.
pub(super) fn slots(jobs: &[Job], devices: usize, is_traced: bool) -> Vec<Slot<'_>> {
    let mut slots = Vec::new();
    // Where the tests per pixel are shown: before and after.
    let shown = |job: &Job| job.method == "lbvh" || job.mu == jobs.iter().rev().find_map(|job| job.mu);
    for job in jobs {
        let slot = |device, traced: Vec<usize>| Slot {
            job,
            device,
            traces: traced.into_iter().map(|device| Trace { device, seconds: Vec::new(), traced: None }).collect(),
            walls: Vec::new(),
            kernels: Vec::new(),
            first: None,
            runs: Vec::new(),
            status: None,
            has_heat_map: device == 0 && (job.mu.is_some() || job.method == "lbvh") && shown(job),
        };
        match job.builder {
            Builder::Pipeline(_) => slots.extend((0..devices).map(|d| slot(d, vec![d]))),
            Builder::Host { .. } | Builder::Peer(_) if is_traced => slots.push(slot(0, (0..devices).collect())),
            Builder::Host { .. } | Builder::Peer(_) => slots.push(slot(0, vec![0])),
        }
    }
    slots
}

impl Slot<'_> {
    /// Method, µ and device, for the log.
    pub(super) fn name(&self, devices: &[Box<dyn Device>]) -> String {
        let on = match self.job.builder {
            Builder::Pipeline(_) => format!(" on {}", devices[self.device].info().name),
            Builder::Host { .. } | Builder::Peer(_) => String::new(),
        };
        format!("{}{on}", with_mu(&self.job.method, self.job.mu))
    }

    pub(super) fn failed(&self) -> Option<&str> {
        self.status.as_deref()
    }

    /// The cost, if a tree was made.
    pub(super) fn cost(&self) -> Option<f64> {
        Some(self.first.as_ref()?.quality.sah_cost)
    }

    /// One repetition; what goes wrong becomes the status, unless the comparison is to end.
    pub(super) fn repeat(&mut self, scene: &mut SceneState<'_>, devices: &mut [Box<dyn Device>]) {
        let whole = self.walls.len();
        if let Err(error) = self.try_repeat(scene, devices) {
            if scene.host.stop.is_asked() {
                self.forget_all_but(whole);
            } else {
                self.status = Some(in_a_line(&error));
            }
        }
    }

    /// A repetition that was not let to its end counts for nothing.
    fn forget_all_but(&mut self, whole: usize) {
        self.walls.truncate(whole);
        self.kernels.truncate(whole);
        self.runs.truncate(whole);
        for trace in &mut self.traces {
            trace.seconds.truncate(whole);
            if whole == 0 {
                trace.traced = None;
            }
        }
        if whole == 0 {
            self.first = None;
        }
    }

    fn try_repeat(&mut self, scene: &mut SceneState<'_>, devices: &mut [Box<dyn Device>]) -> Result<(), MethodError> {
        let made = scene.subject.make(self.job, &mut *devices[self.device], scene.host)?;
        self.check_same(&made, scene)?;
        self.walls.push(made.wall_s);
        self.kernels.extend(made.device_s);
        let (adaptive, quality) = scene.subject.adaptive(&made.tree, &mut *devices[self.device])?;
        let rayed = made.wide.as_ref().map_or(TracedTree::Binary(&adaptive), TracedTree::Wide);
        if let Some(first) = &mut self.first {
            first.adaptive = Some(quality);
        }
        self.runs.push(made.run);
        let Some((rays, up)) = scene.rays else { return Ok(()) };
        for trace in &mut self.traces {
            // The pictures are those of the first repetition on the first device.
            let wants_heat_map = self.has_heat_map && trace.device == 0 && trace.traced.is_none();
            let heat_of = (scene.pictures && wants_heat_map).then_some(self.job.method.as_str());
            let device = &mut *devices[trace.device];
            let traced = scene.views.trace(device, scene.subject.scene, rayed, (&rays, up), heat_of)?;
            match &scene.reference {
                None => {
                    if sees_nothing(&traced) {
                        tracing::warn!("{}: no triangle is in any view", scene.subject.scene.name);
                    }
                    scene.reference = Some((self.job.method.clone(), traced.hits.clone()));
                }
                Some((method, expected)) => {
                    if let Some(difference) = traced.hits.difference(expected) {
                        return Err(MethodError::OtherHits(format!("{difference}, as with {method}")));
                    }
                }
            }
            trace.seconds.push(traced.seconds);
            trace.traced = Some(traced);
        }
        Ok(())
    }

    /// Keeps the first tree; a later one of ours must be the same. Another library promises nothing.
    fn check_same(&mut self, made: &Made, scene: &SceneState<'_>) -> Result<(), MethodError> {
        match &self.first {
            Some(first) if first.hash != made.hash && !matches!(self.job.builder, Builder::Peer(_)) => {
                Err(MethodError::OtherTree { first: first.hash.clone(), second: made.hash.clone() })
            }
            Some(_) => Ok(()),
            None => {
                let (triangles, stop) = (&scene.subject.scene.triangles, &scene.host.stop);
                let observe = |_| if stop.is_asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
                let (sah, budget) = (SahModel::default(), bvh::epo_budget(triangles.len()));
                let epo = bvh::epo_watched(&made.tree, triangles, &sah, budget, &observe);
                self.first = Some(First {
                    hash: made.hash.clone(),
                    quality: made.quality,
                    bound: made.bound,
                    adaptive: None,
                    epo: epo.ok_or(DeviceError::Stopped)?,
                    bytes: made.bytes,
                    references: u32::try_from(made.tree.references()).unwrap_or(u32::MAX),
                    threads: made.threads,
                });
                Ok(())
            }
        }
    }

    /// The rows, one per device that traces, and the run whose time is the median.
    pub(super) fn into_rows(
        mut self,
        scene: &str,
        devices: &[Box<dyn Device>],
        unfinished: &str,
    ) -> (Vec<MethodRow>, Option<OptimizerRun>) {
        let is_traced = self.traces.iter().any(|trace| trace.traced.is_some());
        let built_on = match self.job.builder {
            Builder::Pipeline(_) => devices[self.device].info().name.as_str(),
            Builder::Host { .. } => "cpu (host)",
            Builder::Peer(_) => "cpu (peer)",
        };
        let first = self.first.as_ref();
        let iterations = self.runs.first().and_then(|run| run.rows.last()).map(|row| row.iteration);
        let status = self.status.clone().unwrap_or_else(|| match self.walls.len() {
            0 => unfinished.to_owned(),
            _ => "ok".to_owned(),
        });
        let row = MethodRow {
            scene: scene.to_owned(),
            method: self.job.method.clone(),
            mu: self.job.mu,
            device: built_on.to_owned(),
            threads: first.map_or(0, |first| first.threads),
            cost: first.map(|first| first.quality.sah_cost),
            adaptive_cost: first.and_then(|first| first.adaptive).map(|quality| quality.sah_cost),
            build_s: median(&self.walls),
            device_s: median(&self.kernels),
            depth: first.map(|first| first.quality.max_depth),
            stack: first.and_then(|first| first.adaptive).map(|quality| quality.stack),
            bound: first.and_then(|first| first.bound),
            epo: first.map(|first| first.epo.value),
            epo_error: first.map(|first| first.epo.error),
            bytes: first.and_then(|first| first.bytes),
            references: first.map(|first| first.references),
            iterations: iterations.filter(|&iterations| iterations > 0),
            tree_hash: first.map(|first| first.hash.clone()),
            status,
            ..MethodRow::default()
        };
        // Where no device traced, one row says it all.
        let shown = if is_traced { self.traces.len() } else { 1 };
        let rows = self.traces.iter().take(shown).map(|trace| trace.row(row.clone(), devices)).collect();
        let time = |run: &OptimizerRun| run.build_s + run.rows.last().map_or(0.0, |row| row.time_s);
        self.runs.sort_by(|a, b| time(a).total_cmp(&time(b)));
        let middle = self.runs.len() / 2;
        (rows, self.runs.into_iter().nth(middle))
    }
}

impl Trace {
    fn row(&self, row: MethodRow, devices: &[Box<dyn Device>]) -> MethodRow {
        let Some(traced) = &self.traced else { return row };
        let rate = |rays: u64, seconds: Option<f64>| match seconds {
            Some(seconds) if seconds > 0.0 => rays as f64 * 1e-6 / seconds,
            _ => 0.0,
        };
        let kind = |k: usize| {
            let seconds: Vec<f64> = self.seconds.iter().map(|seconds| seconds[k]).collect();
            rate(traced.rays[k], median(&seconds))
        };
        let all: Vec<f64> = self.seconds.iter().map(|seconds| seconds.iter().sum()).collect();
        let overall = rate(traced.rays.iter().sum(), median(&all));
        MethodRow {
            traced_on: Some(devices[self.device].info().name.clone()),
            mrays: Some(RayRates { overall, primary: kind(0), shadow: kind(1), secondary: kind(2) }),
            box_tests: Some(traced.tests[0]),
            triangle_tests: Some(traced.tests[1]),
            ..row
        }
    }
}

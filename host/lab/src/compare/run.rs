//! All methods on all scenes.

use super::data::with_mu;
use super::error::in_a_line;
use super::measure::{Host, Subject};
use super::methods::Job;
use super::peers::PeerHost;
use super::rays::Views;
use super::slot::{SceneState, slots};
use super::{
    Comparison, MethodRow, OptimizerRun, Purpose, RaySettings, SCHEMA, SceneComparison, against_rbvh, figures,
};
use crate::machine::Machine;
use crate::program::Program;
use crate::reference::{ReferenceCost, ReferenceCosts};
use crate::render::TracedTree;
use prbvh::bvh::{MaxDepth, SahModel};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{Device, DeviceError, Stoppable};
use prbvh::scene::{Scene, built_in};
use prbvh::stop::Stop;
use std::ops::ControlFlow;

/// What to compare, and how.
#[derive(Clone, Debug)]
pub struct CompareSettings {
    /// The methods ([`super::jobs`]).
    pub jobs: Vec<Job>,
    /// Times are medians of so many runs; the methods take turns. At least 1.
    pub repeat: u32,
    /// Threads of what runs on the CPU but outside the devices; 0: one per core.
    pub threads: usize,
    /// Most links between the root and a leaf of trees of our own, with one triangle per leaf. Trees of other libraries stay as they are.
    pub max_depth: MaxDepth,
    /// The rays; none: nothing is traced.
    pub rays: Option<RaySettings>,
    /// Axis that points up, 0 to 2.
    pub up: usize,
    /// Whether pictures are kept.
    pub pictures: bool,
    /// Whether the runs are made that only the figures show.
    pub figures: bool,
    /// How other libraries are run; none: their rows say that they cannot be.
    pub peers: Option<PeerHost>,
    /// Ends the comparison within a method, whose row then says that it was not run. A method on a device ends at its next command if the device is a
    /// [`Stoppable`](prbvh::device::Stoppable) of the same.
    pub stop: Stop,
}

/// A step of a comparison, told before it and after it.
#[derive(Clone, Debug)]
pub struct Step {
    /// Scene.
    pub scene: String,
    /// Method, µ and device.
    pub method: String,
    /// Steps before it.
    pub done: usize,
    /// Steps in all, less those that failures make needless.
    pub of: usize,
    /// What came of it, once it is over: the cost with one triangle per leaf, or what went wrong.
    pub outcome: Option<Result<f64, String>>,
}

/// Status of a method that was not run because the comparison was stopped.
pub const NOT_RUN: &str = "not run: interrupted";

/// Compares. Never fails as a whole: what goes wrong is the status of its row. `observe` sees each step before and after it; if it breaks,
/// what was measured so far is returned.
///
/// # Panics
/// If there are no devices.
pub fn compare(
    scenes: &[Scene],
    devices: &mut [Box<dyn Device>],
    settings: &CompareSettings,
    observe: &mut dyn FnMut(&Step) -> ControlFlow<()>,
) -> Comparison {
    assert!(!devices.is_empty(), "a comparison needs a device");
    let host = Host {
        threads: settings.threads,
        max_depth: settings.max_depth,
        peers: settings.peers.clone(),
        stop: settings.stop.clone(),
    };
    warm_up(devices, settings, &host);
    let extra = if settings.figures { figures::jobs(&settings.jobs) } else { Vec::new() };
    let runner = Runner { settings, host: &host, extra: &extra };
    let table = slots(&settings.jobs, devices.len(), settings.rays.is_some()).len() * settings.repeat as usize;
    let of = scenes.len() * (table + extra.len() + runner.one_thread_jobs().count());
    let stop = &settings.stop;
    let mut progress = Progress { observe, stop, scene: String::new(), done: 0, of, is_over: false };
    let scenes = scenes.iter().map(|scene| runner.scene(scene, devices, &mut progress)).collect();
    Comparison {
        schema: SCHEMA,
        machine: Machine::current(),
        program: Program::current(),
        devices: devices.iter().map(|device| device.info().clone()).collect(),
        repeat: settings.repeat,
        rays: settings.rays,
        scenes,
    }
}

/// Lets each device do each kind of work once on a small scene: pipelines are made and threads started outside the times.
fn warm_up(devices: &mut [Box<dyn Device>], settings: &CompareSettings, host: &Host) {
    const TRIANGLES: usize = 300;
    let scene = built_in(TRIANGLES);
    let small = RaySettings { width: 8, height: 8, samples: 1, bounces: 1, light_samples: 1, views: 1 };
    let quiet = Host { peers: None, ..host.clone() };
    for device in devices {
        for job in &settings.jobs {
            let subject = Subject::new(&scene);
            let warmed = subject.make(job, &mut **device, &quiet).and_then(|made| {
                let (tree, _) = subject.adaptive(&made.tree, &mut **device)?;
                if settings.rays.is_some() {
                    let tree = made.wide.as_ref().map_or(TracedTree::Binary(&tree), TracedTree::Wide);
                    Views::default().trace(&mut **device, &scene, tree, (&small, 1), None)?;
                }
                Ok(())
            });
            if let Err(error) = warmed {
                // The row of the method will say it too.
                tracing::debug!("warm-up of {}: {}", job.method, in_a_line(&error));
            }
        }
    }
}

struct Progress<'a> {
    observe: &'a mut dyn FnMut(&Step) -> ControlFlow<()>,
    stop: &'a Stop,
    scene: String,
    done: usize,
    of: usize,
    is_over: bool,
}

impl Progress<'_> {
    /// Whether to go on.
    fn starts(&mut self, method: &str) -> bool {
        self.tell(method, None);
        !self.is_over
    }

    fn ended(&mut self, method: &str, outcome: Result<f64, String>) {
        self.done += 1;
        self.tell(method, Some(outcome));
    }

    fn tell(&mut self, method: &str, outcome: Option<Result<f64, String>>) {
        let (method, scene) = (method.to_owned(), self.scene.clone());
        let step = Step { scene, method, done: self.done, of: self.of, outcome };
        self.is_over |= (self.observe)(&step).is_break() || self.stop.is_asked();
    }
}

struct Runner<'a> {
    settings: &'a CompareSettings,
    host: &'a Host,
    extra: &'a [(Purpose, Job)],
}

impl Runner<'_> {
    fn scene(&self, scene: &Scene, devices: &mut [Box<dyn Device>], progress: &mut Progress<'_>) -> SceneComparison {
        progress.scene.clone_from(&scene.name);
        let mut state = SceneState {
            subject: Subject::new(scene),
            views: Views::default(),
            reference: None,
            host: self.host,
            rays: self.settings.rays.map(|rays| (rays, self.settings.up)),
            pictures: self.settings.pictures,
        };
        let mut slots = slots(&self.settings.jobs, devices.len(), state.rays.is_some());
        for _ in 0..self.settings.repeat {
            for slot in &mut slots {
                let name = slot.name(devices);
                if slot.failed().is_some() || !progress.starts(&name) {
                    continue;
                }
                slot.repeat(&mut state, devices);
                if self.settings.stop.is_asked() {
                    continue;
                }
                let outcome =
                    slot.failed().map_or_else(|| Ok(slot.cost().unwrap_or(f64::NAN)), |why| Err(why.to_owned()));
                progress.ended(&name, outcome);
            }
        }
        let (mut rows, mut runs) = (Vec::new(), Vec::new());
        for slot in slots {
            let (of_slot, run) = slot.into_rows(&scene.name, devices, NOT_RUN);
            rows.extend(of_slot);
            runs.extend(run);
        }
        for (purpose, job) in self.extra {
            match self.extra_run(&state, job, &mut *devices[0], "for a figure", progress) {
                Some(Ok(run)) => runs.push(figures::for_figure(run, *purpose)),
                Some(Err(row)) => rows.push(row),
                None => {}
            }
        }
        self.run_on_one_thread(&state, &mut rows, &mut runs, progress);
        let triangles = u32::try_from(scene.triangles.len()).unwrap_or(u32::MAX);
        let pictures = state.views.into_pictures();
        let (name, hash) = (scene.name.clone(), scene.hash.clone());
        let notes = scene.notes.clone();
        let mut compared = SceneComparison { name, hash, triangles, notes, rows, runs, errors: None, pictures };
        compared.set_errors(known_cost(scene).as_ref());
        compared
    }

    /// A run outside the table; where it fails, a row that says so. None if the comparison is over.
    fn extra_run(
        &self,
        state: &SceneState<'_>,
        job: &Job,
        device: &mut dyn Device,
        why: &str,
        progress: &mut Progress<'_>,
    ) -> Option<Result<OptimizerRun, MethodRow>> {
        let name = format!("{} on {}, {why}", with_mu(&job.method, job.mu), device.info().name);
        if !progress.starts(&name) {
            return None;
        }
        match state.subject.make(job, device, self.host) {
            Ok(made) => {
                progress.ended(&name, Ok(made.quality.sah_cost));
                Some(Ok(made.run))
            }
            Err(_) if self.settings.stop.is_asked() => None,
            Err(error) => {
                let status = in_a_line(&error);
                progress.ended(&name, Err(status.clone()));
                let (scene, device) = (progress.scene.clone(), device.info().name.clone());
                let method = format!("{}, {why}", job.method);
                Some(Err(MethodRow { scene, method, mu: job.mu, device, status, ..MethodRow::default() }))
            }
        }
    }

    /// The PRBVH runs that are repeated on one thread: those whose row is compared with RBVH.
    fn one_thread_jobs(&self) -> impl Iterator<Item = &Job> {
        let has_rbvh = self.settings.jobs.iter().any(|job| job.method == "rbvh");
        self.settings.jobs.iter().filter(move |job| has_rbvh && job.method == "prbvh")
    }

    /// Runs PRBVH on one thread and fills [`MethodRow::against_rbvh`].
    fn run_on_one_thread(
        &self,
        state: &SceneState<'_>,
        rows: &mut Vec<MethodRow>,
        runs: &mut Vec<OptimizerRun>,
        progress: &mut Progress<'_>,
    ) {
        let Some(rbvh) = runs.iter().find(|run| run.method == "rbvh").cloned() else { return };
        let mut device = match CpuDevice::new(1) {
            Ok(device) => Stoppable::new(Box::new(device), &self.settings.stop),
            Err(error) => {
                rows.push(no_thread(&progress.scene, &error));
                return;
            }
        };
        for job in self.one_thread_jobs() {
            match self.extra_run(state, job, &mut device, "against rbvh", progress) {
                Some(Ok(run)) => {
                    let run = figures::for_figure(run, Purpose::OneThread);
                    let against = against_rbvh(&run, &rbvh);
                    let same = |row: &&mut MethodRow| row.method == job.method && row.mu == job.mu;
                    rows.iter_mut().filter(same).for_each(|row| row.against_rbvh = against);
                    runs.push(run);
                }
                Some(Err(row)) => rows.push(row),
                None => return,
            }
        }
    }
}

/// What the reference file has for the scene.
fn known_cost(scene: &Scene) -> Option<ReferenceCost> {
    match ReferenceCosts::embedded() {
        Ok(costs) => costs.get(&scene.hash, &SahModel::default()).cloned(),
        Err(error) => {
            tracing::warn!("without reference costs: {}", in_a_line(&error));
            None
        }
    }
}

fn no_thread(scene: &str, error: &DeviceError) -> MethodRow {
    let (scene, method) = (scene.to_owned(), "prbvh, one thread".to_owned());
    MethodRow { scene, method, status: in_a_line(error), ..MethodRow::default() }
}

//! The methods by name: whoever adds one adds a row here.

use super::MethodError;
use super::peers;
use crate::presets::{self, Candidate};
use prbvh::build;
use prbvh::build::MortonBits;
#[cfg(feature = "atrbvh")]
use prbvh::build::TreeletSize;
use prbvh::device::DeviceError;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{self, IterationRow, Order, RbvhSettings, StopReason};
use prbvh::pipeline::{Initial, Optimizer, Settings};
use prbvh::presplit::PresplitSettings;
use prbvh::stop::Stop;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use std::num::NonZeroU32;
use std::ops::ControlFlow;
use std::time::Instant;

/// A row of the table for each device, or one for what runs on none.
#[derive(Clone, Debug)]
pub struct Job {
    /// Method with its setting, as in [`super::MethodRow::method`].
    pub method: String,
    /// First µ of a PRBVH run.
    pub mu: Option<u32>,
    /// What makes the tree.
    pub(super) builder: Builder,
}

/// What makes a tree.
#[derive(Clone, Debug)]
pub(super) enum Builder {
    /// The tree of the settings, on a device.
    Pipeline(Box<Settings>),
    /// On the host alone, from triangles in the safe range.
    Host {
        /// Threads that it takes; none: as many as there are to be.
        threads: Option<usize>,
        /// Builds.
        build: HostBuilder,
    },
    /// Another library, by the name that [`peers`] knows.
    Peer(&'static str),
}

/// Builds on the host. What takes long looks whether it is to end.
pub(super) type HostBuilder = fn(&[Triangle], &Stop) -> Result<HostBuilt, MethodError>;

/// What a builder on the host made.
#[derive(Clone, Debug)]
pub(super) struct HostBuilt {
    /// The tree, one triangle per leaf.
    pub(super) nodes: Vec<Node>,
    /// An optimiser's iterations and the wall time of the tree that it started from; none for a builder.
    pub(super) optimizer: Option<(f64, Vec<IterationRow>)>,
}

/// Settings of the methods.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodSettings {
    /// First µ of PRBVH, a row each.
    pub mu: Vec<u32>,
    /// Radius of PLOC.
    pub radius: NonZeroU32,
}

impl Default for MethodSettings {
    /// As in Meister & Bittner 2018, table 1.
    fn default() -> Self {
        Self { mu: vec![1, 4, 9], radius: PAPER_RADIUS }
    }
}

/// Radius of PLOC in the paper's comparison.
pub const PAPER_RADIUS: NonZeroU32 = NonZeroU32::new(100).expect("not 0");

/// A name of `--methods`, and its rows.
struct Entry {
    name: &'static str,
    /// Whether it is among all methods where none are named.
    is_default: bool,
    jobs: fn(&MethodSettings) -> Vec<Job>,
}

/// In the order of the paper's table, then the references.
const METHODS: &[Entry] = &[
    Entry { name: "lbvh", is_default: true, jobs: |_| vec![initial("lbvh".to_owned(), Initial::Lbvh)] },
    #[cfg(feature = "atrbvh")]
    Entry {
        name: "atrbvh",
        is_default: true,
        jobs: |_| vec![initial("atrbvh".to_owned(), Initial::Atrbvh { treelet: TreeletSize::default() })],
    },
    Entry {
        name: "ploc",
        is_default: true,
        jobs: |settings| {
            vec![initial(format!("ploc r={}", settings.radius), Initial::Ploc { radius: settings.radius })]
        },
    },
    // The stop rule is the same; what differs is told at [`RbvhSettings::undo`].
    Entry {
        name: "rbvh",
        is_default: true,
        jobs: |_| vec![rbvh("rbvh", rbvh_as_published), rbvh("rbvh undo", rbvh_with_undo)],
    },
    Entry {
        name: "prbvh",
        is_default: true,
        jobs: |settings| settings.mu.iter().map(|&mu| published(Settings::default(), mu)).collect(),
    },
    Entry { name: "worst-first", is_default: true, jobs: |_| vec![worst_first(Settings::default())] },
    Entry {
        name: "sah-sweep",
        is_default: true,
        jobs: |_| vec![host("sah-sweep", |triangles, _| builder(build::sah_sweep(triangles)))],
    },
    Entry {
        name: "sah-binned",
        is_default: true,
        jobs: |_| vec![host("sah-binned", |triangles, _| builder(build::sah_binned(triangles)))],
    },
    Entry {
        name: "presplit",
        is_default: false,
        jobs: |_| vec![presplit("lbvh", Initial::Lbvh), presplit("sah-sweep", Initial::SahSweep)],
    },
    Entry {
        name: "sbvh",
        is_default: false,
        jobs: |_| {
            let optimized = Settings::default().with(|s| s.initial = Initial::Sbvh);
            vec![initial("sbvh".to_owned(), Initial::Sbvh), optimized_job("sbvh + prbvh", optimized)]
        },
    },
    Entry {
        name: "candidates",
        is_default: false,
        jobs: |_| presets::CANDIDATES.iter().filter_map(candidate).collect(),
    },
];

fn initial(method: String, initial: Initial) -> Job {
    let settings = Settings::default().with(|s| {
        s.initial = initial;
        s.optimizer = Optimizer::None;
    });
    Job { method, mu: None, builder: Builder::Pipeline(Box::new(settings)) }
}

fn optimized_job(method: &str, settings: Settings) -> Job {
    Job { method: method.to_owned(), mu: None, builder: Builder::Pipeline(Box::new(settings)) }
}

/// Splits by their usual settings, an initial tree over the references, PRBVH.
fn presplit(name: &str, initial: Initial) -> Job {
    let settings = Settings::default().with(|s| {
        s.initial = initial;
        s.presplit = Some(PresplitSettings::default());
    });
    optimized_job(&format!("presplit + {name} + prbvh"), settings)
}

/// PRBVH as published, with `settings` but for order and first µ.
pub(super) fn published(settings: Settings, mu: u32) -> Job {
    let prbvh = settings.prbvh.clone().with(|s| {
        s.order = Order::Published;
        s.mu = mu;
    });
    Job {
        method: "prbvh".to_owned(),
        mu: Some(mu),
        builder: Builder::Pipeline(Box::new(settings.with(|s| s.prbvh = prbvh))),
    }
}

/// PRBVH, the worst nodes first, with `settings` but for the order.
pub(super) fn worst_first(settings: Settings) -> Job {
    let prbvh = settings.prbvh.clone().with(|s| s.order = Order::WorstFirst);
    let builder = Builder::Pipeline(Box::new(settings.with(|s| s.prbvh = prbvh)));
    Job { method: "prbvh worst first".to_owned(), mu: None, builder }
}

/// A setting that presets are chosen from; none where this program was built without its initial tree.
fn candidate(candidate: &Candidate) -> Option<Job> {
    let settings = candidate.settings();
    settings.initial.check().ok()?;
    // µ is part of the name, with all else.
    Some(Job { method: candidate.to_string(), mu: None, builder: Builder::Pipeline(Box::new(settings)) })
}

fn host(method: &str, build: HostBuilder) -> Job {
    let builder = Builder::Host { threads: None, build };
    Job { method: method.to_owned(), mu: None, builder }
}

fn builder(nodes: Vec<Node>) -> Result<HostBuilt, MethodError> {
    Ok(HostBuilt { nodes, optimizer: None })
}

fn rbvh(method: &str, build: HostBuilder) -> Job {
    Job { method: method.to_owned(), mu: None, builder: Builder::Host { threads: Some(1), build } }
}

fn rbvh_as_published(triangles: &[Triangle], stop: &Stop) -> Result<HostBuilt, MethodError> {
    run_rbvh(triangles, RbvhSettings::default().with(|s| s.undo = false), stop)
}

fn rbvh_with_undo(triangles: &[Triangle], stop: &Stop) -> Result<HostBuilt, MethodError> {
    run_rbvh(triangles, RbvhSettings::default(), stop)
}

/// RBVH from LBVH, all on one thread.
fn run_rbvh(triangles: &[Triangle], mut settings: RbvhSettings, stop: &Stop) -> Result<HostBuilt, MethodError> {
    settings.limits.stop = Some(stop.clone());
    let start = Instant::now();
    let mut device = CpuDevice::new(1)?;
    let (tree, _) = build::lbvh(&mut device, triangles, MortonBits::default())?;
    let mut nodes = tree.download(&mut device)?;
    let build_s = start.elapsed().as_secs_f64();
    let outcome = optimize::rbvh(&mut nodes, &settings, &mut |_, _| ControlFlow::Continue(()))?;
    if outcome.stop == StopReason::Cancelled {
        return Err(DeviceError::Stopped.into());
    }
    Ok(HostBuilt { nodes, optimizer: Some((build_s, outcome.rows)) })
}

fn peer(peer: &'static peers::Peer) -> Job {
    Job { method: peer.method.to_owned(), mu: None, builder: Builder::Peer(peer.method) }
}

/// A name that is no method.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is no method: there are {known}")]
pub struct NoSuchMethod {
    /// The name.
    pub name: String,
    /// All names.
    pub known: String,
}

/// The names that [`jobs`] knows; those of other libraries where they were compiled in.
#[must_use]
pub fn method_names() -> Vec<&'static str> {
    let mut names: Vec<&str> = METHODS.iter().map(|entry| entry.name).collect();
    for peer in peers::all() {
        if !names.contains(&peer.name) {
            names.push(peer.name);
        }
    }
    names
}

/// The rows of the methods in `names`, in the order given; of all methods if there are none.
///
/// # Errors
/// At the first unknown name.
pub fn jobs(names: &[String], settings: &MethodSettings) -> Result<Vec<Job>, NoSuchMethod> {
    if names.is_empty() {
        let ours = METHODS.iter().filter(|entry| entry.is_default).flat_map(|entry| (entry.jobs)(settings));
        return Ok(ours.chain(peers::all().filter(|known| known.is_default).map(peer)).collect());
    }
    let mut jobs = Vec::new();
    for (k, name) in names.iter().enumerate() {
        if names[..k].contains(name) {
            continue;
        }
        let before = jobs.len();
        if let Some(entry) = METHODS.iter().find(|entry| entry.name == name) {
            jobs.extend((entry.jobs)(settings));
        }
        jobs.extend(peers::all().filter(|known| known.name == name).map(peer));
        if jobs.len() == before {
            return Err(NoSuchMethod { name: name.clone(), known: method_names().join(", ") });
        }
    }
    Ok(jobs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn methods(names: &[&str]) -> Result<Vec<(String, Option<u32>)>, NoSuchMethod> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        let settings = MethodSettings { mu: vec![1, 9], ..MethodSettings::default() };
        Ok(jobs(&names, &settings)?.into_iter().map(|job| (job.method, job.mu)).collect())
    }

    #[test]
    fn every_name_has_rows_in_the_order_asked_for() {
        for name in method_names() {
            assert!(!methods(&[name]).unwrap().is_empty(), "{name}");
        }
        let row = |method: &str, mu| (method.to_owned(), mu);
        let expected = [row("prbvh", Some(1)), row("prbvh", Some(9)), row("ploc r=100", None)];
        assert_eq!(methods(&["prbvh", "ploc", "prbvh"]).unwrap(), expected);
        assert_eq!(methods(&[]).unwrap()[0], row("lbvh", None));
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_known_ones() {
        let error = methods(&["lbvh", "magic"]).unwrap_err().to_string();
        for part in ["`magic`", "ploc, rbvh, prbvh, worst-first, sah-sweep, sah-binned"] {
            assert!(error.contains(part), "{error}");
        }
    }
}

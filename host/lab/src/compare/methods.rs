//! The methods by name: whoever adds one adds a row here.

use super::on_host::{HostBuilder, builder, named, rbvh_as_published, rbvh_with_undo};
use super::peers;
use crate::presets::{self, Candidate};
use prbvh::build::{self, Bins, DEFAULT_HPLOC_RADIUS, DEFAULT_RADIUS, KMeansSettings};
#[cfg(feature = "atrbvh")]
use prbvh::build::{DEFAULT_PASSES, TreeletSize};
use prbvh::optimize::{Order, RotationSettings};
use prbvh::pipeline::{Initial, Optimizer, Settings};
use prbvh::presplit::PresplitSettings;
use prbvh::wide::{Layout, WideSettings, Width};
use std::num::NonZeroU32;

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

/// A row of a builder with parameters, by [`Initial::of_name`].
macro_rules! on_host {
    ($name:literal) => {
        host($name, |triangles, stop| named($name, triangles, stop))
    };
}

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
    #[cfg(feature = "atrbvh")]
    Entry {
        name: "trbvh",
        is_default: true,
        jobs: |_| vec![initial("trbvh".to_owned(), Initial::Trbvh { passes: DEFAULT_PASSES })],
    },
    Entry {
        name: "hploc",
        is_default: true,
        jobs: |_| {
            let radius = DEFAULT_HPLOC_RADIUS;
            vec![initial(format!("hploc r={radius}"), Initial::Hploc { radius })]
        },
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
        name: "rotations",
        is_default: true,
        jobs: |_| vec![rotations("rotations", 0), rotations("rotations annealed", 30)],
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
    Entry { name: "agglomerative", is_default: false, jobs: |_| vec![on_host!("agglomerative")] },
    Entry { name: "aac", is_default: true, jobs: |_| vec![on_host!("aac:fast"), on_host!("aac:hq")] },
    Entry {
        name: "kmeans",
        is_default: true,
        jobs: |_| {
            use KMeansSettings as S;
            let kmeans = |kmeans| initial(format!("kmeans:{kmeans}"), Initial::KMeans { kmeans });
            [S::Q1, S::Q2, S::Q3, S::Q4, S::Q5].map(kmeans).into()
        },
    },
    Entry { name: "insertion", is_default: true, jobs: |_| vec![on_host!("insertion:greedy"), on_host!("insertion")] },
    Entry { name: "online", is_default: true, jobs: |_| vec![on_host!("online")] },
    Entry { name: "hunt", is_default: true, jobs: |_| vec![on_host!("hunt:cut=50"), on_host!("hunt")] },
    Entry { name: "phr", is_default: true, jobs: |_| vec![on_host!("phr:fast"), on_host!("phr:hq")] },
    Entry {
        name: "sah-sweep+prbvh",
        is_default: true,
        jobs: |_| vec![starting_from(Initial::SahSweep), starting_from(Initial::SahBinned { bins: Bins::DEFAULT })],
    },
    Entry { name: "starts", is_default: false, jobs: |_| starts().map(starting_from).collect() },
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
    // The tree of `worst-first`, its rays through nodes of four and eight children.
    Entry {
        name: "wide",
        is_default: false,
        jobs: |_| WIDE.iter().map(|&(name, width, layout)| wide(name, width, layout)).collect(),
    },
];

/// Initial trees beside LBVH that the optimiser is started from, for the figure of them and for the methods `starts`: whoever adds a builder adds a row here.
/// One whose time grows with the square of the triangles is not among them.
pub(super) fn starts() -> impl Iterator<Item = Initial> {
    let own = [
        Some(Initial::Ploc { radius: DEFAULT_RADIUS }),
        #[cfg(feature = "atrbvh")]
        Some(Initial::Atrbvh { treelet: TreeletSize::DEFAULT }),
        #[cfg(feature = "atrbvh")]
        Some(Initial::Trbvh { passes: DEFAULT_PASSES }),
        Some(Initial::Hploc { radius: DEFAULT_HPLOC_RADIUS }),
        Some(Initial::SahSweep),
        Some(Initial::SahBinned { bins: Bins::DEFAULT }),
    ];
    let named = [
        "aac:fast",
        "aac:hq",
        "kmeans:q1",
        "kmeans:q5",
        "insertion:greedy",
        "insertion",
        "online",
        "hunt",
        "phr:fast",
        "phr:hq",
    ];
    own.into_iter().flatten().chain(named.into_iter().filter_map(|name| Initial::of_name(name)?.ok()))
}

/// PRBVH, the worst nodes first, from another tree than LBVH.
fn starting_from(initial: Initial) -> Job {
    let method = format!("prbvh from {initial}");
    Job { method, ..worst_first(Settings::default().with(|s| s.initial = initial)) }
}

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

/// Rows of `wide`.
const WIDE: [(&str, Width, Layout); 3] = [
    ("prbvh worst first, bvh4", Width::Four, Layout::Soa),
    ("prbvh worst first, bvh8", Width::Eight, Layout::Soa),
    ("prbvh worst first, cwbvh", Width::Eight, Layout::Cwbvh),
];

fn wide(method: &str, width: Width, layout: Layout) -> Job {
    let wide = WideSettings::default().with(|s| {
        s.width = width;
        s.layout = layout;
    });
    let settings = Settings::default().with(|s| s.wide = Some(wide));
    Job { method: method.to_owned(), ..worst_first(settings) }
}

/// A setting that presets are chosen from; none where this program was built without its initial tree.
fn candidate(candidate: &Candidate) -> Option<Job> {
    let settings = candidate.settings();
    settings.initial.check().ok()?;
    // µ is part of the name, with all else.
    Some(Job { method: candidate.to_string(), mu: None, builder: Builder::Pipeline(Box::new(settings)) })
}

/// Rotations from LBVH.
fn rotations(method: &str, annealing_passes: u32) -> Job {
    let rotations = RotationSettings::default().with(|s| s.annealing_passes = annealing_passes);
    let settings = Settings::default().with(|s| s.optimizer = Optimizer::Rotations(rotations));
    Job { method: method.to_owned(), mu: None, builder: Builder::Pipeline(Box::new(settings)) }
}

fn host(method: &str, build: HostBuilder) -> Job {
    let builder = Builder::Host { threads: None, build };
    Job { method: method.to_owned(), mu: None, builder }
}

fn rbvh(method: &str, build: HostBuilder) -> Job {
    Job { method: method.to_owned(), mu: None, builder: Builder::Host { threads: Some(1), build } }
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
    use prbvh::stop::Stop;

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
    fn every_row_of_a_builder_builds() {
        let triangles = prbvh::scene::built_in(200).triangles;
        let mut builders = 0;
        for job in jobs(&method_names().into_iter().map(str::to_owned).collect::<Vec<_>>(), &MethodSettings::default())
            .unwrap()
        {
            if let Builder::Host { build, .. } = job.builder {
                assert_eq!(build(&triangles, &Stop::default()).unwrap().nodes.len(), 399, "{}", job.method);
                builders += 1;
            }
        }
        assert!(builders > 10);
        let starts: Vec<String> = starts().map(|initial| initial.to_string()).collect();
        assert!(starts.iter().any(|name| name == "kmeans:q5") && starts.len() >= 13, "{starts:?}");
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_known_ones() {
        let error = methods(&["lbvh", "magic"]).unwrap_err().to_string();
        for part in ["`magic`", "ploc, rbvh, rotations, prbvh, worst-first, sah-sweep, sah-binned, agglomerative, aac"]
        {
            assert!(error.contains(part), "{error}");
        }
    }
}

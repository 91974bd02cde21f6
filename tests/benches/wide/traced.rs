//! Millions of rays per second, wall time, of each kind.

use super::kinds::{self, Kind};
use super::peer::{self, Peer};
use super::tree;
use prbvh::bvh::{Bvh, SahModel};
use prbvh::collapse::CollapseSettings;
use prbvh::device::cpu::CpuDevice;
use prbvh::interop::obvhs::to_cwbvh;
use prbvh::pipeline::Settings;
use prbvh::presplit::{PresplitForm, PresplitSettings};
use prbvh::scene::Scene;
use prbvh::trace::{Hit, NO_TRIANGLE, Query, TraceScene, trace};
use prbvh::wide::{Layout, PackedTree, WideSettings, Width, collapse};
use prbvh_lab::render::TracedTree;
use prbvh_tests::bench::markdown::{Markdown, number};
use prbvh_tests::bench::stats::{geometric_mean, median};
use std::time::Instant;

/// Rays of obvhs that may hit something else: its test of a triangle rounds otherwise.
const MOST_OTHERS: f64 = 1e-2;

/// Where two hits are the same, as a part of the parameter.
const SAME: f32 = 1e-3;

/// References beyond the triangles, as a part of them.
const BUDGET: f64 = 0.3;

/// MRays/s of primary, shadow and secondary rays.
type Speeds = [f64; 3];

/// A row for each scene and tree, and one for the mean of each tree.
pub(crate) fn table(scenes: impl Iterator<Item = Scene>, count: usize, repetitions: usize) -> String {
    let mut table = Markdown::new(&[
        "<scene",
        "<rays through",
        "primary, MRays/s",
        "÷ binary",
        "shadow",
        "÷ binary",
        "secondary",
        "÷ binary",
        "÷ obvhs CwBvh",
    ]);
    let mut all: Vec<(String, Vec<[f64; 4]>)> = Vec::new();
    for scene in scenes {
        eprintln!("{} ({} triangles)", scene.name, scene.triangles.len());
        let rows = rows(&scene, count, repetitions);
        let (first, last) = (rows[0].1, rows[rows.len() - 1].1);
        for (at, (name, speeds)) in rows.iter().enumerate() {
            let ratios = [0, 1, 2].map(|k| speeds[k] / first[k]);
            let ratios = [ratios[0], ratios[1], ratios[2], speeds[2] / last[2]];
            let mut cells = vec![scene.name.clone(), name.clone()];
            cells.extend((0..3).flat_map(|k| [number(speeds[k], 2), number(ratios[k], 2)]));
            cells.push(number(ratios[3], 2));
            table.row(&cells);
            if all.len() == at {
                all.push((name.clone(), Vec::new()));
            }
            all[at].1.push(ratios);
        }
    }
    for (name, ratios) in all {
        let mean = |k: usize| number(geometric_mean(&ratios.iter().map(|r| r[k]).collect::<Vec<_>>()), 2);
        let mut cells = vec!["geometric mean".to_owned(), name];
        cells.extend((0..3).flat_map(|k| [String::new(), mean(k)]));
        cells.push(mean(3));
        table.row(&cells);
    }
    table.finish()
}

/// What rays go through.
enum Subject {
    Ours(Box<(CpuDevice, TraceScene)>),
    Theirs(Peer),
}

impl Subject {
    fn ours(tree: TracedTree<'_>, scene: &Scene, starts: &[[f32; 3]]) -> Self {
        let mut device = CpuDevice::new(0).expect("threads");
        let traced = tree.on(&mut device, &scene.triangles, starts).expect("the tree is good");
        Self::Ours(Box::new((device, traced)))
    }

    /// What is hit and where, and seconds.
    fn run(&mut self, kind: &Kind) -> (Vec<(f32, u32)>, f64) {
        match self {
            Self::Ours(ours) => {
                let (device, traced) = &mut **ours;
                let (hits, timings) = trace(device, traced, &kind.rays, kind.query).expect("the rays are good");
                // The kernel alone: a renderer has its rays on the device.
                let seconds = timings.iter().map(|timing| timing.seconds).sum();
                (hits.iter().map(|hit: &Hit| (hit.t, hit.triangle)).collect(), seconds)
            }
            Self::Theirs(peer) => {
                let start = Instant::now();
                let hits = peer.hits(&kind.rays, kind.query);
                (hits, start.elapsed().as_secs_f64())
            }
        }
    }
}

fn rows(scene: &Scene, count: usize, repetitions: usize) -> Vec<(String, Speeds)> {
    let with = |presplit: Option<PresplitSettings>, is_adaptive: bool| {
        let settings = Settings::default().with(|s| {
            s.presplit = presplit;
            s.adaptive = is_adaptive.then(CollapseSettings::default);
        });
        tree(scene, &settings)
    };
    let binary = with(None, true);
    let kinds = kinds::of_paths(scene, TracedTree::Binary(&binary), count);
    let starts: Vec<[f32; 3]> = kinds.iter().flat_map(|kind| kind.rays.iter().map(|ray| ray.origin)).collect();
    let mut subjects = vec![("binary".to_owned(), Subject::ours(TracedTree::Binary(&binary), scene, &starts))];
    wide_ones(scene, &with(None, false), "", &starts, &mut subjects);
    for (form, splits) in [(PresplitForm::Level, " + presplit"), (PresplitForm::Sbvh, " + presplit by sbvh")] {
        let presplit = PresplitSettings::default().with(|s| (s.budget, s.form) = (BUDGET, form));
        let binary = with(Some(presplit), true);
        let subject = Subject::ours(TracedTree::Binary(&binary), scene, &starts);
        subjects.push((format!("binary{splits}"), subject));
        wide_ones(scene, &with(Some(presplit), false), splits, &starts, &mut subjects);
    }
    for (name, peer) in ["obvhs, Bvh2", "obvhs, CwBvh"].into_iter().zip(peer::built(scene)) {
        subjects.push((name.to_owned(), Subject::Theirs(peer)));
    }
    speeds(scene, subjects, &kinds, repetitions)
}

/// Wide trees of a tree of one triangle per leaf, and the compressed one as obvhs walks it.
fn wide_ones(scene: &Scene, single: &Bvh, splits: &str, starts: &[[f32; 3]], subjects: &mut Vec<(String, Subject)>) {
    for (name, width, layout, c_intersect) in [
        ("bvh4", Width::Four, Layout::Soa, None),
        ("bvh8", Width::Eight, Layout::Soa, None),
        ("bvh8, c_I = 1", Width::Eight, Layout::Soa, Some(1.0)),
        ("cwbvh", Width::Eight, Layout::Cwbvh, None),
    ] {
        let settings = WideSettings::default().with(|s| {
            s.width = width;
            s.layout = layout;
            s.sah = c_intersect.map(|c_intersect| SahModel { c_intersect, ..width.sah() });
        });
        let wide = collapse(single, &settings).expect("the settings are good");
        let packed = PackedTree::new(&wide, layout).expect("leaves were made for the layout");
        subjects.push((format!("{name}{splits}"), Subject::ours(TracedTree::Wide(&packed), scene, starts)));
        if layout == Layout::Cwbvh {
            let theirs = Peer::compressed(scene, to_cwbvh(&wide).expect("leaves were made for the layout"));
            subjects.push((format!("{name}{splits}, by obvhs"), Subject::Theirs(theirs)));
        }
    }
}

/// Medians over rounds in which everyone has a turn.
fn speeds(
    scene: &Scene,
    mut subjects: Vec<(String, Subject)>,
    kinds: &[Kind; 3],
    repetitions: usize,
) -> Vec<(String, Speeds)> {
    let expected = kinds.each_ref().map(|kind| subjects[0].1.run(kind).0);
    let mut seconds = vec![[const { Vec::new() }; 3]; subjects.len()];
    for repetition in 0..=repetitions.max(1) {
        for ((name, subject), seconds) in subjects.iter_mut().zip(&mut seconds) {
            for (k, kind) in kinds.iter().enumerate() {
                let (hits, time) = subject.run(kind);
                if repetition == 0 {
                    let others =
                        hits.iter().zip(&expected[k]).filter(|(hit, other)| differ(**hit, **other, kind.query));
                    let part = others.count() as f64 / hits.len() as f64;
                    let most = if matches!(subject, Subject::Ours(_)) { 0.0 } else { MOST_OTHERS };
                    assert!(
                        part <= most,
                        "{}: {part} of the {} rays hit something else by {name}",
                        scene.name,
                        kind.name
                    );
                } else {
                    seconds[k].push(time);
                }
            }
        }
    }
    let speed = |times: &[Vec<f64>; 3]| [0, 1, 2].map(|k| kinds[k].rays.len() as f64 * 1e-6 / median(&times[k]));
    subjects.into_iter().zip(&seconds).map(|((name, _), seconds)| (name, speed(seconds))).collect()
}

fn differ(hit: (f32, u32), expected: (f32, u32), query: Query) -> bool {
    let misses = [hit.1 == NO_TRIANGLE, expected.1 == NO_TRIANGLE];
    misses[0] != misses[1]
        || (query == Query::Closest && !misses[0] && hit.1 != expected.1 && is_elsewhere(hit.0, expected.0))
}

fn is_elsewhere(t: f32, distance: f32) -> bool {
    (t - distance).abs() > SAME * distance.abs()
}

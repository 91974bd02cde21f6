//! Millions of rays per second, wall time, closest and any hits.

use super::peer::{self, Peer};
use super::{rays, tree};
use prbvh::collapse::CollapseSettings;
use prbvh::device::cpu::CpuDevice;
use prbvh::interop::obvhs::to_cwbvh;
use prbvh::pipeline::Settings;
use prbvh::scene::Scene;
use prbvh::trace::{Hit, NO_TRIANGLE, Query, Ray, TraceScene, trace};
use prbvh::wide::{Layout, WideSettings, Width, collapse};
use prbvh_kernel::aabb::Aabb;
use prbvh_lab::render::TracedTree;
use prbvh_tests::bench::markdown::{Markdown, number};
use prbvh_tests::bench::obvhs::triangles;
use prbvh_tests::bench::stats::median;
use std::time::Instant;

/// Rays of obvhs that may hit something else: its test of a triangle rounds otherwise.
const MOST_OTHERS: f64 = 1e-3;

/// Where two hits are the same, as a part of the parameter.
const SAME: f32 = 1e-3;

/// A row for each scene and tree.
pub(crate) fn table(scenes: impl Iterator<Item = Scene>, count: usize, repetitions: usize) -> String {
    let mut table =
        Markdown::new(&["<scene", "<rays through", "closest, MRays/s", "÷ binary", "any, MRays/s", "÷ binary"]);
    for scene in scenes {
        eprintln!("{} ({} triangles)", scene.name, scene.triangles.len());
        let mut first = None;
        for (name, speeds) in rows(&scene, count, repetitions) {
            let [closest, any]: [f64; 2] = speeds;
            let [first_closest, first_any] = *first.get_or_insert(speeds);
            table.row(&[
                scene.name.clone(),
                name,
                number(closest, 3),
                number(closest / first_closest, 2),
                number(any, 3),
                number(any / first_any, 2),
            ]);
        }
    }
    table.finish()
}

fn rows(scene: &Scene, count: usize, repetitions: usize) -> Vec<(String, [f64; 2])> {
    let bounds = Aabb { min: scene.census.min, max: scene.census.max };
    let rays: Vec<Ray> = rays::through(&bounds, count).into_iter().map(of_length_1).collect();
    let single = tree(scene, &Settings::default());
    let adaptive = tree(scene, &Settings::default().with(|s| s.adaptive = Some(CollapseSettings::default())));
    let (expected, binary) = ours(TracedTree::Binary(&adaptive), scene, &rays, repetitions);
    let mut rows = vec![("prbvh, binary".to_owned(), binary)];
    for (width, layout) in [(Width::Four, Layout::Soa), (Width::Eight, Layout::Soa), (Width::Eight, Layout::Cwbvh)] {
        let settings = WideSettings::default().with(|s| {
            s.width = width;
            s.layout = layout;
        });
        let wide = collapse(&single, &settings).expect("the settings are good");
        let packed = prbvh::wide::PackedTree::new(&wide, layout).expect("leaves were made for the layout");
        let name = format!("{layout} of {width}");
        let (hits, speeds) = ours(TracedTree::Wide(&packed), scene, &rays, repetitions);
        assert!(hits == expected, "{}: {name} hits something else than the binary tree", scene.name);
        rows.push((format!("prbvh, {name}"), speeds));
        if layout == Layout::Cwbvh {
            let theirs = to_cwbvh(&wide).expect("leaves were made for the layout");
            rows.push((
                "prbvh's tree by obvhs, CwBvh".to_owned(),
                by_peer(&Peer::Compressed(&theirs), scene, &rays, &expected, repetitions),
            ));
        }
    }
    let (binary, compressed) = peer::built(scene);
    for (name, tree) in [("obvhs, Bvh2", Peer::Binary(&binary)), ("obvhs, CwBvh", Peer::Compressed(&compressed))] {
        rows.push((name.to_owned(), by_peer(&tree, scene, &rays, &expected, repetitions)));
    }
    rows
}

/// Triangles that are hit, and MRays/s of closest and any hits.
fn ours(tree: TracedTree<'_>, scene: &Scene, rays: &[Ray], repetitions: usize) -> (Vec<(f32, u32)>, [f64; 2]) {
    let mut device = CpuDevice::new(0).expect("threads");
    let starts: Vec<[f32; 3]> = rays.iter().map(|ray| ray.origin).collect();
    let mut traced = tree.on(&mut device, &scene.triangles, &starts).expect("the tree is good");
    let mut run = |query| {
        let one = |device: &mut CpuDevice, traced: &mut TraceScene| -> (Vec<Hit>, f64) {
            let (hits, timings) = trace(device, traced, rays, query).expect("the rays are good");
            // The kernel alone: a renderer has its rays on the device.
            (hits, timings.iter().map(|timing| timing.seconds).sum())
        };
        let (hits, _) = one(&mut device, &mut traced);
        let seconds: Vec<f64> = (0..repetitions.max(1)).map(|_| one(&mut device, &mut traced).1).collect();
        (hits, rays.len() as f64 * 1e-6 / median(&seconds))
    };
    let (closest, any) = (run(Query::Closest), run(Query::Any));
    for (hit, any) in closest.0.iter().zip(&any.0) {
        assert_eq!(hit.triangle == NO_TRIANGLE, any.triangle == NO_TRIANGLE, "{}", scene.name);
    }
    (closest.0.iter().map(|hit| (hit.t, hit.triangle)).collect(), [closest.1, any.1])
}

/// MRays/s of closest and any hits, if nearly all rays hit what they are to hit.
fn by_peer(peer: &Peer<'_>, scene: &Scene, rays: &[Ray], expected: &[(f32, u32)], repetitions: usize) -> [f64; 2] {
    let triangles = triangles(scene);
    [false, true].map(|any| {
        let hits = peer.hits(&triangles, rays, any);
        let others = hits.iter().zip(expected).filter(|(hit, expected)| differ(**hit, **expected, any)).count();
        let part = others as f64 / rays.len() as f64;
        assert!(part <= MOST_OTHERS, "{}: {others} of {} rays hit something else", scene.name, rays.len());
        let times = (0..repetitions.max(1)).map(|_| {
            let start = Instant::now();
            std::hint::black_box(peer.hits(&triangles, rays, any));
            start.elapsed().as_secs_f64()
        });
        rays.len() as f64 * 1e-6 / median(&times.collect::<Vec<f64>>())
    })
}

fn differ(hit: (f32, u32), expected: (f32, u32), any: bool) -> bool {
    let misses = [hit.1 == NO_TRIANGLE, expected.1 == NO_TRIANGLE];
    misses[0] != misses[1] || (!any && !misses[0] && hit.1 != expected.1 && is_elsewhere(hit.0, expected.0))
}

/// For obvhs a parameter is one of the direction as it is, for us a distance.
fn of_length_1(ray: Ray) -> Ray {
    let length = ray.direction.iter().map(|x| x * x).sum::<f32>().sqrt();
    Ray { direction: ray.direction.map(|x| x / length), ..ray }
}

fn is_elsewhere(t: f32, distance: f32) -> bool {
    (t - distance).abs() > SAME * distance.abs()
}

//! Triangles of equal boxes as one reference: the tree is one over all triangles, with the costs that were said on the way.

use prbvh::collapse::CollapseSettings;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{Limits, PrbvhSettings, RbvhSettings, StopReason};
use prbvh::pipeline::{Optimizer, Settings, optimize};
use prbvh::scene::Scene;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{grid, soup};
use std::collections::BTreeSet;
use std::ops::ControlFlow;

fn settings(max_leaf: Option<u32>) -> Settings {
    let adaptive = CollapseSettings::default().with(|s| s.max_leaf = max_leaf);
    let prbvh = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(5));
    Settings::default().with(|s| {
        s.adaptive = Some(adaptive);
        s.prbvh = prbvh;
    })
}

#[test]
fn folded_duplicates_come_back() {
    let quads: Vec<Triangle> = grid(12)
        .into_iter()
        .flat_map(|t| {
            let d = [t.b[0], t.c[1], 0.0];
            [t, Triangle { a: d, b: t.b, c: t.c }]
        })
        .collect();
    let scenes = [
        ("quads", quads),
        ("copies", soup(1, 0.1, 6).repeat(300)),
        ("twice", soup(200, 0.1, 4).repeat(2)),
        ("none", soup(100, 0.1, 4)),
    ];
    with_devices(|devices| {
        for (name, triangles) in &scenes {
            let scene = Scene::from_triangles(*name, triangles.clone()).unwrap();
            for (optimizer, max_leaf) in [
                (Optimizer::Prbvh, Some(1)),
                (Optimizer::Prbvh, None),
                (Optimizer::Rbvh(RbvhSettings::default()), Some(1)),
            ] {
                let whole = settings(max_leaf).with(|s| s.optimizer = optimizer);
                let folding = whole.clone().with(|s| s.fold_duplicates = true);
                let mut hashes = BTreeSet::new();
                for (device_name, device) in &mut *devices {
                    let what = format!("{name}, {}, {max_leaf:?} on {device_name}", whole.optimizer);
                    let mut seen = Vec::new();
                    let result = optimize(&scene, &mut **device, &folding, &mut |row| {
                        seen.push(row.cost);
                        ControlFlow::Continue(())
                    });
                    let result = result.unwrap();
                    let n = triangles.len();
                    assert_eq!(result.plan.references < n, *name != "none", "{what}");
                    assert_eq!(result.quality.triangles as usize, n, "{what}");
                    assert_eq!(seen, result.outcome.rows.iter().map(|row| row.cost).collect::<Vec<_>>(), "{what}");
                    let best = result.outcome.best().cost;
                    assert!(
                        (best / result.quality.sah_cost - 1.0).abs() < 1e-4,
                        "{what}: {best}, {:?}",
                        result.quality
                    );
                    assert!((seen[0] / result.initial.sah_cost - 1.0).abs() < 1e-4, "{what}: {seen:?}");
                    hashes.insert(prbvh::bvh::tree_hash(&result.tree));
                }
                assert_eq!(hashes.len(), 1, "{name}, {}", whole.optimizer);
                let mut device = CpuDevice::new(1).unwrap();
                let kept = optimize(&scene, &mut device, &whole, &mut |_| ControlFlow::Continue(())).unwrap();
                let folded = optimize(&scene, &mut device, &folding, &mut |_| ControlFlow::Continue(())).unwrap();
                let [kept, folded] = [kept, folded].map(|result| result.quality.sah_cost);
                assert!(folded < 1.05 * kept, "{name}: {folded} for {kept}");
            }
        }
    });
}

#[test]
fn a_target_is_that_of_the_whole_tree() {
    let scene = Scene::from_triangles("twice", soup(300, 0.1, 4).repeat(2)).unwrap();
    let settings = Settings::default().with(|s| s.fold_duplicates = true);
    let mut device = CpuDevice::new(1).unwrap();
    let free = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let target = 0.5 * (free.initial.sah_cost + free.quality.sah_cost);
    let prbvh = PrbvhSettings::default()
        .with(|s| s.limits = PrbvhSettings::default().limits.with(|s| s.target_cost = Some(target)));
    let settings = settings.with(|s| s.prbvh = prbvh);
    let result = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let (costs, stop): (Vec<f64>, _) = (result.outcome.rows.iter().map(|row| row.cost).collect(), result.outcome.stop);
    let (last, before) = costs.split_last().unwrap();
    assert!(stop == StopReason::Target && *last <= target && before.iter().all(|cost| *cost > target), "{costs:?}");
}

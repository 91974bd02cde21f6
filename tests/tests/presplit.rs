//! Triangles in pieces: the budget, the same bits everywhere, no hole, and the hits of a tree without splits.

use prbvh::bvh::{self, Bvh, Content, TreeFault};
use prbvh::collapse::CollapseSettings;
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{RbvhSettings, Reoptimizer};
use prbvh::pipeline::{Initial, Optimized, Optimizer, PipelineError, Settings, optimize, optimize_by};
use prbvh::plan::{Omission, Plan, Status};
use prbvh::presplit::{PresplitForm, PresplitSettings};
use prbvh::scene::{Aabb, Scene, built_in};
use prbvh::trace::{NO_TRIANGLE, Query, Ray, TraceRange, TraceScene, trace};
use prbvh_kernel::ray::Prepared;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::devices::{vulkan_devices, with_devices};
use prbvh_tests::fixtures::{Random, soup};
use prbvh_tests::rays::{STARTS, rays};
use std::ops::ControlFlow;

const FORMS: [PresplitForm; 3] = [PresplitForm::Level, PresplitForm::ExtentArea, PresplitForm::Sbvh];

fn with_form(form: PresplitForm, budget: f64) -> Settings {
    Settings::default().with(|settings| {
        settings.presplit = Some(PresplitSettings::default().with(|presplit| {
            presplit.form = form;
            presplit.budget = budget;
        }));
    })
}

/// Also where splits promise little.
fn run(triangles: &[Triangle], settings: &Settings, device: &mut dyn Device) -> Result<Optimized, PipelineError> {
    let scene = Scene::from_triangles("pieces", triangles.to_vec()).unwrap();
    let plan = Plan::of(&scene, device.info(), settings, &[Omission::Presplit])?;
    optimize_by(plan, &scene, device, settings, &mut |_| ControlFlow::Continue(()))
}

fn on_cpu(triangles: &[Triangle], settings: &Settings) -> Optimized {
    run(triangles, settings, &mut CpuDevice::new(2).unwrap()).unwrap()
}

/// Long triangles in all directions: every one is worth a split.
fn slanted(count: usize, seed: u64) -> Vec<Triangle> {
    soup(count, 0.5, seed)
}

#[test]
fn the_budget_is_met_and_all_devices_cut_the_same() {
    with_devices(|devices| {
        for (count, form) in [(1, PresplitForm::Level), (2, PresplitForm::ExtentArea), (3, PresplitForm::Level)]
            .into_iter()
            .chain([(7, PresplitForm::ExtentArea), (300, PresplitForm::Level), (2100, PresplitForm::ExtentArea)])
        {
            let triangles = slanted(count, 4);
            for budget in [0.3, 1.7] {
                let settings = with_form(form, budget).with(|s| s.optimizer = Optimizer::None);
                let mut hash = None;
                for (name, device) in &mut *devices {
                    let done = run(&triangles, &settings, &mut **device).unwrap();
                    let more = (count as f64 * budget) as usize;
                    let built = done.splits.map_or(count, |splits| splits.built as usize);
                    assert_eq!(built, count + more, "{count} triangles, {budget}, {name}");
                    assert!(done.plan.unplanned(&done.ran).is_empty(), "{name}");
                    let found = bvh::tree_hash(&done.tree);
                    assert_eq!(*hash.get_or_insert(found.clone()), found, "{count} triangles, {budget}, {name}");
                }
            }
        }
    });
}

#[test]
fn equal_boxes_share_the_budget_exactly() {
    let triangles = vec![slanted(1, 9)[0]; 70_000];
    let settings = with_form(PresplitForm::Level, 0.3).with(|s| s.optimizer = Optimizer::None);
    let mut devices: Vec<(String, Box<dyn Device>)> = vec![("cpu".to_owned(), Box::new(CpuDevice::new(2).unwrap()))];
    devices.extend(vulkan_devices());
    let mut hash = None;
    for (name, device) in &mut devices {
        let done = run(&triangles, &settings, &mut **device).unwrap();
        assert_eq!(done.splits.unwrap().built, 91_000, "{name}");
        let found = bvh::tree_hash(&done.tree);
        assert_eq!(*hash.get_or_insert(found.clone()), found, "{name}");
    }
}

/// Points of each triangle that no leaf has that holds it.
fn uncovered(tree: &Bvh, triangles: &[Triangle], samples: usize) -> usize {
    let mut leaves = vec![Vec::new(); triangles.len()];
    for node in &tree.nodes {
        if let Content::Leaf { first, count } = node.content {
            for &triangle in &tree.triangle_order[first as usize..][..count as usize] {
                leaves[triangle as usize].push(node.aabb);
            }
        }
    }
    let mut random = Random(3);
    let mut lost = 0;
    for (t, boxes) in triangles.iter().zip(&leaves) {
        let extent = |k: usize| f64::from(t.aabb().max[k]) - f64::from(t.aabb().min[k]);
        // A sample is no point of the triangle, but one beside it.
        let slack = 1e-6 * (extent(0) + extent(1) + extent(2));
        for _ in 0..samples {
            let (mut u, mut v) = (f64::from(random.unit()), f64::from(random.unit()));
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let at = |k: usize| {
                let [a, b, c] = [t.a, t.b, t.c].map(|corner| f64::from(corner[k]));
                a + u * (b - a) + v * (c - a)
            };
            let holds = |aabb: &Aabb| {
                (0..3).all(|k| at(k) >= f64::from(aabb.min[k]) - slack && at(k) <= f64::from(aabb.max[k]) + slack)
            };
            lost += usize::from(!boxes.iter().any(holds));
        }
    }
    lost
}

#[test]
fn pieces_cover_their_triangles_and_a_planted_hole_is_found() {
    for form in FORMS {
        let triangles = slanted(120, 6);
        let done = on_cpu(&triangles, &with_form(form, 2.0));
        assert!(done.tree.has_splits(triangles.len()), "{form}");
        assert_eq!(uncovered(&done.tree, &triangles, 40), 0, "{form}");
        bvh::validate_tree(&done.tree, &triangles).unwrap();

        let mut held = vec![0; triangles.len()];
        done.tree.triangle_order.iter().for_each(|&triangle| held[triangle as usize] += 1);
        let order = &done.tree.triangle_order;
        let is_piece = |content: &Content| matches!(content, Content::Leaf { first, count: 1 } if held[order[*first as usize] as usize] > 1);
        let faults = (0..done.tree.nodes.len()).filter(|&v| is_piece(&done.tree.nodes[v].content)).map(|v| {
            let mut shrunk = done.tree.clone();
            let aabb = &mut shrunk.nodes[v].aabb;
            let axis = (0..3).fold(0, |a, k| if aabb.max[k] - aabb.min[k] > aabb.max[a] - aabb.min[a] { k } else { a });
            aabb.max[axis] = 0.5 * (aabb.min[axis] + aabb.max[axis]);
            let shrunk = shrunk.with_boxes_of_leaves();
            (uncovered(&shrunk, &triangles, 40), bvh::validate_tree(&shrunk, &triangles).err())
        });
        let faults: Vec<_> = faults.take(20).collect();
        let is_named = |fault: &TreeFault| matches!(fault, TreeFault::Hole { .. } | TreeFault::Uncovered { .. });
        for (lost, found) in &faults {
            assert!(found.iter().flatten().all(is_named), "{form}: {found:?}");
            assert!(*lost == 0 || found.is_some(), "{form}: {lost} samples are in no leaf");
        }
        let found = faults.iter().filter(|(_, found)| found.is_some()).count();
        assert!(
            found >= faults.len().clamp(1, 10) && faults.iter().any(|(lost, _)| *lost > 0),
            "{form}: {found} holes of {}",
            faults.len()
        );
    }
}

/// Hits by testing all triangles.
fn without_tree(triangles: &[Triangle], cast: &[Ray], starts: &[[f32; 3]]) -> Vec<(u32, u32)> {
    let range = TraceRange::of(triangles, starts);
    let working = range.triangles(triangles);
    let closest = |(k, ray): (usize, &Ray)| {
        let ray = range.ray(k, ray).unwrap();
        let prepared = Prepared::new(&ray);
        let mut best = (f32::INFINITY, NO_TRIANGLE);
        for (id, t) in (0..).zip(&working) {
            let hit = prepared.hits([t.a, t.b, t.c], ray.t_max);
            if hit < best.0 {
                best = (hit, id);
            }
        }
        if best.1 == NO_TRIANGLE { (0, NO_TRIANGLE) } else { (range.to_scene(best.0).to_bits(), best.1) }
    };
    cast.iter().enumerate().map(closest).collect()
}

/// Thin triangles of one short edge, or of none.
fn thin(count: usize, aspect: f32, needles: bool) -> Vec<Triangle> {
    let mut random = Random(8);
    let mut one = || {
        let (a, b) = (random.point(1.0), random.point(1.0));
        let at = |part: f32| [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]));
        let near = random.point(1.0 / aspect);
        let from = at(if needles { 0.0 } else { 0.5 });
        Triangle { a, b, c: [0, 1, 2].map(|k| from[k] + near[k]) }
    };
    (0..count).map(|_| one()).collect()
}

fn moved(triangles: &[Triangle], work: impl Fn(f32) -> f32) -> Vec<Triangle> {
    triangles.iter().map(|t| Triangle { a: t.a.map(&work), b: t.b.map(&work), c: t.c.map(&work) }).collect()
}

/// What brings a coordinate of a case to its place.
type Work = fn(f32) -> f32;

#[test]
fn hits_are_those_without_a_tree() {
    let quarter = slanted(150, 2);
    let cases: [(&str, Vec<Triangle>, Work); 6] = [
        ("plain", quarter.clone(), |x| x),
        ("needles", thin(150, 1e6, true), |x| x),
        ("slivers", thin(150, 1e6, false), |x| x),
        ("large", moved(&quarter, |x| x * 1e20), |x| x * 1e20),
        ("small", moved(&quarter, |x| x * 1e-20), |x| x * 1e-20),
        ("far", moved(&quarter, |x| x + 65_536.0), |x| x + 65_536.0),
    ];
    let mut device = CpuDevice::new(2).unwrap();
    let mut some = 0;
    for (name, triangles, work) in &cases {
        let near = moved(triangles, |x| match *name {
            "large" => x * 1e-20,
            "small" => x * 1e20,
            "far" => x - 65_536.0,
            _ => x,
        });
        let scale = work(1.0) - work(0.0);
        let length = |t: f32| if t.is_finite() { t * scale } else { t };
        let there = |ray: Ray| Ray {
            origin: ray.origin.map(work),
            t_min: length(ray.t_min),
            direction: ray.direction.map(|x| x * scale),
            t_max: length(ray.t_max),
        };
        let cast: Vec<Ray> = rays(&near, 300, 5).into_iter().map(there).collect();
        let starts = STARTS.map(|corner| corner.map(work));
        let expected = without_tree(triangles, &cast, &starts);
        some += expected.iter().filter(|hit| hit.1 != NO_TRIANGLE).count();
        let adaptive = |settings: Settings| settings.with(|s| s.adaptive = Some(CollapseSettings::default()));
        let rbvh = |settings: Settings| settings.with(|s| s.optimizer = Optimizer::Rbvh(RbvhSettings::default()));
        let sbvh = Settings::default().with(|s| {
            s.initial = Initial::Sbvh;
            s.sbvh.budget = 2.0;
        });
        for (what, settings) in [
            ("level", with_form(PresplitForm::Level, 2.0)),
            ("extent", adaptive(with_form(PresplitForm::ExtentArea, 2.0))),
            ("references of sbvh", rbvh(with_form(PresplitForm::Sbvh, 2.0))),
            ("sweep", with_form(PresplitForm::Level, 0.5).with(|s| s.initial = Initial::SahSweep)),
            ("sbvh", adaptive(sbvh)),
        ] {
            let done = on_cpu(triangles, &settings);
            let mut scene = TraceScene::new(&mut device, &done.tree, triangles, &starts).unwrap();
            let (hits, _) = trace(&mut device, &mut scene, &cast, Query::Closest).unwrap();
            scene.free(&mut device);
            let found: Vec<_> = hits.iter().map(|hit| (hit.t.to_bits(), hit.triangle)).collect();
            let first = found.iter().zip(&expected).position(|(a, b)| a != b);
            assert_eq!(first.map(|k| (found[k], expected[k])), None, "{name}, {what}: ray {first:?}");
        }
    }
    assert!(some > 600, "{some} rays hit something");
}

#[test]
fn repeated_pieces_of_a_leaf_are_one_and_siblings_merge() {
    let triangles = slanted(100, 1);
    let settings = with_form(PresplitForm::ExtentArea, 3.0).with(|s| s.adaptive = Some(CollapseSettings::default()));
    let done = on_cpu(&triangles, &settings);
    let splits = done.splits.unwrap();
    assert!(splits.merged > 0 && done.quality.sah_cost < splits.cost_before);
    assert_eq!(done.optimized_cost(), splits.cost_before);
    assert_eq!(done.quality.leaves, splits.built - splits.merged);
    assert!(splits.references as usize == done.tree.references() && splits.references < splits.built - splits.merged);
    for node in &done.tree.nodes {
        if let Content::Leaf { first, count } = node.content {
            let mut held = done.tree.triangle_order[first as usize..][..count as usize].to_vec();
            held.sort_unstable();
            assert!(held.windows(2).all(|pair| pair[0] != pair[1]), "{held:?}");
        }
    }
    let adaptive = done.adaptive.unwrap();
    assert_eq!(adaptive.triangles, splits.references);
}

#[test]
fn what_promises_nothing_is_left_out() {
    let of = |triangles: Vec<Triangle>| {
        let scene = Scene::from_triangles("scene", triangles).unwrap();
        let settings = with_form(PresplitForm::Level, 0.3).with(|s| s.optimizer = Optimizer::None);
        let mut device = CpuDevice::new(1).unwrap();
        let done = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        let item = done.plan.items.iter().find(|item| item.omission == Omission::Presplit).unwrap().clone();
        let ran = done.ran.iter().any(|kernel| kernel.info().name.starts_with("presplit"));
        assert_eq!(done.tree.has_splits(scene.triangles.len()), ran);
        assert_eq!(done.plan.code.kernels.iter().any(|name| name.starts_with("presplit")), ran);
        assert_eq!(done.plan.phases.iter().any(|phase| phase.phase == "presplit"), ran);
        (item.status, ran)
    };
    // Points, and segments along no axis, which no ray hits.
    let segment = |k: u16| Triangle { a: [f32::from(k); 3], b: [f32::from(k) + 2.0; 3], c: [f32::from(k); 3] };
    assert_eq!(of((0..20).map(segment).collect()), (Status::NoneThere, false));
    assert_eq!(of(vec![Triangle { a: [1.0; 3], b: [1.0; 3], c: [1.0; 3] }; 7]), (Status::NoneThere, false));
    // Many small ones, all alike.
    let mut random = Random(2);
    let small = (0..3000).map(|_| {
        let at = random.point(1.0);
        let corner = |k: usize| [0, 1, 2].map(|j| at[j] + if j == k { 0.004 } else { 0.0 });
        Triangle { a: corner(0), b: corner(1), c: corner(2) }
    });
    assert_eq!(of(small.collect()), (Status::LeftOut, false));
    assert_eq!(of(slanted(1000, 3)), (Status::Needed, true));
}

#[test]
fn what_is_not_done_together_is_refused_by_name() {
    let triangles = slanted(30, 5);
    let refused =
        |settings: &Settings| run(&triangles, settings, &mut CpuDevice::new(1).unwrap()).unwrap_err().to_string();
    let presplit = || with_form(PresplitForm::Level, 0.3);
    let folded = refused(&presplit().with(|s| s.fold_duplicates = true));
    assert!(folded.starts_with("fold_duplicates is true"), "{folded}");
    let sbvh = refused(&presplit().with(|s| s.initial = Initial::Sbvh));
    assert!(sbvh.starts_with("presplit is given, but must be none"), "{sbvh}");
    let done = on_cpu(&triangles, &presplit());
    let tree = refused(&presplit().with(|s| s.initial = done.tree.clone().into()));
    assert!(tree.starts_with("presplit is given"), "{tree}");
    let budget = refused(&with_form(PresplitForm::Level, 0.0));
    assert_eq!(budget, "presplit.budget is 0, but must be above 0 and at most 16");
    let bins = refused(&Settings::default().with(|s| s.sbvh.bins = 1));
    assert_eq!(bins, "sbvh.bins is 1, but must be from 2 to 256");

    let boxes = Scene::from_boxes("boxes", &[triangles[0].aabb(), triangles[1].aabb()]).unwrap();
    let mut device = CpuDevice::new(1).unwrap();
    let cut = Settings::default().with(|s| s.initial = Initial::Sbvh);
    let error = optimize(&boxes, &mut device, &cut, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string();
    assert!(error.contains("initial is sbvh, but must be another one for a scene of boxes"), "{error}");
    let whole = optimize(&boxes, &mut device, &presplit(), &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(whole.splits.is_none());

    // A plan for triangles as they are has no room for more references.
    let scene = Scene::from_triangles("pieces", triangles.clone()).unwrap();
    let plan = Plan::of(&scene, device.info(), &Settings::default(), &[]).unwrap();
    let error = plan.check_purpose(&scene, &presplit()).unwrap_err().to_string();
    assert!(error.contains("splits of triangles"), "{error}");

    // A tree from frame to frame has each triangle once.
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    let faults = Reoptimizer::new(&mut device, &done.tree, &boxes[..]).err().unwrap().to_string();
    assert!(faults.contains("again in leaf"), "{faults}");
}

#[test]
fn splits_of_a_turned_hall_lower_its_overlap() {
    let half = 0.5f32.sqrt();
    let turn = |p: [f32; 3]| {
        let q = [half * (p[0] - p[2]), p[1], half * (p[0] + p[2])];
        [q[0], half * (q[1] - q[2]), half * (q[1] + q[2])]
    };
    let triangles: Vec<Triangle> =
        built_in(1000).triangles.iter().map(|t| Triangle { a: turn(t.a), b: turn(t.b), c: turn(t.c) }).collect();
    let sah = bvh::SahModel::default();
    let measured = |settings: &Settings| {
        let done = on_cpu(&triangles, settings);
        (bvh::epo(&done.tree, &triangles, &sah).value, done.quality.sah_cost)
    };
    let whole = measured(&Settings::default());
    let split = measured(&with_form(PresplitForm::default(), 0.3));
    let sbvh = measured(&Settings::default().with(|s| s.initial = Initial::Sbvh));
    for (epo, cost) in [split, sbvh] {
        assert!(epo < 0.7 * whole.0 && cost < whole.1, "{split:?}, {sbvh:?}, {whole:?}");
    }
}

//! Nodes of several children, computed on every device, are those that the host computes, bit for bit.

use prbvh::bvh::{Bvh, Content};
use prbvh::collapse::{CollapseError, CollapseSettings};
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{Initial, Optimizer, Settings, optimize};
use prbvh::scene::{Scene, Triangle, built_in};
use prbvh::wide::{CollapseMethod, Layout, WideSettings, Width, collapse, collapse_on, quality, validate};
use prbvh_kernel::aabb::Aabb;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{flat, nested, soup};
use prbvh_tests::oracle::{comb, half_area, random_tree};
use std::ops::ControlFlow;

const FORMS: [(Width, Layout); 3] =
    [(Width::Four, Layout::Soa), (Width::Eight, Layout::Soa), (Width::Eight, Layout::Cwbvh)];

fn settings((width, layout): (Width, Layout), max_leaf: Option<u32>) -> WideSettings {
    WideSettings::default().with(|s| {
        s.width = width;
        s.layout = layout;
        s.max_leaf = max_leaf;
    })
}

fn run(triangles: &[Triangle], settings: &Settings) -> prbvh::pipeline::Optimized {
    let scene = Scene::from_triangles("scene", triangles.to_vec()).unwrap();
    optimize(&scene, &mut CpuDevice::new(2).unwrap(), settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn swept(triangles: &[Triangle], adaptive: Option<CollapseSettings>) -> Bvh {
    let settings = Settings::default().with(|s| {
        s.initial = Initial::SahSweep;
        s.optimizer = Optimizer::None;
        s.adaptive = adaptive;
    });
    run(triangles, &settings).tree
}

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

fn check(tree: &Bvh, triangles: &[Triangle], what: &str) {
    for form in FORMS {
        for max_leaf in [None, Some(1)] {
            let settings = settings(form, max_leaf);
            let expected = collapse(tree, &settings).unwrap();
            validate(&expected, Some(triangles)).unwrap();
            with_devices(|devices| {
                for (name, device) in devices {
                    let before = device.memory().bytes;
                    let (made, timings) = collapse_on(&mut **device, tree, &settings).unwrap();
                    assert!(made == expected, "{what}, {form:?}, {max_leaf:?}, {name}: another tree");
                    assert!(!timings.is_empty() && device.memory().bytes == before, "{what}, {name}");
                }
            });
        }
    }
}

#[test]
fn every_device_makes_the_same_tree() {
    for (count, size, seed) in [(1, 0.5, 1), (2, 0.5, 2), (3, 0.5, 3), (9, 0.8, 4), (2500, 0.05, 5)] {
        let triangles = soup(count, size, seed);
        check(&swept(&triangles, None), &triangles, &format!("soup of {count}"));
        let random = Bvh::from_device(&random_tree(&boxes_of(&triangles), seed).encode()).unwrap();
        check(&random, &triangles, &format!("random tree of {count}"));
    }
    let triangles = &*built_in(1000).triangles;
    check(&swept(triangles, Some(CollapseSettings::default())), triangles, "leaves of several");
    for reach in [1, 2] {
        let settings = settings(FORMS[2], None).with(|s| s.reach = reach);
        let tree = swept(triangles, None);
        let expected = collapse(&tree, &settings).unwrap();
        let (made, _) = collapse_on(&mut CpuDevice::new(2).unwrap(), &tree, &settings).unwrap();
        assert!(made == expected, "moves as far as {reach}");
    }
    let chain = nested(700);
    check(&Bvh::from_device(&comb(&boxes_of(&chain)).encode()).unwrap(), &chain, "a chain");
    let flat = flat(300);
    check(&swept(&flat, None), &flat, "no area");
    let point = vec![Triangle { a: [1.0; 3], b: [1.0; 3], c: [1.0; 3] }; 40];
    check(&swept(&point, None), &point, "a point");
}

#[test]
fn scale_makes_no_difference() {
    let triangles = soup(400, 0.1, 9);
    let scaled = |exponent: i32| {
        let scale = 2f32.powi(exponent);
        let of = |p: [f32; 3]| p.map(|x| x * scale);
        triangles.iter().map(|t| Triangle { a: of(t.a), b: of(t.b), c: of(t.c) }).collect::<Vec<_>>()
    };
    let tree = swept(&triangles, None);
    let settings = settings((Width::Eight, Layout::Soa), None);
    let expected = collapse(&tree, &settings).unwrap();
    // Products of extents are no float32 in either.
    for exponent in [-80, 80] {
        let other = scaled(exponent);
        let made = collapse(&tree.clone().with_boxes_of(&other), &settings).unwrap();
        assert_eq!(made, expected.clone().with_boxes_of(&other), "{exponent}");
    }
}

#[test]
fn a_broken_tree_is_refused() {
    let triangles = soup(30, 0.2, 7);
    let mut tree = swept(&triangles, None);
    tree.nodes[3].parent = 29;
    let mut device = CpuDevice::new(1).unwrap();
    for reach in [0, 1] {
        let error = collapse_on(&mut device, &tree, &WideSettings::default().with(|s| s.reach = reach)).unwrap_err();
        assert!(matches!(error, CollapseError::InvalidTree { .. }), "{error}");
    }
    assert_eq!(device.memory().bytes, 0);
}

#[test]
fn a_run_has_of_it_what_was_asked_for() {
    let triangles = &*built_in(3000).triangles;
    let of = |wide: Option<WideSettings>| {
        let scene = Scene::from_triangles("scene", triangles.to_vec()).unwrap();
        let settings = Settings::default().with(|s| {
            // What is made on the host leaves the peak to the nodes of several children.
            s.initial = Initial::SahSweep;
            s.optimizer = Optimizer::None;
            s.wide = wide;
        });
        let mut device = CpuDevice::new(2).unwrap();
        let made = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        let phases: Vec<_> = made.plan.phases.iter().filter(|phase| phase.runs).cloned().collect();
        assert_eq!(phases.iter().map(|phase| phase.peak_bytes).max(), Some(device.memory().peak_bytes));
        assert_eq!(made.plan.unplanned(&made.ran), Vec::<&str>::new());
        let names: Vec<String> = phases.into_iter().map(|phase| phase.phase).collect();
        assert!(made.wide.is_some() || wide.is_none());
        (made.plan.code.kernels.contains(&"collapse_widen"), names, device.memory().peak_bytes, made.wide_timings)
    };
    let (has_kernel, phases, bytes, _) = of(None);
    assert!(!has_kernel && !phases.iter().any(|phase| phase.contains("nodes of")), "{phases:?}");
    assert_eq!(bytes, 32 * (2 * 3000 - 1));
    for (form, words) in FORMS.into_iter().zip([4, 8, 8]) {
        let wide = settings(form, None);
        let (has_kernel, phases, bytes, timings) = of(Some(wide));
        assert!(has_kernel && phases.contains(&format!("nodes of {words}")), "{phases:?}");
        assert_eq!(bytes, 32 * (2 * 3000 - 1) + 4 * (words + 2) * 2999);
        assert!(!timings.is_empty());
        let greedy = wide.with(|s| s.method = CollapseMethod::Greedy);
        let (has_kernel, phases, _, timings) = of(Some(greedy));
        assert!(!has_kernel && !phases.iter().any(|phase| phase.contains("nodes of")), "{phases:?}");
        assert!(timings.is_empty());
    }
}

/// What a tree costs at least, in float64: of each node as a forest of at most `i` roots, at `i - 1`, after the definition; and its triangles.
fn least_cost(tree: &Bvh, settings: &WideSettings) -> f64 {
    let (width, model) = (settings.width.get(), settings.costs());
    let root = half_area(&tree.nodes[0].aabb);
    let mut done: Vec<Option<(Vec<f64>, u32)>> = vec![None; tree.nodes.len()];
    let mut stack = vec![(0u32, false)];
    while let Some((v, is_ready)) = stack.pop() {
        let area = half_area(&tree.nodes[v as usize].aabb) / root;
        match tree.nodes[v as usize].content {
            Content::Leaf { count, .. } => {
                done[v as usize] = Some((vec![model.c_intersect * area * f64::from(count); width], count));
            }
            Content::Internal { left, right } if !is_ready => stack.extend([(v, true), (left, false), (right, false)]),
            Content::Internal { left, right } => {
                let [(left, few), (right, more)] = [left, right].map(|child| done[child as usize].take().unwrap());
                let triangles = few + more;
                let both =
                    |roots: usize| (1..roots).map(|k| left[k - 1] + right[roots - k - 1]).fold(f64::INFINITY, f64::min);
                let opened = both(width);
                let fits = triangles <= settings.most_of_a_leaf();
                let leaf = if fits { model.c_intersect * area * f64::from(triangles) } else { f64::INFINITY };
                if v == 0 {
                    return model.c_traversal + leaf.min(opened);
                }
                let mut at_most = vec![leaf.min(model.c_traversal * area + opened)];
                for roots in 2..=width {
                    at_most.push(at_most[roots - 2].min(both(roots)));
                }
                done[v as usize] = Some((at_most, triangles));
            }
        }
    }
    unreachable!("a tree of several leaves has an internal root")
}

#[test]
fn the_costs_of_float32_lose_nothing_that_counts() {
    let triangles = &*built_in(20_000).triangles;
    let tree = swept(triangles, None);
    for form in FORMS {
        let settings = settings(form, None);
        let cost = quality(&collapse(&tree, &settings).unwrap(), &settings.costs()).sah_cost;
        let least = least_cost(&tree, &settings);
        assert!((cost / least - 1.0).abs() < 1e-6, "{form:?}: {cost}, not {least}");
        // A planted fault: another tree than the best one is told from it.
        let greedy = settings.with(|s| s.method = CollapseMethod::Greedy);
        assert!(quality(&collapse(&tree, &greedy).unwrap(), &settings.costs()).sah_cost > 1.01 * least);
    }
}

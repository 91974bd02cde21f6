//! Rotations against naive ones, on every device: hill climbing, annealing, and in a refit.

use bytemuck::Zeroable;
use prbvh::build::{DeviceTree, UnfitTree, sah_binned};
use prbvh::bvh::{Bvh, quality, tree_hash, validate};
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{
    IterationRow, Limits, OptimizeError, Outcome, RotationSettings, StopReason, refit_rotating, rotations,
};
use prbvh::pipeline::{Optimizer, Settings, optimize};
use prbvh::scene::{Scene, built_in};
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::kept::Kept;
use prbvh_kernel::node::{Node, RIGHT};
use prbvh_kernel::rotations::{COUSINS, KEEPS, Offer, RELATIVE_THRESHOLD, RotateParams, exponential, key};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{APPLIED, FAULT_BROKEN_TREE, FAULTS, GREW, REPORT_WORDS, SHRUNK};
use prbvh_kernel::subtrees::{SubtreesParams, TO_LEAVES};
use prbvh_kernel::sum::{scale_of, to_f64};
use prbvh_kernel::trace::random::hash;
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{Random, inputs, nested, soup, working};
use prbvh_tests::oracle::{NaiveTree, comb, half_area, tree_of};
use std::ops::ControlFlow;

/// Places of two nodes: which child of which node each is.
type Swap = [(u32, usize); 2];

/// The rotations of a node in the order of the kernel; none where a child has no children.
fn swaps(tree: &NaiveTree, p: u32, cousins: bool) -> [Option<Swap>; 6] {
    let [l, r] = tree.children[p as usize][..] else { unreachable!("a leaf has no rotations") };
    let opens = |v: u32| !tree.children[v as usize].is_empty();
    let right = |swap| opens(r).then_some(swap);
    let left = |swap| opens(l).then_some(swap);
    let both = |swap| (opens(l) && opens(r) && cousins).then_some(swap);
    [
        right([(p, 0), (r, 0)]),
        right([(p, 0), (r, 1)]),
        left([(p, 1), (l, 0)]),
        left([(p, 1), (l, 1)]),
        both([(l, 0), (r, 0)]),
        both([(l, 0), (r, 1)]),
    ]
}

fn swap(tree: &mut NaiveTree, [a, b]: Swap) {
    let [first, second] = [a, b].map(|(v, side)| tree.children[v as usize][side]);
    tree.children[a.0 as usize][a.1] = second;
    tree.children[b.0 as usize][b.1] = first;
}

/// The box of a node from those of its children.
fn update(tree: &mut NaiveTree, v: u32) {
    if let [left, right] = tree.children[v as usize][..] {
        tree.boxes[v as usize] = tree.boxes[left as usize].union(tree.boxes[right as usize]);
    }
}

/// By how much the areas of the children of `p` fall, in f32, and from what.
fn decrease(tree: &NaiveTree, p: u32, rotation: Swap) -> (f32, f32) {
    let children = tree.children[p as usize].clone();
    let mut rotated = tree.clone();
    swap(&mut rotated, rotation);
    let (mut falls, mut from) = (0.0, 0.0);
    for &child in &children {
        // A child that was swapped itself has its own box.
        update(&mut rotated, child);
        let (before, after) = (tree.boxes[child as usize].half_area(), rotated.boxes[child as usize].half_area());
        if rotation.iter().any(|&(v, _)| v == child) {
            falls += before - after;
            from += before * RELATIVE_THRESHOLD;
        }
    }
    (falls, from)
}

#[derive(Clone, Copy)]
struct Naive {
    cousins: bool,
    /// Temperature and key.
    annealed: Option<(f32, u32)>,
    offer: Offer,
}

impl Naive {
    fn choice(self, tree: &NaiveTree, p: u32) -> Option<Swap> {
        let area =
            tree.children[p as usize].iter().fold(Aabb::EMPTY, |all, &v| all.union(tree.boxes[v as usize])).half_area();
        if p & self.offer.mask != self.offer.turn & self.offer.mask && area < self.offer.area {
            return None;
        }
        let swaps = swaps(tree, p, self.cousins);
        if let Some((temperature, key)) = self.annealed {
            let word = hash(p.wrapping_add(key));
            let rotation = swaps[(((word >> 16) * 6) >> 16) as usize]?;
            let (falls, _) = decrease(tree, p, rotation);
            return (falls > 0.0 || -falls < temperature * exponential(hash(word))).then_some(rotation);
        }
        let mut best: Option<(f32, Swap)> = None;
        for rotation in swaps.into_iter().flatten() {
            let (falls, from) = decrease(tree, p, rotation);
            if falls > from && falls > best.map_or(0.0, |best| best.0) {
                best = Some((falls, rotation));
            }
        }
        best.map(|best| best.1)
    }

    /// A pass over what hangs below `p`, from below; returns the rotations made.
    fn pass(self, tree: &mut NaiveTree, p: u32) -> u32 {
        let [l, r] = tree.children[p as usize][..] else { return 0 };
        let mut made = self.pass(tree, l) + self.pass(tree, r);
        if let Some(rotation) = self.choice(tree, p) {
            swap(tree, rotation);
            made += 1;
        }
        // Children that were moved are as they were.
        for child in [l, r, p] {
            update(tree, child);
        }
        made
    }
}

fn params(tree: &NaiveTree, naive: Naive, flags: u32) -> RotateParams {
    let (temperature, key) = naive.annealed.unwrap_or_default();
    RotateParams {
        count: tree.boxes.len().div_ceil(2) as u32,
        flags: if naive.cousins { COUSINS } else { 0 } | flags,
        key,
        temperature,
        scale: scale_of(half_area(&tree.boxes[0])),
        epoch: 1,
        offer: naive.offer,
    }
}

fn case(tree: &NaiveTree, params: &RotateParams) -> Case {
    let internal = tree.boxes.len() / 2;
    let case = Case::new(Kernel::Rotations, params.count, params).with(&tree.encode());
    case.zeros(internal.max(1)).zeros(internal.max(1)).zeros(REPORT_WORDS as usize)
}

/// Half area that half of the internal nodes have.
fn median_area(tree: &NaiveTree) -> f32 {
    let mut areas: Vec<f32> = tree.boxes[..tree.boxes.len() / 2].iter().map(|aabb| aabb.half_area()).collect();
    areas.sort_unstable_by(f32::total_cmp);
    areas.get(areas.len() / 2).copied().unwrap_or_default()
}

/// Small trees of every kind, with a random tree over each.
fn trees() -> Vec<(&'static str, NaiveTree)> {
    let mut trees: Vec<(&'static str, NaiveTree)> = inputs()
        .into_iter()
        .map(|(name, mut triangles)| {
            triangles.truncate(300);
            (name, tree_of(&working(&triangles), 3))
        })
        .collect();
    let boxes = |triangles: &[Triangle]| triangles.iter().map(Triangle::aabb).collect::<Vec<_>>();
    trees.push(("chain", comb(&boxes(&soup(300, 0.1, 7)))));
    trees.push(("nested chain", comb(&boxes(&working(&nested(200))))));
    trees
}

#[test]
fn a_pass_is_the_naive_one() {
    let mut made_in_all = 0;
    for (name, start) in trees() {
        let temperature = (start.internal_area() / start.boxes.len() as f64) as f32;
        let large = median_area(&start);
        let ways = [
            Naive { cousins: true, annealed: None, offer: Offer::TO_ALL },
            Naive { cousins: false, annealed: None, offer: Offer::TO_ALL },
            Naive { cousins: true, annealed: Some((temperature, key(7, 3))), offer: Offer::TO_ALL },
            Naive { cousins: true, annealed: None, offer: Offer { mask: 1, turn: 6, area: large } },
        ];
        for naive in ways {
            let mut tree = start.clone();
            for pass in 0..2 {
                let mut expected = tree.clone();
                let made = naive.pass(&mut expected, 0);
                let params = params(&tree, naive, KEEPS);
                let result = case(&tree, &params).run_everywhere();
                let what = format!("{name}, pass {pass}");
                let nodes = result.get::<Node>("nodes");
                assert!(NaiveTree::decode(&nodes) == expected, "{what}");
                let report = result.get::<u32>("report");
                assert_eq!(report[APPLIED], made, "{what}");
                let sum = |word: usize| to_f64(report[word], report[word + 1], params.scale);
                let (said, measured) = (sum(SHRUNK) - sum(GREW), tree.internal_area() - expected.internal_area());
                assert!((said - measured).abs() <= 1e-5 * tree.internal_area(), "{what}: {said} {measured}");
                assert!(naive.annealed.is_some() || measured >= 0.0, "{what}: {measured}");
                // Whoever has other children than before has noted those.
                let internal = tree.boxes.len() / 2;
                for (v, kept) in result.get::<Kept>("kept").iter().enumerate().take(internal) {
                    let is_kept = kept.epoch == 1 && tree.children[v] == [kept.left, kept.right];
                    assert!(is_kept || (kept.epoch == 0 && tree.children[v] == expected.children[v]), "{what}: {v}");
                }
                made_in_all += made;
                tree = expected;
            }
        }
    }
    assert!(made_in_all > 1000, "{made_in_all}");
}

#[test]
fn a_pass_by_subtrees_is_the_naive_one() {
    let mut made = 0;
    for (name, start) in trees() {
        let references = start.boxes.len().div_ceil(2) as u32;
        let all = Naive { cousins: true, annealed: None, offer: Offer::TO_ALL };
        let ways = [
            (Some(all), vec![4, 2, 0]),
            (Some(Naive { offer: Offer { mask: 3, turn: 5, area: median_area(&start) }, ..all }), vec![7, 0]),
            (Some(Naive { offer: Offer { mask: 3, turn: 6, area: f32::INFINITY }, ..all }), vec![4, 0]),
            (Some(Naive { cousins: false, ..all }), vec![0]),
            (None, vec![3, 0]),
        ];
        for (naive, levels) in ways {
            let mut expected = start.clone();
            match naive {
                Some(naive) => made += naive.pass(&mut expected, 0),
                None => expected.refit(0),
            }
            // Boxes come with the dispatch, by references, which leaves name in another order; those of the tree are stale.
            let mut nodes = start.encode();
            let (inner, leaves) = nodes.split_at_mut(references as usize - 1);
            let mut boxes = vec![Aabb::EMPTY; references as usize];
            for (k, leaf) in leaves.iter_mut().enumerate() {
                leaf.down = references - 1 - k as u32;
                expected.references[references as usize - 1 + k] = leaf.down;
                boxes[leaf.down as usize] = leaf.aabb();
            }
            for node in inner.iter_mut().chain(leaves) {
                (node.min, node.max) = ([7.0; 3], [-7.0; 3]);
            }
            let mut last = TO_LEAVES;
            for first in levels {
                let params = SubtreesParams {
                    count: 1 << first,
                    references,
                    first,
                    last,
                    rotates: naive.is_some().into(),
                    flags: naive.map_or(0, |naive| if naive.cousins { COUSINS } else { 0 }),
                    offer: naive.map_or(Offer::TO_ALL, |naive| naive.offer),
                };
                let case = Case::new(Kernel::SubtreesRefit, params.count, &params).with(&boxes).with(&nodes);
                let result = case.zeros(REPORT_WORDS as usize).run_everywhere();
                assert_eq!(result.get::<u32>("report")[FAULTS], 0, "{name}");
                nodes = result.get("nodes");
                last = first;
            }
            assert!(NaiveTree::decode(&nodes) == expected, "{name}, {:?}", naive.map(|naive| naive.offer));
        }
    }
    assert!(made > 1000, "{made}");
}

#[test]
fn a_pass_by_subtrees_ends_where_links_go_round() {
    let tree = tree_of(&working(&soup(50, 0.1, 1)), 1);
    let mut nodes = tree.encode();
    let last = nodes.len() - 1;
    nodes[last].up = last as u32;
    let params = SubtreesParams { count: 1, references: 50, last: TO_LEAVES, ..Zeroable::zeroed() };
    let case = Case::new(Kernel::SubtreesRefit, 1, &params).with(&vec![Aabb::EMPTY; 50]).with(&nodes);
    let result = case.zeros(REPORT_WORDS as usize).run_everywhere();
    assert_eq!(result.get::<u32>("report")[FAULTS], FAULT_BROKEN_TREE);
}

#[test]
fn the_naive_pass_tells_a_wrong_rotation() {
    let tree = tree_of(&working(&soup(200, 0.1, 1)), 1);
    let naive = Naive { cousins: true, annealed: None, offer: Offer::TO_ALL };
    let mut right = tree.clone();
    assert!(naive.pass(&mut right, 0) > 50);
    // One more, and not the best: another tree, and a dearer one.
    let mut wrong = right.clone();
    let (p, rotation) = (0..199)
        .find_map(|p| {
            Some((p, swaps(&wrong, p, true).into_iter().flatten().find(|&s| decrease(&wrong, p, s).0 < 0.0)?))
        })
        .unwrap();
    swap(&mut wrong, rotation);
    wrong.refit(p);
    assert!(wrong != right && wrong.internal_area() > right.internal_area());
    assert!(
        !falls(&[right.internal_area(), wrong.internal_area()])
            && falls(&[tree.internal_area(), right.internal_area()])
    );
}

/// Whether costs never rise.
fn falls(costs: &[f64]) -> bool {
    costs.windows(2).all(|pair| pair[1] <= pair[0])
}

#[test]
fn random_numbers_are_about_exponential() {
    let mut random = Random(5);
    let mut sum = 0.0;
    for _ in 0..100_000 {
        let word = random.bits() as u32;
        let exact = -((f64::from(word) + 0.5) / 4_294_967_296.0).ln();
        let have = f64::from(exponential(word));
        sum += have;
        assert!((have - exact).abs() < 0.09 * std::f64::consts::LN_2, "{word}: {have} {exact}");
    }
    assert!((sum / 100_000.0 - 1.0).abs() < 0.06, "{sum}");
    assert!([0, 1, u32::MAX].iter().all(|&word| exponential(word).is_finite() && exponential(word) >= 0.0));
}

struct Run {
    nodes: Vec<Node>,
    outcome: Outcome,
    /// SAH cost in f64 of the tree of each row, and of the last.
    costs: Vec<f64>,
}

fn run(device: &mut dyn Device, nodes: &[Node], triangles: &[Triangle], settings: &RotationSettings) -> Run {
    let tree = DeviceTree::upload(device, nodes).unwrap();
    let mut costs = Vec::new();
    let mut measure = |tree: &DeviceTree, device: &mut dyn Device| {
        let tree = Bvh::from_device(&tree.download(device).unwrap()).unwrap();
        validate(&tree, Some(triangles)).unwrap();
        costs.push(quality(&tree, &Default::default()).sah_cost);
    };
    let outcome = rotations(device, &tree, settings, &mut |_, tree, device| {
        measure(tree, device);
        ControlFlow::Continue(())
    });
    measure(&tree, device);
    let nodes = tree.download(device).unwrap();
    tree.free(device);
    Run { nodes, outcome: outcome.unwrap(), costs }
}

/// Runs on every device; all do the same.
fn check(nodes: &[Node], triangles: &[Triangle], settings: &RotationSettings, what: &str) -> Run {
    let mut first: Option<Run> = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let before = device.memory().bytes;
            let result = run(&mut **device, nodes, triangles, settings);
            assert_eq!(device.memory().bytes, before, "{what}, {name}: all buffers are given back");
            let words = bytemuck::cast_slice::<Node, u32>;
            let plain = |run: &Run| -> Vec<_> { run.outcome.rows.iter().map(|row| (row.cost, row.applied)).collect() };
            match &first {
                None => first = Some(result),
                Some(first) => {
                    assert!(words(&first.nodes) == words(&result.nodes), "{what}, {name}");
                    assert_eq!(plain(first), plain(&result), "{what}, {name}");
                }
            }
        }
    });
    first.expect("there is always the CPU")
}

#[test]
fn hill_climbing_never_costs_more_and_says_what_it_gains() {
    for (name, triangles) in inputs() {
        let triangles = working(&triangles[..triangles.len().min(500)]);
        let nodes = tree_of(&triangles, 3).encode();
        let Run { outcome, costs, .. } = check(&nodes, &triangles, &RotationSettings::default(), name);
        assert_eq!(outcome.stop, StopReason::Converged, "{name}");
        assert!(falls(&costs), "{name}: {costs:?}");
        if nodes[0].aabb().half_area() > 0.0 {
            for (pair, row) in costs.windows(2).zip(&outcome.rows[1..]) {
                let gained = pair[0] - pair[1];
                assert!((row.predicted_decrease - gained).abs() < 1e-5 * pair[0], "{name}: {row:?} {gained}");
                assert!((row.cost / pair[1] - 1.0).abs() < 1e-5, "{name}: {row:?} {}", pair[1]);
            }
        }
        if triangles.len() < 3 {
            assert_eq!(outcome.rows.len(), 1, "{name}");
        }
    }
}

#[test]
fn annealing_keeps_the_best_tree() {
    let mut went_back = 0;
    for (name, triangles) in inputs() {
        let triangles = working(&triangles[..triangles.len().min(400)]);
        let nodes = sah_binned(&triangles);
        for temperature in [0.1, 3.0] {
            let settings = RotationSettings::default().with(|s| {
                (s.annealing_passes, s.temperature, s.seed) = (4, temperature, 9);
                // It may not climb back in the passes that are left.
                s.limits = Limits::iterations(6);
            });
            let Run { outcome, costs, .. } = check(&nodes, &triangles, &settings, name);
            let (last, rows) = costs.split_last().unwrap();
            let least = rows.iter().copied().fold(f64::INFINITY, f64::min);
            assert!((last / least - 1.0).abs() < 3e-6, "{name}: {costs:?}");
            went_back += u32::from(rows[rows.len() - 1] > least * (1.0 + 1e-5));
            assert!(outcome.rows.len() <= 7);
        }
    }
    assert!(went_back > 3, "{went_back}");
}

#[test]
fn another_seed_or_temperature_is_another_tree() {
    let triangles = working(&soup(600, 0.1, 3));
    let nodes = sah_binned(&triangles);
    let mut device = CpuDevice::new(1).unwrap();
    let mut made = |change: &dyn Fn(&mut RotationSettings)| {
        let settings = RotationSettings::default().with(|s| {
            s.annealing_passes = 5;
            change(s);
        });
        run(&mut device, &nodes, &triangles, &settings).nodes
    };
    let plain = made(&|_| {});
    assert_eq!(plain, made(&|_| {}));
    assert!(plain != made(&|s| s.seed = 2) && plain != made(&|s| s.temperature = 0.5));
    assert!(plain != made(&|s| s.annealing_passes = 0) && plain != made(&|s| s.cousins = false));
}

#[test]
fn limits_end_the_passes() {
    let triangles = working(&built_in(2000).triangles);
    let mut device = CpuDevice::new(2).unwrap();
    let nodes = tree_of(&triangles, 1).encode();
    let mut ended = |change: &dyn Fn(&mut RotationSettings)| {
        let outcome = run(&mut device, &nodes, &triangles, &RotationSettings::default().with(|s| change(s))).outcome;
        (outcome.stop, outcome.rows.len(), outcome.best().cost)
    };
    let (stop, rows, best) = ended(&|_| {});
    assert!(stop == StopReason::Converged && rows > 5, "{stop} {rows}");
    let (stop, rows, _) = ended(&|s| s.limits = Limits::iterations(2));
    assert_eq!((stop, rows), (StopReason::MaxIterations, 3));
    let (stop, rows_to_target, cost) = ended(&|s| s.limits.target_cost = Some(1.5 * best));
    assert!(stop == StopReason::Target && rows_to_target < rows + 20 && cost <= 1.5 * best);
    let (stop, ..) = ended(&|s| s.limits.max_time = Some(std::time::Duration::ZERO));
    assert_eq!(stop, StopReason::MaxTime);
    // Without epsilon until nothing rotates.
    let (_, more, lower) = ended(&|s| s.epsilon = 0.0);
    assert!(more > rows && lower <= best);
    let tree = DeviceTree::upload(&mut device, &nodes).unwrap();
    let bad = RotationSettings::default().with(|s| s.temperature = f64::NAN);
    let refused = rotations(&mut device, &tree, &bad, &mut |_, _, _| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(refused, OptimizeError::Setting(_)) && refused.to_string().contains("temperature is NaN"));
    let cancelled = rotations(&mut device, &tree, &Default::default(), &mut |_, _, _| ControlFlow::Break(())).unwrap();
    assert_eq!((cancelled.stop, cancelled.rows.len()), (StopReason::Cancelled, 1));
    tree.free(&mut device);
}

#[test]
fn a_refit_rotates_what_moved() {
    let triangles = working(&soup(2000, 0.05, 3));
    let mut nodes = sah_binned(&triangles);
    // Everything goes somewhere else.
    let moved = working(&soup(2000, 0.05, 4));
    for leaf in &mut nodes[1999..] {
        let aabb = moved[leaf.down as usize].aabb();
        (leaf.min, leaf.max) = (aabb.min, aabb.max);
    }
    let mut results = Vec::new();
    with_devices(|devices| {
        for (_, device) in devices {
            let device = &mut **device;
            let refitted = |rotates: bool, device: &mut dyn Device| {
                let tree = DeviceTree::upload(device, &nodes).unwrap();
                let made = if rotates {
                    refit_rotating(device, &tree).unwrap()
                } else {
                    tree.refit(device).map(|()| 0).unwrap()
                };
                let nodes = tree.download(device).unwrap();
                tree.free(device);
                let tree = Bvh::from_device(&nodes).unwrap();
                validate(&tree, Some(&moved)).unwrap();
                (made, tree_hash(&tree), quality(&tree, &Default::default()).sah_cost)
            };
            results.push([refitted(true, device), refitted(false, device)]);
        }
    });
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{results:?}");
    let [(made, _, rotated), (_, _, plain)] = &results[0];
    assert!(*made > 500 && *rotated < 0.9 * plain, "{made}: {rotated} {plain}");
}

#[test]
fn links_that_are_no_tree_are_refused() {
    let mut nodes = tree_of(&working(&soup(100, 0.1, 1)), 1).encode();
    let leaf = nodes.len() - 1;
    nodes[leaf].up = nodes[leaf - 1].up | RIGHT;
    let mut device = CpuDevice::new(1).unwrap();
    let tree = DeviceTree::upload(&mut device, &nodes).unwrap();
    assert!(matches!(refit_rotating(&mut device, &tree), Err(UnfitTree::Broken { .. })));
    let refused = rotations(&mut device, &tree, &Default::default(), &mut |_, _, _| ControlFlow::Continue(()));
    assert!(matches!(refused, Err(OptimizeError::Tree(_))));
}

#[test]
fn the_pipeline_rotates() {
    let scene = built_in(4000);
    let mut hashes = Vec::new();
    with_devices(|devices| {
        for (name, device) in devices.iter_mut().skip(4) {
            let mut costs = Vec::new();
            for annealing in [0, 10] {
                let rotations = RotationSettings::default().with(|s| s.annealing_passes = annealing);
                let settings = Settings::default().with(|s| s.optimizer = Optimizer::Rotations(rotations));
                let go_on = &mut |_: &IterationRow| ControlFlow::Continue(());
                let result = optimize(&scene, &mut **device, &settings, go_on).unwrap();
                assert_eq!(result.outcome.stop, StopReason::Converged, "{name}");
                assert_eq!(result.plan.unplanned(&result.ran), Vec::<&str>::new(), "{name}");
                costs.extend([result.initial.sah_cost, result.quality.sah_cost]);
                hashes.push((annealing, tree_hash(&result.tree)));
            }
            eprintln!("{name}: {costs:?}");
            assert!(costs[1] < 0.85 * costs[0] && costs[3] < 0.85 * costs[2], "{name}: {costs:?}");
            let tree = Scene::from_triangles("one", soup(1, 0.1, 1)).unwrap();
            let settings =
                Settings::default().with(|s| s.optimizer = Optimizer::Rotations(RotationSettings::default()));
            optimize(&tree, &mut **device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        }
    });
    assert!(hashes.chunks(2).all(|pair| pair == &hashes[..2]), "{hashes:?}");
}

#[test]
fn a_deep_chain_is_passed_on_every_device() {
    let triangles = working(&nested(9000));
    let boxes: Vec<_> = triangles.iter().map(Triangle::aabb).collect();
    let nodes = comb(&boxes).encode();
    let settings = RotationSettings::default().with(|s| s.limits = Limits::iterations(2));
    let mut hashes = Vec::new();
    with_devices(|devices| {
        for (_, device) in devices {
            let device = &mut **device;
            let tree = DeviceTree::upload(device, &nodes).unwrap();
            rotations(device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap();
            hashes.push(tree_hash(&Bvh::from_device(&tree.download(device).unwrap()).unwrap()));
            tree.free(device);
        }
    });
    assert!(hashes.windows(2).all(|pair| pair[0] == pair[1]), "{hashes:?}");
}

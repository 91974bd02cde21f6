//! The builders of initial trees: against naive ones, on every device, on inputs of every kind, and as starts of the optimiser.

use prbvh::build::{
    Bins, DEFAULT_HPLOC_RADIUS, DEFAULT_PASSES, DEFAULT_RADIUS, DeviceTree, MortonBits, TreeletSize, lbvh, ploc,
    sah_binned, sah_binned_by, sah_sweep,
};
use prbvh::bvh::{Bvh, file, quality, tree_hash, validate};
use prbvh::device::Device;
use prbvh::pipeline::{Initial, Optimized, Settings, optimize};
use prbvh::scene::{Scene, built_in};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::ploc::merge::{MOST_GROUPS, MergeParams};
use prbvh_kernel::ploc::nearest::NearestParams;
use prbvh_kernel::ploc::{Cluster, ClustersParams, Progress};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::{Kernel, grid};
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{Random, inputs, nested, soup, working};
use prbvh_tests::oracle::NaiveTree;
use std::num::NonZeroU32;
use std::ops::ControlFlow;

fn radius(places: u32) -> NonZeroU32 {
    NonZeroU32::new(places).unwrap()
}

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

fn valid(nodes: &[Node], triangles: &[Triangle], name: &str) -> Bvh {
    let tree = Bvh::from_device(nodes).unwrap_or_else(|faults| panic!("{name}: {faults:?}"));
    validate(&tree, Some(triangles)).unwrap_or_else(|faults| panic!("{name}: {faults:?}"));
    tree
}

fn progress(clusters: usize, merged: u32) -> Progress {
    Progress { clusters: clusters as u32, merged, rounds: 0, paired_rounds: 0 }
}

fn clusters_of(boxes: &[Aabb]) -> Vec<Cluster> {
    (0..).zip(boxes).map(|(node, &aabb)| Cluster { aabb, node }).collect()
}

/// The nearest of cluster `i`, by definition.
fn naive_nearest(boxes: &[Aabb], i: usize, radius: usize) -> usize {
    let near = i.saturating_sub(radius)..=(i + radius).min(boxes.len() - 1);
    let area = |j: usize| boxes[i].union(boxes[j]).half_area();
    near.filter(|&j| j != i).min_by(|&a, &b| area(a).total_cmp(&area(b)).then((i ^ a).cmp(&(i ^ b)))).unwrap_or(i)
}

#[test]
fn ploc_clusters_are_the_leaves_in_order() {
    let boxes = boxes_of(&soup(5, 0.3, 8));
    let order = [4u32, 2, 0, 1, 3];
    let case = Case::new(Kernel::PlocClusters, 5, &ClustersParams { count: 5 }).with(&order).with(&boxes);
    let result = case.zeros(5).zeros(1).run_everywhere();
    let expected: Vec<Cluster> =
        (4..).zip(order).map(|(node, reference)| Cluster { aabb: boxes[reference as usize], node }).collect();
    assert_eq!(result.get::<Cluster>("clusters"), expected);
    assert_eq!(result.get::<Progress>("progress"), [progress(5, 5)]);
}

#[test]
fn ploc_nearest_is_the_smallest_union_within_the_radius() {
    for (name, triangles) in inputs() {
        let boxes = boxes_of(&working(&triangles));
        let n = boxes.len();
        for radius in [1, 2, 7, 100, 10_000, u32::MAX] {
            // More invocations than clusters: the host does not know how many are left.
            let params = NearestParams { count: n as u32 + 9, radius };
            let case = Case::new(Kernel::PlocNearest, params.count, &params).with(&clusters_of(&boxes));
            let result = case.with(&[progress(n, n as u32)]).zeros(n + 9).run_everywhere();
            let radius = radius.min(n as u32) as usize;
            let expected: Vec<u32> =
                (0..n + 9).map(|i| if i < n { naive_nearest(&boxes, i, radius) as u32 } else { 0 }).collect();
            assert_eq!(result.get::<u32>("neighbours"), expected, "{name}, radius {radius}");
        }
    }
}

#[test]
fn ploc_nearest_is_a_neighbour_whatever_the_boxes_hold() {
    let mut random = Random(3);
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 0.0, -0.0, 1.0, 1e-40];
    let mut corner = || [0; 3].map(|_| values[random.bits() as usize % values.len()]);
    let boxes: Vec<Aabb> = (0..201).map(|_| Aabb { min: corner(), max: corner() }).collect();
    for radius in [0, 1, 3, 500] {
        let params = NearestParams { count: 201, radius };
        let case = Case::new(Kernel::PlocNearest, 201, &params).with(&clusters_of(&boxes)).with(&[progress(201, 201)]);
        let case = case.zeros(201);
        with_devices(|devices| {
            for (name, device) in devices {
                let found = case.run_on(&mut **device).unwrap().get::<u32>("neighbours");
                let reach = radius.max(1);
                assert!((0..).zip(&found).all(|(i, &j)| j < 201 && j != i && j.abs_diff(i) <= reach), "{name}");
                assert!((0..).zip(&found).any(|(i, &j)| found[j as usize] == i), "{name}: nobody merges");
            }
        });
    }
}

#[test]
fn a_slow_round_pairs_the_list() {
    let boxes = boxes_of(&soup(101, 0.1, 1));
    let run = |merged| {
        let case = Case::new(Kernel::PlocNearest, 101, &NearestParams { count: 101, radius: 9 });
        let case = case.with(&clusters_of(&boxes)).with(&[progress(101, merged)]).zeros(101);
        case.run_everywhere().get::<u32>("neighbours")
    };
    let paired: Vec<u32> = (0..101).map(|i: u32| if i == 100 { 99 } else { i ^ 1 }).collect();
    assert_eq!(run(2), paired);
    assert_ne!(run(3), paired);
}

/// A round over chunks of `chunk` clusters.
fn merge_params(clusters: u32, chunk: u32) -> MergeParams {
    let chunks = clusters.div_ceil(chunk);
    MergeParams { count: grid::invocations(chunks), chunk, chunks }
}

#[test]
fn ploc_marks_the_right_ones_of_pairs() {
    // 0 ↔ 2, 3 ↔ 4; 1 and 5 wish for somebody who wishes otherwise; 7 and 8 are no clusters.
    let neighbours = [2u32, 2, 0, 4, 3, 4, 5, 8, 7];
    let run = |chunk| {
        let params = merge_params(9, chunk);
        let case = Case::new(Kernel::PlocMark, params.count, &params).with(&neighbours).with(&[progress(7, 7)]);
        let result = case.with(&[9; 9]).zeros(params.chunks as usize).run_everywhere();
        (result.get::<u32>("marks"), result.get::<u32>("gone"))
    };
    assert_eq!(run(9), (vec![0, 0, 0, 1, 1, 2, 2, 9, 9], vec![2]));
    assert_eq!(run(3), (vec![0, 0, 0, 0, 0, 1, 0, 9, 9], vec![1, 1, 0]));
    assert_eq!(run(1), (vec![0, 0, 0, 0, 0, 0, 0, 9, 9], vec![0, 0, 1, 0, 1, 0, 0, 0, 0]));
}

#[test]
fn ploc_merge_makes_nodes_and_closes_the_gaps() {
    let boxes = boxes_of(&soup(7, 0.3, 6));
    let neighbours = [2u32, 2, 0, 4, 3, 4, 5];
    let clusters: Vec<Cluster> = (6..).zip(&boxes).map(|(node, &aabb)| Cluster { aabb, node }).collect();
    for (chunk, marks, gone) in [
        (7, [0u32, 0, 0, 1, 1, 2, 2], &[2u32][..]),
        (2, [0, 0, 0, 1, 0, 1, 0], &[0, 1, 1, 0]),
        (1, [0; 7], &[0, 0, 1, 0, 1, 0, 0]),
    ] {
        let params = merge_params(7, chunk);
        let case = Case::new(Kernel::PlocMerge, params.count, &params).with(&neighbours).with(&marks).with(gone);
        let result = case.with(&clusters).with(&[progress(7, 7)]).zeros(13).zeros(7).zeros(1).run_everywhere();
        let nodes = result.get::<Node>("nodes");
        // Seven clusters need nodes 0 to 5: the two new ones are 5 and 4.
        assert_eq!((nodes[5].down, nodes[6].up, nodes[8].up), (6, 8, 5 | 1 << 31));
        assert_eq!((nodes[4].down, nodes[9].up, nodes[10].up), (9, 10, 4 | 1 << 31));
        assert_eq!(nodes[5].aabb(), boxes[0].union(boxes[2]));
        let next = result.get::<Cluster>("next_clusters");
        assert_eq!(next.iter().map(|cluster| cluster.node).collect::<Vec<_>>(), [5, 7, 4, 11, 12, 0, 0]);
        assert_eq!(next[2].aabb, boxes[3].union(boxes[4]));
        let done = Progress { clusters: 5, merged: 2, rounds: 1, paired_rounds: 0 };
        assert_eq!(result.get::<Progress>("next_progress"), [done]);
    }
}

/// Two rounds' kernels over as many chunks as a round may have, and one cluster more than fits them without a remainder.
#[test]
fn ploc_marks_and_merges_many_chunks() {
    let mut random = Random(21);
    for (c, chunk) in [(65u32, 64), (MOST_GROUPS, 1), (2 * MOST_GROUPS - 1, 2), (100_001, 99)] {
        // Pairs of neighbours here and there.
        let mut neighbours: Vec<u32> = (0..c).map(|i| if i > 0 { i - 1 } else { 1 }).collect();
        let mut right = vec![0u32; c as usize];
        for i in (0..c - 1).step_by(2).filter(|_| !random.bits().is_multiple_of(3)) {
            neighbours[i as usize] = i + 1;
            right[i as usize + 1] = 1;
        }
        neighbours[0] = 1;
        right[1] = 1;
        let params = merge_params(c, chunk);
        let case =
            Case::new(Kernel::PlocMark, params.count, &params).with(&neighbours).with(&[progress(c as usize, c)]);
        let marked = case.zeros(c as usize).zeros(params.chunks as usize).run_everywhere();
        let (marks, gone) = (marked.get::<u32>("marks"), marked.get::<u32>("gone"));
        for (k, chunk) in right.chunks(chunk as usize).enumerate() {
            assert_eq!(gone[k], chunk.iter().sum::<u32>());
            for (i, mark) in marks.chunks(params.chunk as usize).nth(k).unwrap().iter().enumerate() {
                assert_eq!(*mark, chunk[..i].iter().sum::<u32>());
            }
        }
        let clusters: Vec<Cluster> =
            (0..c).map(|i| Cluster { aabb: Aabb { min: [0.0; 3], max: [i as f32; 3] }, node: c - 1 + i }).collect();
        let case = Case::new(Kernel::PlocMerge, params.count, &params).with(&neighbours).with(&marks).with(&gone);
        let case =
            case.with(&clusters).with(&[progress(c as usize, c)]).zeros(2 * c as usize - 1).zeros(c as usize).zeros(1);
        let result = case.run_everywhere();
        let merged: u32 = right.iter().sum();
        let next = result.get::<Cluster>("next_clusters");
        let mut before = 0;
        for i in 0..c as usize {
            if right[i] == 1 {
                before += 1;
                continue;
            }
            let is_left = right.get(i + 1) == Some(&1);
            let node = if is_left { c - 2 - before } else { c - 1 + i as u32 };
            assert_eq!(next[i - before as usize].node, node, "cluster {i} of {c}");
        }
        assert_eq!(result.get::<Progress>("next_progress")[0].clusters, c - merged);
    }
}

/// PLOC one cluster after the other, over the leaves of `nodes`.
fn naive_ploc(nodes: &[Node], radius: usize) -> (NaiveTree, usize) {
    let n = nodes.len().div_ceil(2);
    let mut tree = NaiveTree {
        children: vec![Vec::new(); nodes.len()],
        boxes: nodes.iter().map(Node::aabb).collect(),
        references: (0..).zip(nodes).map(|(v, node)| if v < n - 1 { 0 } else { node.down }).collect(),
    };
    let mut clusters: Vec<usize> = (n - 1..nodes.len()).collect();
    let (mut merged, mut rounds) = (n, 0);
    while clusters.len() > 1 {
        let c = clusters.len();
        let boxes: Vec<Aabb> = clusters.iter().map(|&v| tree.boxes[v]).collect();
        let pairs = merged < c / 32;
        let partner = |i: usize| if i ^ 1 < c { i ^ 1 } else { i - 1 };
        let nearest = |i: usize| if pairs { partner(i) } else { naive_nearest(&boxes, i, radius) };
        let nearest: Vec<usize> = (0..c).map(nearest).collect();
        let mut next: Vec<Option<usize>> = clusters.iter().copied().map(Some).collect();
        merged = 0;
        for right in 0..c {
            let left = nearest[right];
            if left < right && nearest[left] == right {
                let v = c - 2 - merged;
                tree.children[v] = vec![clusters[left] as u32, clusters[right] as u32];
                tree.boxes[v] = boxes[left].union(boxes[right]);
                next[left] = Some(v);
                next[right] = None;
                merged += 1;
            }
        }
        clusters = next.into_iter().flatten().collect();
        rounds += 1;
    }
    (tree, rounds)
}

#[test]
fn ploc_is_the_naive_ploc_on_every_device() {
    for (name, triangles) in inputs() {
        let triangles = working(&triangles);
        for places in [1, 2, 100, 10_000] {
            let mut expected: Option<(NaiveTree, usize)> = None;
            with_devices(|devices| {
                for (device_name, device) in devices {
                    let before = device.memory().bytes;
                    let (tree, _, progress) =
                        ploc(&mut **device, &triangles, MortonBits::Sixty, radius(places)).unwrap();
                    let nodes = tree.download(&mut **device).unwrap();
                    tree.free(&mut **device);
                    assert_eq!(device.memory().bytes, before, "all buffers are given back");
                    let (naive, rounds) =
                        expected.get_or_insert_with(|| naive_ploc(&nodes, places.min(20_000) as usize));
                    let what = format!("{name}, radius {places}, {device_name}");
                    assert!(NaiveTree::decode(&nodes) == *naive, "{what}");
                    assert_eq!(progress.rounds as usize, *rounds, "{what}");
                    valid(&nodes, &triangles, &what);
                }
            });
        }
    }
}

#[test]
fn ploc_and_lbvh_sort_the_same() {
    let triangles = working(&soup(3000, 0.1, 9));
    with_devices(|devices| {
        let device = &mut *devices[0].1;
        for bits in [MortonBits::Thirty, MortonBits::Sixty] {
            let (first, _) = lbvh(device, &triangles, bits).unwrap();
            let (second, _, _) = ploc(device, &triangles, bits, DEFAULT_RADIUS).unwrap();
            let leaves = |tree: &DeviceTree, device: &mut dyn Device| {
                tree.download(device).unwrap()[2999..].iter().map(|leaf| leaf.down).collect::<Vec<_>>()
            };
            assert_eq!(leaves(&first, device), leaves(&second, device));
            first.free(device);
            second.free(device);
        }
    });
}

/// Hash, rounds and paired rounds, which are the same on the parallel CPU and every GPU.
fn large_ploc(triangles: &[Triangle], places: u32) -> (String, u32, u32) {
    let triangles = working(triangles);
    let mut results = Vec::new();
    with_devices(|devices| {
        for (name, device) in
            devices.iter_mut().filter(|(name, _)| !name.starts_with("CPU") || name.contains("Parallel"))
        {
            let (tree, _, progress) = ploc(&mut **device, &triangles, MortonBits::Sixty, radius(places)).unwrap();
            let hash = tree_hash(&valid(&tree.download(&mut **device).unwrap(), &triangles, name));
            tree.free(&mut **device);
            results.push((hash, progress.rounds, progress.paired_rounds));
        }
    });
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{results:?}");
    results.swap_remove(0)
}

#[test]
fn equal_triangles_halve_each_round() {
    // Enough for a scan of three levels.
    let triangles = vec![soup(1, 0.3, 2)[0]; 300_000];
    for places in [1, 10] {
        let (_, rounds, paired) = large_ploc(&triangles, places);
        assert_eq!((rounds, paired), (19, 0));
    }
}

#[test]
fn chains_take_few_rounds() {
    // Without pairing this takes a round per triangle. With it every other round halves the list until 63 clusters are left, of which a
    // round may merge as few as two.
    let (_, rounds, paired) = large_ploc(&nested(30_000), 10);
    assert!((8..=9).contains(&paired) && rounds <= 2 * 9 + 62, "{rounds} rounds, {paired} paired");
}

/// A binary tree without numbers.
#[derive(Debug, PartialEq)]
enum Shape {
    Leaf(u32),
    Node(Box<(Self, Self)>),
}

fn shape(tree: &NaiveTree, v: u32) -> Shape {
    match tree.children[v as usize][..] {
        [left, right] => Shape::Node(Box::new((shape(tree, left), shape(tree, right)))),
        _ => Shape::Leaf(tree.references[v as usize]),
    }
}

fn grow(ids: &[u32], split: &dyn Fn(&[u32]) -> [Vec<u32>; 2]) -> Shape {
    if let [id] = ids[..] {
        return Shape::Leaf(id);
    }
    let [left, right] = split(ids);
    Shape::Node(Box::new((grow(&left, split), grow(&right, split))))
}

/// SAH cost of a split by definition, and how far it is off the middle.
fn price(boxes: &[Aabb], [left, right]: &[Vec<u32>; 2]) -> (f64, usize) {
    let area = |ids: &[u32]| ids.iter().map(|&id| boxes[id as usize]).reduce(Aabb::union).unwrap().half_area();
    let side = |ids: &[u32]| f64::from(area(ids)) * ids.len() as f64;
    (side(left) + side(right), left.len().abs_diff(right.len()))
}

/// The first of the cheapest.
fn cheapest(boxes: &[Aabb], splits: impl Iterator<Item = [Vec<u32>; 2]>) -> Option<[Vec<u32>; 2]> {
    let priced = splits.map(|split| (price(boxes, &split), split));
    priced.min_by(|(a, _), (b, _)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, split)| split)
}

fn centre(boxes: &[Aabb], id: u32, axis: usize) -> f32 {
    boxes[id as usize].min[axis] + boxes[id as usize].max[axis]
}

fn naive_sweep(boxes: &[Aabb], ids: &[u32]) -> [Vec<u32>; 2] {
    let splits = (0..3).flat_map(|axis| {
        let mut sorted = ids.to_vec();
        sorted.sort_by(|&a, &b| centre(boxes, a, axis).total_cmp(&centre(boxes, b, axis)).then(a.cmp(&b)));
        (1..ids.len()).map(move |k| [sorted[..k].to_vec(), sorted[k..].to_vec()])
    });
    cheapest(boxes, splits).unwrap()
}

fn naive_bins(boxes: &[Aabb], ids: &[u32], bins: u32) -> [Vec<u32>; 2] {
    let splits = (0..3).flat_map(|axis| {
        let centres = || ids.iter().map(|&id| centre(boxes, id, axis));
        let (low, high) = (centres().fold(f32::INFINITY, f32::min), centres().fold(f32::NEG_INFINITY, f32::max));
        let bin = move |id: u32| {
            (((centre(boxes, id, axis) - low) * (bins as f32 / (high - low))) as usize).min(bins as usize - 1)
        };
        let count = if high > low { bins as usize - 1 } else { 0 };
        (1..=count).map(move |k| {
            let (left, right) = ids.iter().copied().partition(|&id| bin(id) < k);
            [left, right]
        })
    });
    let splits = splits.filter(|[left, right]: &[Vec<u32>; 2]| !left.is_empty() && !right.is_empty());
    cheapest(boxes, splits).unwrap_or_else(|| [ids[..ids.len() / 2].to_vec(), ids[ids.len() / 2..].to_vec()])
}

#[test]
fn sweep_and_bins_are_the_naive_ones() {
    for (name, mut triangles) in inputs() {
        triangles.truncate(300);
        let triangles = working(&triangles);
        let boxes = boxes_of(&triangles);
        let all: Vec<u32> = (0..boxes.len() as u32).collect();
        let built = shape(&NaiveTree::decode(&sah_sweep(&triangles)), 0);
        assert!(built == grow(&all, &|ids| naive_sweep(&boxes, ids)), "sweep, {name}");
        for bins in [8, 13, 32] {
            let built = shape(&NaiveTree::decode(&sah_binned_by(&triangles, Bins::new(bins).unwrap())), 0);
            assert!(built == grow(&all, &|ids| naive_bins(&boxes, ids, bins)), "{bins} bins, {name}");
        }
    }
}

#[test]
fn bins_of_large_parts_are_the_naive_ones() {
    // Enough that threads share bounds, bins and the division into two.
    let triangles = working(&soup(9000, 0.02, 5));
    let boxes = boxes_of(&triangles);
    let all: Vec<u32> = (0..boxes.len() as u32).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let built = pool.install(|| sah_binned_by(&triangles, Bins::MIN));
    assert!(shape(&NaiveTree::decode(&built), 0) == grow(&all, &|ids| naive_bins(&boxes, ids, 8)));
}

#[test]
fn sweep_and_bins_do_not_depend_on_the_threads() {
    let mut scenes = inputs();
    scenes.push(("large", built_in(60_000).triangles));
    scenes.push(("many equal", vec![soup(1, 0.3, 2)[0]; 50_000]));
    scenes.push(("many nested", nested(20_000)));
    for (name, triangles) in scenes {
        let triangles = working(&triangles);
        let (mut first, builders) = (None, [sah_sweep, sah_binned]);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let built = pool.install(|| builders.map(|build| build(&triangles)));
            for nodes in &built {
                valid(nodes, &triangles, name);
            }
            assert!(*first.get_or_insert_with(|| built.clone()) == built, "{name}, {threads} threads");
        }
    }
}

fn cost(nodes: &[Node], triangles: &[Triangle]) -> f64 {
    quality(&valid(nodes, triangles, "built-in"), &Default::default()).sah_cost
}

#[test]
fn better_builders_make_better_trees() {
    let triangles = working(&built_in(30_000).triangles);
    let (sweep, binned) = (cost(&sah_sweep(&triangles), &triangles), cost(&sah_binned(&triangles), &triangles));
    let (lbvh, ploc) = with_devices(|devices| {
        let device = &mut *devices[4].1;
        let lbvh = lbvh(device, &triangles, MortonBits::Sixty).unwrap().0;
        let ploc = ploc(device, &triangles, MortonBits::Sixty, DEFAULT_RADIUS).unwrap().0;
        let costs = [&lbvh, &ploc].map(|tree| cost(&tree.download(device).unwrap(), &triangles));
        lbvh.free(device);
        ploc.free(device);
        (costs[0], costs[1])
    });
    assert!(sweep <= 1.1 * binned && binned < lbvh && ploc < 0.8 * lbvh, "{sweep} {binned} {ploc} {lbvh}");
}

fn initials() -> [Initial; 8] {
    let ploc = |places| Initial::Ploc { radius: radius(places) };
    let atrbvh = Initial::Atrbvh { treelet: TreeletSize::default() };
    let trbvh = Initial::Trbvh { passes: DEFAULT_PASSES };
    let hploc = Initial::Hploc { radius: DEFAULT_HPLOC_RADIUS };
    let binned = Initial::SahBinned { bins: Bins::DEFAULT };
    [Initial::Lbvh, ploc(1), ploc(100), atrbvh, trbvh, hploc, Initial::SahSweep, binned]
}

fn run(scene: &Scene, initial: Initial, device: &mut dyn Device) -> Optimized {
    let settings = Settings::default().with(|s| s.initial = initial);
    optimize(scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn the_optimiser_goes_on_from_every_initial_tree() {
    let folder = tempfile::tempdir().unwrap();
    let small = |(name, triangles): (&'static str, Vec<Triangle>)| {
        Scene::from_triangles(name, triangles.into_iter().take(400).collect()).unwrap()
    };
    let mut scenes: Vec<Scene> = inputs().into_iter().map(small).collect();
    scenes.push(built_in(4000));
    for scene in &scenes {
        for initial in initials() {
            let results = with_devices(|devices| {
                // The CPU in two orders and every GPU.
                let skipped = |k: usize| (1..4).contains(&k);
                let devices = devices.iter_mut().enumerate().filter(|&(k, _)| !skipped(k));
                devices.map(|(_, (_, device))| run(scene, initial.clone(), &mut **device)).collect::<Vec<_>>()
            });
            let result = &results[0];
            let what = format!("{} from {initial}", scene.name);
            let hashes: Vec<String> = results.iter().map(|result| tree_hash(&result.tree)).collect();
            assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{what}: {hashes:?}");
            validate(&result.tree, Some(&scene.triangles)).unwrap();
            // A bound on the depth may take back what the last levels gained.
            let optimised = |done: &Optimized| done.bound.map_or(done.quality.sah_cost, |bound| bound.cost_before);
            assert!(optimised(result) <= result.initial.sah_cost * (1.0 + 1e-6), "{what}");

            // The best tree out of its file is the same tree to start from.
            let path = folder.path().join("best.bvh");
            file::write(&path, &result.tree, &scene.hash).unwrap();
            let again = with_devices(|devices| run(scene, Initial::File { path }, &mut *devices[0].1));
            assert_eq!(again.initial, result.quality, "{what}");
            assert!(optimised(&again) <= again.initial.sah_cost * (1.0 + 1e-6), "{what}");
        }
    }
}

fn refusal(scene: &Scene, path: &std::path::Path) -> String {
    let settings = Settings::default().with(|s| s.initial = Initial::File { path: path.to_owned() });
    with_devices(|devices| {
        let device = &mut *devices[0].1;
        let error = optimize(scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap_err();
        let source = std::error::Error::source(&error).map_or_else(String::new, ToString::to_string);
        format!("{error}: {source}")
    })
}

#[test]
fn a_file_that_is_no_initial_tree_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bvh");
    let scene = Scene::from_triangles("soup", soup(50, 0.1, 1)).unwrap();
    let other = Scene::from_triangles("other", soup(50, 0.1, 2)).unwrap();
    let tree = valid(&sah_sweep(&scene.triangles), &scene.triangles, "soup");

    assert!(refusal(&scene, &path).contains("a.bvh"), "no such file");
    file::write(&path, &tree, &scene.hash).unwrap();
    let text = refusal(&other, &path);
    assert!([&scene.hash, &other.hash].iter().all(|hash| text.contains(*hash)), "{text}");

    // A subtree that became a leaf of several triangles.
    let mut wide = tree.clone();
    wide.nodes.truncate(1);
    wide.nodes[0].content = prbvh::bvh::Content::Leaf { first: 0, count: 50 };
    file::write(&path, &wide, &scene.hash).unwrap();
    assert!(refusal(&scene, &path).contains("50 triangles"), "{}", refusal(&scene, &path));

    // As many as the hash promises, but not as many as the scene has.
    let few = valid(&sah_sweep(&scene.triangles[..20]), &scene.triangles[..20], "few");
    file::write(&path, &few, &scene.hash).unwrap();
    assert!(refusal(&scene, &path).contains("over 20 triangles"), "{}", refusal(&scene, &path));

    let mut bytes = std::fs::read(&path).unwrap();
    bytes[100] ^= 4;
    std::fs::write(&path, bytes).unwrap();
    assert!(refusal(&scene, &path).contains("checksum"), "{}", refusal(&scene, &path));
}

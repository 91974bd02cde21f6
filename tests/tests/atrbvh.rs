//! ATRBVH against a naive one, on every device, on inputs of every kind.

use prbvh::build::{
    DeviceTree, MortonBits, Pass, TreeletSize, UnfitTree, atrbvh, lbvh, ploc, restructure, restructure_unchecked,
    sah_sweep,
};
use prbvh::bvh::{Bvh, quality, tree_hash, validate};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Buffer, Device, DeviceError};
use prbvh::scene::{built_in, load};
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::atrbvh::{LevelsParams, RELATIVE_THRESHOLD, RestructureParams};
use prbvh_kernel::node::{Node, RIGHT};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{APPLIED, FAULT_TREELET, FAULTS, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{Random, inputs, nested, soup, working};
use prbvh_tests::oracle::{NaiveTree, half_area, random_tree};
use prbvh_tests::scenes;
use std::num::NonZeroU32;

fn treelet(leaves: u32) -> TreeletSize {
    TreeletSize::new(leaves).unwrap()
}

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

/// References below each node, and its depth.
fn sizes_and_depths(tree: &NaiveTree) -> (Vec<usize>, Vec<usize>) {
    let mut depths = vec![0; tree.children.len()];
    let mut order = vec![0u32];
    for k in 0..depths.len() {
        let v = order[k] as usize;
        for &child in &tree.children[v] {
            depths[child as usize] = depths[v] + 1;
            order.push(child);
        }
    }
    let mut sizes = vec![1; depths.len()];
    for &v in order.iter().rev() {
        let children = &tree.children[v as usize];
        if !children.is_empty() {
            sizes[v as usize] = children.iter().map(|&child| sizes[child as usize]).sum();
        }
    }
    (sizes, depths)
}

/// Levels of the treelet roots by definition.
fn naive_levels(tree: &NaiveTree, gamma: usize) -> Vec<u32> {
    let (sizes, depths) = sizes_and_depths(tree);
    let mut deepest_first: Vec<usize> = (0..sizes.len()).collect();
    deepest_first.sort_by_key(|&v| std::cmp::Reverse(depths[v]));
    let mut levels = vec![0; sizes.len()];
    for v in deepest_first {
        if sizes[v] >= gamma {
            levels[v] = 1 + tree.children[v].iter().map(|&child| levels[child as usize]).max().unwrap();
        }
    }
    levels
}

/// One treelet by definition: every pair of clusters is looked at before each join.
fn naive_treelet(tree: &mut NaiveTree, root: u32, leaves: usize) -> bool {
    let mut slots = tree.children[root as usize].clone();
    let mut opened = Vec::new();
    while slots.len() < leaves {
        let openable = (0..slots.len()).filter(|&k| !tree.children[slots[k] as usize].is_empty());
        let area = |k: &usize| tree.boxes[slots[*k] as usize].half_area();
        let Some(largest) = openable.min_by(|a, b| area(b).total_cmp(&area(a)).then(a.cmp(b))) else { break };
        let node = slots[largest];
        slots[largest] = tree.children[node as usize][0];
        slots.push(tree.children[node as usize][1]);
        opened.push(node);
    }
    let sum = |boxes: &[Aabb]| boxes.iter().map(half_area).sum::<f64>();
    let old_boxes: Vec<Aabb> = opened.iter().map(|&v| tree.boxes[v as usize]).collect();

    let mut clusters: Vec<Option<(u32, Aabb)>> = slots.iter().map(|&v| Some((v, tree.boxes[v as usize]))).collect();
    let mut joins = Vec::new();
    let mut ids = opened.clone();
    ids.insert(0, root);
    while let Some(id) = ids.pop() {
        let pairs = (0..clusters.len()).flat_map(|high| (0..high).map(move |low| (high, low)));
        let areas = pairs.filter_map(|(high, low)| {
            let (a, b) = (clusters[high]?, clusters[low]?);
            Some((a.1.union(b.1).half_area(), high, low))
        });
        let (_, high, low) = areas.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        let (right, left) = (clusters[high].take().unwrap(), clusters[low].unwrap());
        let aabb = left.1.union(right.1);
        joins.push((id, left.0, right.0, aabb));
        clusters[low] = Some((id, aabb));
    }
    let new_boxes: Vec<Aabb> = joins[..joins.len() - 1].iter().map(|join| join.3).collect();
    let better = sum(&new_boxes) < sum(&old_boxes) * (1.0 - f64::from(RELATIVE_THRESHOLD));
    if better {
        for (id, left, right, aabb) in joins {
            tree.children[id as usize] = vec![left, right];
            tree.boxes[id as usize] = aabb;
        }
    }
    better
}

/// A pass in an order of its own: by depth, the deepest first.
fn naive_pass(tree: &mut NaiveTree, gamma: usize, leaves: usize) -> (u32, u32) {
    let (sizes, depths) = sizes_and_depths(tree);
    let mut roots: Vec<u32> = (0..sizes.len() as u32).filter(|&v| sizes[v as usize] >= gamma).collect();
    roots.sort_by_key(|&v| (std::cmp::Reverse(depths[v as usize]), v));
    let replaced = roots.iter().filter(|&&root| naive_treelet(tree, root, leaves)).count();
    (roots.len() as u32, replaced as u32)
}

fn naive_passes(tree: &mut NaiveTree, leaves: u32) -> Vec<Pass> {
    let n = tree.children.len().div_ceil(2);
    let leaves = (leaves as usize).min(n);
    let mut passes = Vec::new();
    let mut gamma = leaves;
    while n > 2 && gamma <= n {
        let levels = naive_levels(tree, gamma)[0];
        let (treelets, restructured) = naive_pass(tree, gamma, leaves);
        passes.push(Pass { gamma: gamma as u32, treelets, levels, restructured });
        if restructured == 0 {
            break;
        }
        gamma *= 2;
    }
    passes
}

fn valid(nodes: &[Node], triangles: &[Triangle], what: &str) -> Bvh {
    let tree = Bvh::from_device(nodes).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    validate(&tree, Some(triangles)).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    tree
}

fn cost(nodes: &[Node], triangles: &[Triangle], what: &str) -> f64 {
    quality(&valid(nodes, triangles, what), &Default::default()).sah_cost
}

struct Run {
    nodes: Vec<Node>,
    passes: Vec<Pass>,
    /// SAH cost before the first pass and after each.
    costs: Vec<f64>,
}

/// Restructures a copy of `nodes`.
fn run(device: &mut dyn Device, nodes: &[Node], triangles: &[Triangle], leaves: u32) -> Result<Run, DeviceError> {
    let tree = DeviceTree::upload(device, nodes)?;
    let mut costs = vec![cost(nodes, triangles, "before")];
    let result = restructure_unchecked(device, &tree, treelet(leaves), &mut |_, device| {
        costs.push(cost(&tree.download(device).unwrap(), triangles, "after a pass"));
    });
    let nodes = tree.download(device)?;
    tree.free(device);
    result.map(|result| Run { nodes, passes: result.passes, costs })
}

/// Whether each pass lowered the cost if, and only if, it replaced a treelet.
fn costs_fall(passes: &[Pass], costs: &[f64]) -> bool {
    let fell = |(pass, pair): (&Pass, &[f64])| {
        if pass.restructured > 0 { pair[1] < pair[0] } else { pair[1] == pair[0] }
    };
    costs.len() == passes.len() + 1 && passes.iter().zip(costs.windows(2)).all(fell)
}

/// Restructures on every device in every order and compares with the naive passes.
fn check(nodes: &[Node], triangles: &[Triangle], leaves: u32, what: &str) -> Vec<Node> {
    let mut naive = NaiveTree::decode(nodes);
    let expected = naive_passes(&mut naive, leaves);
    let mut first: Option<Vec<Node>> = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let before = device.memory().bytes;
            let Run { nodes: result, passes, costs } = run(&mut **device, nodes, triangles, leaves).unwrap();
            assert_eq!(device.memory().bytes, before, "{what}, {name}: all buffers are given back");
            assert_eq!(passes, expected, "{what}, {name}");
            let has_area = naive.boxes[0].half_area() > 0.0;
            assert!(!has_area || costs_fall(&passes, &costs), "{what}, {name}: {passes:?} {costs:?}");
            let first = first.get_or_insert_with(|| result.clone());
            assert!(bytemuck::cast_slice::<_, u32>(first) == bytemuck::cast_slice::<_, u32>(&result), "{what}, {name}");
        }
    });
    let result = first.expect("there is always the CPU");
    assert!(NaiveTree::decode(&result) == naive, "{what}: another tree than the naive one");
    result
}

#[test]
fn levels_are_those_of_the_definition() {
    for (k, n) in [3usize, 4, 5, 64, 65, 1000].into_iter().enumerate() {
        let tree = random_tree(&boxes_of(&soup(n, 0.2, 1)), k as u64);
        for gamma in [3, 20, 21, 1000].into_iter().filter(|&gamma| gamma <= n) {
            let case =
                Case::new(Kernel::AtrbvhLevels, n as u32, &LevelsParams { count: n as u32, gamma: gamma as u32 });
            let case = case.with(&tree.encode()).zeros(n - 1).zeros(n - 1).zeros(n - 1).zeros(n).zeros(n - 1);
            let result = case.run_everywhere();
            let expected = naive_levels(&tree, gamma);
            assert_eq!(result.get::<u32>("levels"), expected[..n - 1], "{n}, {gamma}");
            assert_eq!(result.get::<u32>("order"), (0..n as u32 - 1).collect::<Vec<_>>());
            let (sizes, _) = sizes_and_depths(&tree);
            assert!(result.get::<u32>("sizes").iter().zip(&sizes).all(|(&have, &need)| have as usize == need));
            let counts = result.get::<u32>("counts");
            assert_eq!(counts[0], expected[0]);
            for (level, &count) in (0..).zip(&counts).skip(1) {
                let have = expected.iter().filter(|&&of| of == level).count();
                assert_eq!(count as usize, have, "{n}, {gamma}, level {level}");
            }
        }
    }
}

fn restructure_case(nodes: &[Node], roots: &[u32], leaves: u32) -> Case {
    let internal = nodes.len() as u32 / 2;
    let params = RestructureParams { count: roots.len() as u32, first: 2, treelet: leaves, internal };
    let order: Vec<u32> = [u32::MAX; 2].into_iter().chain(roots.iter().copied()).collect();
    Case::new(Kernel::AtrbvhRestructure, params.count, &params).with(&order).with(nodes).zeros(REPORT_WORDS as usize)
}

#[test]
fn a_treelet_is_clustered_as_the_naive_one() {
    let mut replaced = 0;
    for seed in 0..60 {
        let n = 3 + (seed as usize * 7) % 60;
        let tree = random_tree(&boxes_of(&soup(n, 0.2, seed)), seed);
        for leaves in [3, 4, 7, 20, 31, 32] {
            let mut expected = tree.clone();
            let better = naive_treelet(&mut expected, 0, leaves);
            let result = restructure_case(&tree.encode(), &[0], leaves as u32).run_everywhere();
            let report = result.get::<u32>("report");
            assert_eq!((report[APPLIED], report[FAULTS]), (u32::from(better), 0), "seed {seed}, {leaves} leaves");
            let nodes = result.get::<Node>("nodes");
            assert!(NaiveTree::decode(&nodes) == expected, "seed {seed}, {leaves} leaves");
            let (before, after) = (tree.internal_area(), expected.internal_area());
            assert!(if better { after < before } else { after == before }, "{before} {after}");
            replaced += u32::from(better);
        }
    }
    assert!(replaced > 100, "only {replaced} treelets were replaced");
}

#[test]
fn the_naive_treelet_tells_other_treelets_apart() {
    let tree = random_tree(&boxes_of(&soup(60, 0.2, 1)), 1);
    let clustered = |leaves| {
        let mut tree = tree.clone();
        assert!(naive_treelet(&mut tree, 0, leaves));
        tree
    };
    assert_ne!(clustered(20), clustered(19));
    let mut swapped = clustered(20);
    swapped.children[0].swap(0, 1);
    assert_ne!(clustered(20), swapped);
}

#[test]
fn no_box_breaks_a_treelet() {
    let mut random = Random(3);
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 0.0, -0.0, 1.0, 1e-40];
    for seed in 0..20 {
        let mut tree = random_tree(&boxes_of(&soup(40, 0.2, seed)), seed);
        for aabb in &mut tree.boxes {
            let mut corner = || [0; 3].map(|_| values[random.bits() as usize % values.len()]);
            *aabb = Aabb { min: corner(), max: corner() };
        }
        let case = restructure_case(&tree.encode(), &[0], 20);
        with_devices(|devices| {
            for (name, device) in devices {
                let result = case.run_on(&mut **device).unwrap();
                // Panics if the links are no tree any more.
                let _ = NaiveTree::decode(&result.get::<Node>("nodes"));
                assert_eq!(result.get::<u32>("report")[FAULTS], 0, "{name}");
            }
        });
    }
}

#[test]
fn passes_are_the_naive_ones_on_every_input() {
    for (name, triangles) in inputs() {
        let triangles = working(&triangles);
        let nodes = with_devices(|devices| {
            let device = &mut *devices[0].1;
            let (tree, _) = lbvh(device, &triangles, MortonBits::Sixty).unwrap();
            let nodes = tree.download(device).unwrap();
            tree.free(device);
            nodes
        });
        for leaves in [4, 7, 20, 32] {
            let result = check(&nodes, &triangles, leaves, &format!("{name}, {leaves} leaves"));
            if triangles.len() < 3 {
                assert_eq!(result, nodes, "{name}");
            }
        }
    }
}

#[test]
fn fewer_triangles_than_a_treelet_are_one_treelet() {
    for n in 1..=33 {
        let triangles = working(&soup(n, 0.3, n as u64));
        let tree = random_tree(&boxes_of(&triangles), 7);
        let mut expected = tree.clone();
        let result = check(&tree.encode(), &triangles, 32, &format!("{n} triangles"));
        if (3..=32).contains(&n) {
            naive_treelet(&mut expected, 0, n);
            assert!(NaiveTree::decode(&result) == expected, "{n} triangles");
        }
    }
}

#[test]
fn a_chain_is_restructured_level_by_level() {
    // Each internal node has a leaf and the rest below it: as many levels as a tree can have, in several submissions.
    let triangles = working(&nested(1200));
    let boxes = boxes_of(&triangles);
    let n = boxes.len();
    let mut tree = random_tree(&boxes, 1);
    for v in 0..n - 1 {
        let rest = if v + 2 < n { v + 1 } else { 2 * n - 2 };
        tree.children[v] = vec![(n - 1 + v) as u32, rest as u32];
    }
    // The smallest triangles hang near the root, so that every box is about the largest.
    tree.refit(0);
    let dear = tree.encode();
    let result = check(&dear, &triangles, 20, "a dear chain");
    let (before, after) = (cost(&dear, &triangles, "before"), cost(&result, &triangles, "after"));
    assert!(after < 0.9 * before, "{before} {after}");
    // The other way round there is nothing to gain, which the first pass finds.
    tree.boxes[n - 1..].reverse();
    tree.references[n - 1..].reverse();
    tree.refit(0);
    let cheap = tree.encode();
    assert_eq!(check(&cheap, &triangles, 20, "a cheap chain"), cheap);
}

#[test]
fn the_comparer_of_costs_finds_a_pass_that_does_not_lower_them() {
    let pass = |restructured| Pass { gamma: 20, treelets: 5, levels: 2, restructured };
    assert!(costs_fall(&[pass(3), pass(0)], &[9.0, 8.0, 8.0]));
    assert!(!costs_fall(&[pass(3), pass(0)], &[9.0, 9.0, 9.0]));
    assert!(!costs_fall(&[pass(3), pass(0)], &[9.0, 8.0, 7.0]));
    assert!(!costs_fall(&[pass(3)], &[9.0, 10.0]));
    assert!(!costs_fall(&[pass(3)], &[9.0]));
}

#[test]
fn links_that_are_no_tree_are_refused() {
    let triangles = working(&soup(100, 0.1, 1));
    let mut broken = random_tree(&boxes_of(&triangles), 1).encode();
    // A leaf that climbs to another parent.
    let leaf = broken.len() - 1;
    broken[leaf].up = broken[leaf - 1].up | RIGHT;
    with_devices(|devices| {
        for (name, device) in devices {
            let device = &mut **device;
            let before = device.memory().bytes;
            let tree = DeviceTree::upload(device, &broken).unwrap();
            let refused = restructure(device, &tree, treelet(20), &mut |_, _| {}).unwrap_err();
            assert!(matches!(refused, UnfitTree::Broken { .. }), "{name}: {refused}");
            let error = restructure_unchecked(device, &tree, treelet(20), &mut |_, _| {}).unwrap_err();
            tree.free(device);
            assert_eq!(device.memory().bytes, before, "{name}");
            assert!(error.to_string().contains("not every leaf reached the root"), "{name}: {error}");
        }
    });
}

/// A device that says it ended the work on a treelet early.
struct Hasty(CpuDevice);

impl device::Layer for Hasty {
    fn inner(&self) -> &dyn Device {
        &self.0
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.0
    }

    fn download_from(&mut self, buffer: &Buffer, first: usize, bytes: &mut [u8]) -> Result<(), DeviceError> {
        self.0.download_from(buffer, first, bytes)?;
        if buffer.label == "report" {
            bytes[4 * FAULTS..][..4].copy_from_slice(&FAULT_TREELET.to_ne_bytes());
        }
        Ok(())
    }
}

#[test]
fn a_treelet_that_was_not_finished_is_an_error() {
    let triangles = working(&soup(100, 0.1, 1));
    let mut device = Hasty(CpuDevice::new(1).unwrap());
    let error = atrbvh(&mut device, &triangles, MortonBits::Sixty, treelet(20)).unwrap_err();
    assert!(error.to_string().contains("before it was done"), "{error}");
    assert_eq!(device.memory().bytes, 0, "all buffers are given back");
}

/// Costs of LBVH and of ATRBVH on it, the same on the parallel CPU and every GPU.
fn costs(triangles: &[Triangle], what: &str) -> (f64, f64) {
    let triangles = working(triangles);
    let mut results = Vec::new();
    let mut initial = 0.0;
    with_devices(|devices| {
        for (name, device) in
            devices.iter_mut().filter(|(name, _)| !name.starts_with("CPU") || name.contains("Parallel"))
        {
            let device = &mut **device;
            let (tree, _, passes) = atrbvh(device, &triangles, MortonBits::Sixty, TreeletSize::default()).unwrap();
            let nodes = tree.download(device).unwrap();
            tree.free(device);
            results.push((tree_hash(&valid(&nodes, &triangles, name)), passes, cost(&nodes, &triangles, name)));
            let (tree, _) = lbvh(device, &triangles, MortonBits::Sixty).unwrap();
            initial = cost(&tree.download(device).unwrap(), &triangles, name);
            tree.free(device);
        }
    });
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{what}: {results:?}");
    (initial, results[0].2)
}

#[test]
fn real_scenes_cost_much_less_than_their_lbvh() {
    let (initial, last) = costs(&built_in(30_000).triangles, "built-in");
    assert!(last < 0.75 * initial, "built-in: {initial} {last}");
    for path in scenes::shared() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let most = match name.split('.').next().unwrap() {
            "sponza_dabrovic" => 0.72,
            "bunny" => 0.92,
            _ => continue,
        };
        let (initial, last) = costs(&load(&path).unwrap().triangles, &name);
        eprintln!("{name}: LBVH {initial:.1}, ATRBVH {last:.1}, ratio {:.3}", last / initial);
        assert!(last < most * initial, "{name}: {initial} {last}");
    }
}

#[test]
fn any_tree_can_be_restructured() {
    let triangles = working(&built_in(4000).triangles);
    let starts = with_devices(|devices| {
        let device = &mut *devices[4].1;
        let (tree, _, _) = ploc(device, &triangles, MortonBits::Sixty, NonZeroU32::new(2).unwrap()).unwrap();
        let nodes = tree.download(device).unwrap();
        tree.free(device);
        [("ploc", nodes), ("sweep", sah_sweep(&triangles)), ("random", random_tree(&boxes_of(&triangles), 1).encode())]
    });
    for (name, nodes) in starts {
        let result = check(&nodes, &triangles, 20, name);
        let (before, after) = (cost(&nodes, &triangles, name), cost(&result, &triangles, name));
        assert!(after < before, "{name}: {before} {after}");
    }
}

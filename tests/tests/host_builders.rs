//! The builders of the host with parameters: against exhaustive and naive ones, on inputs of every kind, and as starts of the optimiser.

use prbvh::build::{MOST_AGGLOMERATED, MortonBits, lbvh};
use prbvh::bvh::{Bvh, quality, tree_hash, validate};
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{Initial, Settings, build_on_host, optimize};
use prbvh::scene::{Scene, built_in};
use prbvh::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::best_tree::least_area_by_subsets;
use prbvh_tests::fixtures::{Random, inputs, nested, soup, working};
use prbvh_tests::oracle::{NaiveTree, half_area};
use std::collections::BTreeSet;
use std::ops::ControlFlow;

const BUILDERS: [&str; 9] = [
    "agglomerative",
    "aac:fast",
    "aac:hq",
    "insertion:greedy",
    "insertion",
    "online",
    "hunt:cut=50",
    "phr:fast",
    "phr:hq",
];

fn initial(name: &str) -> Initial {
    Initial::of_name(name).unwrap_or_else(|| panic!("no builder {name}")).unwrap()
}

fn built(name: &str, triangles: &[Triangle]) -> Vec<Node> {
    build_on_host(&initial(name), triangles, None).unwrap().unwrap()
}

fn valid(nodes: &[Node], triangles: &[Triangle], what: &str) -> Bvh {
    let tree = Bvh::from_device(nodes).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    validate(&tree, Some(triangles)).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    tree
}

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

#[test]
fn no_tree_is_better_than_the_best_of_all_and_most_are_near_it() {
    // What the exhaustive search finds, for a tree that is easy to see: two pairs far from each other.
    let at = |x: f32| Aabb { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] };
    let pairs = [at(0.0), at(100.0), at(1.0), at(101.0)];
    assert!((least_area_by_subsets(&pairs) - (5.0 + 5.0 + (102.0 * 2.0 + 1.0))).abs() < 1e-9);

    for name in BUILDERS {
        let (mut sum, mut trees) = (0.0, 0);
        for (n, seed) in (2..=8).flat_map(|n| (0..12).map(move |seed| (n, seed))) {
            let triangles = working(&soup(n, 0.4, seed));
            let nodes = built(name, &triangles);
            valid(&nodes, &triangles, name);
            let ratio = NaiveTree::decode(&nodes).internal_area() / least_area_by_subsets(&boxes_of(&triangles));
            assert!(ratio > 1.0 - 1e-6, "{name}: {ratio} of the best of {n}");
            // Of three there are three trees, and these look at all of them.
            let looks_at_all = ["agglomerative", "aac:hq", "insertion", "online"].contains(&name);
            assert!(n > 3 || !looks_at_all || ratio < 1.0 + 1e-6, "{name}: {ratio} of the best of {n}");
            sum += ratio;
            trees += 1;
        }
        let mean = sum / f64::from(trees);
        assert!(mean < 1.12, "{name}: {mean} of the best on average");
    }
}

/// Exact agglomeration with every pair looked at each time.
fn naive_agglomeration(boxes: &[Aabb]) -> BTreeSet<Vec<u32>> {
    let mut clusters: Vec<(Aabb, Vec<u32>)> = (0..).zip(boxes).map(|(k, &aabb)| (aabb, vec![k])).collect();
    let mut all = BTreeSet::new();
    while clusters.len() > 1 {
        let pairs = (0..clusters.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let area = |(i, j): (usize, usize)| clusters[i].0.union(clusters[j].0).half_area();
        let (i, j) = pairs.min_by(|&a, &b| area(a).total_cmp(&area(b))).unwrap();
        let (aabb, mut references) = clusters.swap_remove(j);
        references.extend(&clusters[i].1);
        references.sort_unstable();
        all.insert(references.clone());
        clusters[i] = (clusters[i].0.union(aabb), references);
    }
    all
}

#[test]
fn the_exact_agglomeration_is_the_naive_one() {
    for seed in 0..6 {
        let triangles = working(&soup(90, 0.1, seed));
        let tree = NaiveTree::decode(&built("agglomerative", &triangles)).clades();
        assert!(tree == naive_agglomeration(&boxes_of(&triangles)), "seed {seed}");
        // A list that holds all references is no approximation.
        assert!(tree == NaiveTree::decode(&built("aac:delta=91,epsilon=0", &triangles)).clades());
        assert!(tree != NaiveTree::decode(&built("aac:fast", &triangles)).clades());
    }
}

/// The order in which references are inserted.
fn insertion_order(count: u32, seed: u64) -> Vec<u32> {
    let mut random = Random(seed);
    let mut order: Vec<u32> = (0..count).collect();
    for k in (1..count).rev() {
        order.swap(k as usize, (((random.bits() >> 32) * u64::from(k + 1)) >> 32) as usize);
    }
    order
}

/// A tree that grows at any node, with boxes computed from the leaves each time.
enum Grown {
    Leaf(u32),
    Pair(Box<[Self; 2]>),
}

impl Grown {
    fn aabb(&self, boxes: &[Aabb]) -> Aabb {
        match self {
            Self::Leaf(k) => boxes[*k as usize],
            Self::Pair(pair) => pair[0].aabb(boxes).union(pair[1].aabb(boxes)),
        }
    }

    fn beside(self, leaf: u32) -> Self {
        Self::Pair(Box::new([self, Self::Leaf(leaf)]))
    }

    /// Inserts as Goldsmith & Salmon: along the way to the child that grows least, where it costs least in all.
    fn greedy(self, boxes: &[Aabb], leaf: u32) -> Self {
        let aabb = boxes[leaf as usize];
        let mut way = Vec::new();
        let mut costs = Vec::new();
        let (mut node, mut induced) = (&self, 0.0);
        loop {
            let own = node.aabb(boxes);
            let with = half_area(&own.union(aabb));
            costs.push(induced + with);
            induced += with - half_area(&own);
            let Self::Pair(pair) = node else { break };
            let growth = |side: usize| {
                let own = pair[side].aabb(boxes);
                let off = |k: usize| f64::from((own.min[k] + own.max[k]) - (aabb.min[k] + aabb.max[k])).powi(2);
                (half_area(&own.union(aabb)) - half_area(&own), off(0) + off(1) + off(2))
            };
            let side = usize::from(growth(1) < growth(0));
            way.push(side);
            node = &pair[side];
        }
        let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
        let depth = costs.iter().rposition(|&cost| cost <= least * (1.0 + 1e-9)).unwrap();
        self.insert(&way[..depth], leaf)
    }

    fn insert(self, way: &[usize], leaf: u32) -> Self {
        match (way, self) {
            ([side, rest @ ..], Self::Pair(pair)) => {
                let mut pair = *pair;
                let old = std::mem::replace(&mut pair[*side], Self::Leaf(u32::MAX));
                pair[*side] = old.insert(rest, leaf);
                Self::Pair(Box::new(pair))
            }
            (_, here) => here.beside(leaf),
        }
    }

    fn clades(&self, all: &mut BTreeSet<Vec<u32>>) -> Vec<u32> {
        match self {
            Self::Leaf(k) => vec![*k],
            Self::Pair(pair) => {
                let mut references = pair[0].clades(all);
                references.extend(pair[1].clades(all));
                references.sort_unstable();
                all.insert(references.clone());
                references
            }
        }
    }
}

#[test]
fn greedy_insertion_is_the_naive_one() {
    for seed in 0..6 {
        let triangles = working(&soup(80, 0.15, seed));
        let boxes = boxes_of(&triangles);
        let order = insertion_order(80, seed + 40);
        let first = Grown::Leaf(order[0]).beside(order[1]);
        let grown = order[2..].iter().fold(first, |tree, &leaf| tree.greedy(&boxes, leaf));
        let mut expected = BTreeSet::new();
        grown.clades(&mut expected);
        let of_seed =
            |seed| NaiveTree::decode(&built(&format!("insertion:most_steps=0,seed={seed}"), &triangles)).clades();
        assert!(of_seed(seed + 40) == expected, "seed {seed}");
        assert!(of_seed(seed + 41) != expected, "the order is a matter of the seed");
    }
}

#[test]
fn every_size_has_its_tree() {
    for n in [1, 2, 3, 4, 5, 7, 8, 9, 16, 17, 63, 64, 65, 1024, 1025] {
        let triangles = working(&soup(n, 0.1, 3));
        for name in BUILDERS {
            let nodes = built(name, &triangles);
            assert_eq!(nodes.len(), 2 * n - 1);
            valid(&nodes, &triangles, &format!("{name}, {n}"));
        }
    }
    for name in BUILDERS {
        assert!(build_on_host(&initial(name), &[], None).unwrap().is_none(), "{name}");
    }
}

/// Those that find the best tree over boxes that lie in each other, which takes them off one by one.
const CHAINS: [&str; 3] = ["agglomerative", "insertion", "online"];

/// As deep as `most` at the most, on every builder but those that are to find a chain.
fn depths(what: &str, triangles: &[Triangle], most: u32) {
    let triangles = working(triangles);
    for name in BUILDERS {
        let few = if name == "agglomerative" { &triangles[..triangles.len().min(4000)] } else { &triangles[..] };
        let tree = valid(&built(name, few), few, &format!("{what}, {name}"));
        let depth = quality(&tree, &Default::default()).max_depth;
        let is_chain = CHAINS.contains(&name) && what == "boxes in boxes";
        assert!(depth <= most || is_chain, "{what}, {name}: {depth} levels");
    }
}

#[test]
fn bad_input_makes_no_deep_trees_and_takes_no_long_time() {
    // 2^16 < 70,000.
    depths("equal boxes", &vec![soup(1, 0.3, 2)[0]; 70_000], 64);
    depths(
        "three of each",
        &built_in(2000).triangles.iter().flat_map(|triangle| [*triangle; 3]).collect::<Vec<_>>(),
        100,
    );

    let mut beside = soup(4000, 1e-4, 8);
    for triangle in &mut beside {
        let near = |p: [f32; 3]| p.map(|x| x * 1e-3);
        *triangle = Triangle { a: near(triangle.a), b: near(triangle.b), c: near(triangle.c) };
    }
    beside.push(Triangle { a: [1e6; 3], b: [1e6 + 1.0, 1e6, 1e6], c: [1e6, 1e6 + 1.0, 1e6] });
    depths("a cluster beside one triangle", &beside, 200);

    let series = |k: usize| {
        let (at, size) = (1.02f32.powi(k as i32), 0.01 * 1.02f32.powi(k as i32));
        Triangle { a: [at, at, 0.0], b: [at + size, at, 0.0], c: [at, at + size, size] }
    };
    depths("a geometric series", &(0..2000).map(series).collect::<Vec<_>>(), 400);
    depths("boxes in boxes", &nested(5000), 1000);
}

#[test]
fn inputs_of_every_kind_have_valid_trees() {
    for (what, triangles) in inputs() {
        // Of any size, and in the safe range.
        for triangles in [triangles.clone(), working(&triangles)] {
            for name in BUILDERS {
                valid(&built(name, &triangles), &triangles, &format!("{what}, {name}"));
            }
        }
    }
}

#[test]
fn trees_do_not_depend_on_the_threads() {
    let pools = [1, 2, 5].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    for triangles in [built_in(20_000).triangles, vec![soup(1, 0.3, 2)[0]; 9000], nested(9000)] {
        let triangles = working(&triangles);
        for name in ["aac:fast", "aac:hq", "hunt:cut=50", "phr:fast"] {
            let trees = pools.each_ref().map(|pool| pool.install(|| built(name, &triangles)));
            assert!(trees.windows(2).all(|pair| pair[0] == pair[1]), "{name}");
        }
    }
}

#[test]
fn what_takes_longer_is_better() {
    let scene = built_in(20_000);
    let triangles = working(&scene.triangles);
    let cost = |nodes: &[Node]| quality(&valid(nodes, &triangles, "built-in"), &Default::default()).sah_cost;
    let mut device = CpuDevice::new(2).unwrap();
    let (tree, _) = lbvh(&mut device, &triangles, MortonBits::Sixty).unwrap();
    let lbvh = cost(&tree.download(&mut device).unwrap());
    let of = |name: &str| cost(&built(name, &triangles));
    for [worse, better] in [
        ["aac:fast", "aac:hq"],
        ["insertion:greedy", "insertion"],
        ["insertion", "online"],
        ["hunt:cut=10", "hunt"],
        ["phr:fast", "phr:hq"],
    ] {
        let costs = [of(worse), of(better)];
        assert!(costs[1] <= 1.01 * costs[0], "{worse}, {better}: {costs:?}");
        assert!(costs[1] < 0.9 * lbvh, "{better}: {costs:?}, LBVH {lbvh}");
    }
}

#[test]
fn the_optimiser_goes_on_from_each() {
    let mut hashes = BTreeSet::new();
    for scene in [built_in(2500), Scene::from_triangles("copies", soup(40, 0.1, 4).repeat(9)).unwrap()] {
        for name in BUILDERS {
            let settings = Settings::default().with(|s| s.initial = initial(name));
            let run = |threads| {
                let mut device = CpuDevice::new(threads).unwrap();
                optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
            };
            let [one, two] = [run(1), run(2)];
            assert_eq!(tree_hash(&one.tree), tree_hash(&two.tree), "{name}");
            validate(&one.tree, Some(&scene.triangles)).unwrap();
            assert!(one.optimized_cost() <= one.initial.sah_cost * (1.0 + 1e-6), "{name}");
            assert_eq!(one.build_timings[0].label, "build on the host");
            hashes.insert((scene.name.clone(), format!("{:?}", one.initial)));
        }
    }
    assert!(hashes.len() > 12, "the builders make different trees: {}", hashes.len());
}

#[test]
fn an_end_that_is_asked_for_leaves_no_tree() {
    let stop = Stop::default();
    let triangles = working(&soup(500, 0.1, 1));
    for name in BUILDERS {
        assert!(build_on_host(&initial(name), &triangles, Some(&stop)).unwrap().is_some(), "{name}");
    }
    stop.ask();
    for name in BUILDERS {
        assert!(build_on_host(&initial(name), &triangles, Some(&stop)).unwrap().is_none(), "{name}");
    }
    // What no host builds.
    assert!(build_on_host(&Initial::Lbvh, &triangles, None).unwrap().is_none());
}

#[test]
fn the_exact_agglomeration_of_too_many_is_refused() {
    let triangles = vec![soup(1, 0.3, 2)[0]; MOST_AGGLOMERATED + 1];
    let scene = Scene::from_triangles("many", triangles).unwrap();
    let mut settings = Settings::default().with(|s| s.initial = Initial::Agglomerative);
    let run = |settings: &Settings| {
        let mut device = CpuDevice::new(1).unwrap();
        optimize(&scene, &mut device, settings, &mut |_| ControlFlow::Continue(())).map_err(|error| error.to_string())
    };
    let error = run(&settings).unwrap_err();
    assert!(error.starts_with("initial is agglomerative over 32769 references, but must be"), "{error}");
    // One of them is none too many.
    settings.fold_duplicates = true;
    assert_eq!(run(&settings).unwrap().tree.triangle_order.len(), MOST_AGGLOMERATED + 1);
}

//! H-PLOC against a naive one and the best of all trees, on every device, on inputs of every kind.

use prbvh::build::{DEFAULT_HPLOC_RADIUS, DEFAULT_RADIUS, MortonBits, hploc, lbvh, ploc};
use prbvh::bvh::{Bvh, Quality, quality, tree_hash, validate};
use prbvh::device::{Device, DeviceError};
use prbvh::scene::built_in;
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::hploc::{HplocParams, KEPT};
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::best_tree::least_internal_area;
use prbvh_tests::devices::{cpu_devices, with_devices};
use prbvh_tests::fixtures::{inputs, nested, soup, working};
use prbvh_tests::oracle::NaiveTree;
use prbvh_tests::planted::{Planted, change};
use std::num::NonZeroU32;

fn radius(places: u32) -> NonZeroU32 {
    NonZeroU32::new(places).unwrap()
}

fn measured(nodes: &[Node], triangles: &[Triangle], what: &str) -> (Bvh, Quality) {
    let tree = Bvh::from_device(nodes).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    validate(&tree, Some(triangles)).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    let quality = quality(&tree, &Default::default());
    (tree, quality)
}

fn built(device: &mut dyn Device, triangles: &[Triangle], places: u32) -> Vec<Node> {
    let before = device.memory().bytes;
    let (tree, _) = hploc(device, triangles, MortonBits::Sixty, radius(places)).unwrap();
    let nodes = tree.download(device).unwrap();
    tree.free(device);
    assert_eq!(device.memory().bytes, before, "all buffers are given back");
    nodes
}

/// The tree that every device makes.
fn everywhere(triangles: &[Triangle], places: u32, what: &str) -> Vec<Node> {
    let mut first: Option<Vec<Node>> = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let nodes = built(&mut **device, triangles, places);
            let words = bytemuck::cast_slice::<Node, u32>;
            assert!(words(first.get_or_insert_with(|| nodes.clone())) == words(&nodes), "{what}, {name}");
        }
    });
    first.expect("there is always the CPU")
}

/// A tree without numbers.
#[derive(Clone, Debug, PartialEq)]
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

/// A round of PLOC by definition.
fn round(clusters: Vec<(Shape, Aabb)>, radius: usize) -> Vec<(Shape, Aabb)> {
    let nearest = |i: usize| {
        let near = i.saturating_sub(radius)..=(i + radius).min(clusters.len() - 1);
        let area = |j: usize| clusters[i].1.union(clusters[j].1).half_area();
        near.filter(|&j| j != i).min_by(|&a, &b| area(a).total_cmp(&area(b)).then((i ^ a).cmp(&(i ^ b)))).unwrap()
    };
    let nearest: Vec<usize> = (0..clusters.len()).map(nearest).collect();
    let mut next = Vec::new();
    for (i, (shape, aabb)) in clusters.iter().enumerate() {
        let j = nearest[i];
        if nearest[j] != i {
            next.push((shape.clone(), *aabb));
        } else if i < j {
            let pair = Shape::Node(Box::new((shape.clone(), clusters[j].0.clone())));
            next.push((pair, aabb.union(clusters[j].1)));
        }
    }
    next
}

/// The clusters of a node of the radix tree.
fn naive(radix: &NaiveTree, v: u32, radius: usize) -> Vec<(Shape, Aabb)> {
    let [left, right] = radix.children[v as usize][..] else {
        return vec![(Shape::Leaf(radix.references[v as usize]), radix.boxes[v as usize])];
    };
    let mut clusters = naive(radix, left, radius);
    clusters.extend(naive(radix, right, radius));
    while clusters.len() > if v == 0 { 1 } else { KEPT as usize } {
        clusters = round(clusters, radius);
    }
    clusters
}

fn radix_tree(triangles: &[Triangle]) -> NaiveTree {
    with_devices(|devices| {
        let device = &mut *devices[0].1;
        let (tree, _) = lbvh(device, triangles, MortonBits::Sixty).unwrap();
        let nodes = tree.download(device).unwrap();
        tree.free(device);
        NaiveTree::decode(&nodes)
    })
}

#[test]
fn it_is_the_naive_one_on_every_device() {
    let mut inputs = inputs();
    for n in [4, 5, 7, 8, 9, 16, 17, 32, 33, 64, 65, 1024, 1025] {
        inputs.push(("soup", soup(n, 0.1, n as u64)));
    }
    inputs.push(("three times", soup(150, 0.1, 3).into_iter().flat_map(|t| [t; 3]).collect()));
    for (name, mut triangles) in inputs {
        triangles.truncate(1025);
        let triangles = working(&triangles);
        let radix = radix_tree(&triangles);
        for places in [1, 8, 1000] {
            let what = format!("{name}, {} triangles, radius {places}", triangles.len());
            let nodes = everywhere(&triangles, places, &what);
            measured(&nodes, &triangles, &what);
            let expected = naive(&radix, 0, places as usize);
            assert!(shape(&NaiveTree::decode(&nodes), 0) == expected[0].0, "{what}");
        }
    }
}

#[test]
fn the_naive_one_tells_other_trees_apart() {
    let triangles = working(&soup(500, 0.1, 2));
    let radix = radix_tree(&triangles);
    let [narrow, wide] = [1, 8].map(|radius| naive(&radix, 0, radius).remove(0).0);
    assert!(narrow != wide && shape(&radix, 0) != wide);
}

#[test]
fn few_boxes_cost_little_more_than_the_best_tree() {
    let mut ratios = Vec::new();
    for n in 2..=8 {
        for seed in 0..8 {
            let triangles = working(&soup(n, 0.3, seed));
            let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
            let nodes = with_devices(|devices| built(&mut *devices[4].1, &triangles, 31));
            let ratio = NaiveTree::decode(&nodes).internal_area() / least_internal_area(&boxes);
            assert!(ratio > 1.0 - 1e-6 && (n > 2 || ratio < 1.0 + 1e-6) && ratio < 1.5, "{n}, {seed}: {ratio}");
            ratios.push(ratio);
        }
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!(mean < 1.05, "{mean}");
}

/// Most links above a leaf, on the parallel CPU and every GPU, which make the same tree.
fn depths(triangles: &[Triangle], what: &str) -> u32 {
    let triangles = working(triangles);
    let mut results = Vec::new();
    with_devices(|devices| {
        for (name, device) in devices.iter_mut().skip(4) {
            let nodes = built(&mut **device, &triangles, DEFAULT_HPLOC_RADIUS.get());
            let (tree, quality) = measured(&nodes, &triangles, name);
            results.push((tree_hash(&tree), quality.max_depth));
        }
    });
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{what}: {results:?}");
    results[0].1
}

#[test]
fn equal_boxes_make_a_balanced_tree() {
    let one = soup(1, 0.3, 2)[0];
    assert_eq!(depths(&vec![one; 4096], "equal"), 12);
    let depth = depths(&vec![one; 70_000], "many equal");
    assert!((17..=24).contains(&depth), "{depth}");
    // PLOC, too.
    let triangles = working(&vec![one; 4096]);
    with_devices(|devices| {
        for (name, device) in devices.iter_mut().skip(4) {
            let device = &mut **device;
            let (tree, _, _) = ploc(device, &triangles, MortonBits::Sixty, DEFAULT_RADIUS).unwrap();
            let nodes = tree.download(device).unwrap();
            tree.free(device);
            assert_eq!(measured(&nodes, &triangles, name).1.max_depth, 12, "{name}");
        }
    });
}

#[test]
fn the_depth_is_bounded_on_unkind_inputs() {
    // A merge a round adds at most 16 levels to a level of the radix tree.
    let mut dense = soup(20_000, 1e-5, 3);
    for t in &mut dense {
        *t = Triangle { a: t.a.map(|x| 1e-3 * x), b: t.b.map(|x| 1e-3 * x), c: t.c.map(|x| 1e-3 * x) };
    }
    dense.push(Triangle { a: [1e5, 0.0, 0.0], b: [1e5, 1.0, 0.0], c: [1e5, 0.0, 1.0] });
    let series = (0..60)
        .map(|k| {
            let s = 1.5f32.powi(k);
            Triangle { a: [s, 0.0, 0.0], b: [1.2 * s, 0.1 * s, 0.0], c: [s, 0.0, 0.2 * s] }
        })
        .collect();
    for (what, triangles) in [("dense beside far", dense), ("series", series), ("nested", nested(20_000))] {
        let depth = depths(&triangles, what);
        eprintln!("{what}: {depth}");
        assert!(depth <= 400, "{what}: {depth}");
    }
}

#[test]
fn a_hall_costs_less_than_its_lbvh_and_about_as_much_as_by_ploc() {
    let triangles = working(&built_in(20_000).triangles);
    with_devices(|devices| {
        let device = &mut *devices[4].1;
        let costs = [
            hploc(device, &triangles, MortonBits::Sixty, DEFAULT_HPLOC_RADIUS).unwrap().0,
            ploc(device, &triangles, MortonBits::Sixty, DEFAULT_HPLOC_RADIUS).unwrap().0,
            lbvh(device, &triangles, MortonBits::Sixty).unwrap().0,
        ]
        .map(|tree| {
            let nodes = tree.download(device).unwrap();
            tree.free(device);
            measured(&nodes, &triangles, "hall").1.sah_cost
        });
        eprintln!("H-PLOC, PLOC, LBVH: {costs:?}");
        assert!(costs[0] < 0.85 * costs[2] && (costs[0] / costs[1] - 1.0).abs() < 0.1, "{costs:?}");
    });
}

#[test]
fn climbs_that_do_not_end_are_an_error() {
    let triangles = working(&soup(100, 0.1, 1));
    let (_, device) = cpu_devices().pop().unwrap();
    let mut device = Planted::new(device, |dispatch, device| {
        if dispatch.kernel == Kernel::HplocStage {
            change(device, &dispatch.buffers[7], |waiting: &mut [u32]| waiting[0] = 1)?;
        }
        Ok(())
    });
    let error = hploc(&mut device, &triangles, MortonBits::Sixty, DEFAULT_HPLOC_RADIUS).unwrap_err();
    assert!(matches!(error, DeviceError::Kernel { .. }) && error.to_string().contains("are not over"), "{error}");
    assert_eq!(device.memory().bytes, 0, "all buffers are given back");
    assert_eq!(size_of::<HplocParams>(), Kernel::HplocStage.info().push_bytes);
}

//! k-means against a naive one, on every device, on inputs of every kind.

use prbvh::build::{KMeansSettings, MortonBits, kmeans, lbvh};
use prbvh::bvh::{Bvh, quality, validate};
use prbvh::device::Device;
use prbvh::scene::built_in;
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::kmeans::{CHUNK, HalveParams, PER_CLUSTER};
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::trace::random::hash;
use prbvh_tests::devices::{cpu_devices, with_devices};
use prbvh_tests::fixtures::{Random, inputs, nested, soup, working};
use prbvh_tests::oracle::{NaiveTree, half_area};
use prbvh_tests::planted::{Planted, change};
use std::collections::BTreeSet;

fn settings(k: u32, p: u32, i: u32) -> KMeansSettings {
    KMeansSettings::default().with(|s| (s.k, s.p, s.i) = (k, p, i))
}

fn valid(nodes: &[Node], triangles: &[Triangle], what: &str) -> Bvh {
    let tree = Bvh::from_device(nodes).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    validate(&tree, Some(triangles)).unwrap_or_else(|faults| panic!("{what}: {faults:?}"));
    tree
}

fn built(device: &mut dyn Device, triangles: &[Triangle], settings: &KMeansSettings) -> Vec<Node> {
    let before = device.memory().bytes;
    let (tree, _) = kmeans(device, triangles, MortonBits::Sixty, settings).unwrap();
    let nodes = tree.download(device).unwrap();
    tree.free(device);
    assert_eq!(device.memory().bytes, before, "all buffers are given back");
    nodes
}

/// The tree that every device makes.
fn everywhere(triangles: &[Triangle], settings: &KMeansSettings, what: &str) -> Vec<Node> {
    let mut first: Option<Vec<Node>> = None;
    with_devices(|devices| {
        for (name, device) in devices {
            let nodes = built(&mut **device, triangles, settings);
            let words = bytemuck::cast_slice::<Node, u32>;
            assert!(words(first.get_or_insert_with(|| nodes.clone())) == words(&nodes), "{what}, {name}");
        }
    });
    first.expect("there is always the CPU")
}

/// References in Morton order.
fn morton_order(triangles: &[Triangle]) -> Vec<u32> {
    with_devices(|devices| {
        let device = &mut *devices[0].1;
        let (tree, _) = lbvh(device, triangles, MortonBits::Sixty).unwrap();
        let nodes = tree.download(device).unwrap();
        tree.free(device);
        nodes[triangles.len() - 1..].iter().map(|leaf| leaf.down).collect()
    })
}

/// A box as six whole numbers.
type Point = [u64; 6];

fn distance(a: &Point, b: &Point) -> u64 {
    (0..6).map(|k| a[k].abs_diff(b[k]).pow(2)).sum()
}

/// The first of the nearest. Squares are rounded as those of the device are where they are large.
fn nearest(centres: &[Point], point: &Point) -> usize {
    (0..centres.len()).min_by_key(|&j| (distance(&centres[j], point), j)).unwrap()
}

/// k-means by definition.
struct Naive {
    boxes: Vec<Aabb>,
    settings: KMeansSettings,
    seed: u32,
    /// References below each internal node.
    clades: BTreeSet<Vec<u32>>,
}

impl Naive {
    fn of(triangles: &[Triangle], settings: KMeansSettings) -> BTreeSet<Vec<u32>> {
        let boxes = triangles.iter().map(Triangle::aabb).collect();
        let seed = (Random(settings.seed).bits() >> 32) as u32;
        let mut naive = Self { boxes, settings, seed, clades: BTreeSet::new() };
        naive.grow(&morton_order(triangles), 0);
        naive.clades
    }

    fn aabb(&self, references: &[u32]) -> Aabb {
        references.iter().map(|&k| self.boxes[k as usize]).reduce(Aabb::union).unwrap()
    }

    /// The references as points of a frame around them.
    fn points(&self, references: &[u32]) -> Vec<Point> {
        let all = self.aabb(references);
        let extent = (0..3).map(|k| all.max[k] - all.min[k]).fold(0.0, f32::max);
        let scale = 2f64.powi(21 - f64::from(extent).log2().floor() as i32);
        let point = |&reference: &u32| {
            let Aabb { min, max } = self.boxes[reference as usize];
            std::array::from_fn(|k| {
                let corner = if k < 3 { min[k] } else { max[k - 3] };
                (f64::from(corner - all.min[k % 3]) * scale) as u64
            })
        };
        references.iter().map(point).collect()
    }

    /// Makes the subtree of the references from place `start` on. Returns them in the order of its leaves.
    fn grow(&mut self, references: &[u32], start: u32) -> Vec<u32> {
        let n = references.len();
        let k = self.settings.k as usize;
        let is_large = n >= PER_CLUSTER as usize * k;
        let ordered = match n {
            1 => return references.to_vec(),
            2 => references.to_vec(),
            _ if is_large => self.join(references, k, start),
            _ => {
                let (references, left) = self.halves(references, start);
                let mut ordered = self.grow(&references[..left], start);
                ordered.extend(self.grow(&references[left..], start + left as u32));
                ordered
            }
        };
        self.note(&ordered);
        ordered
    }

    fn note(&mut self, references: &[u32]) {
        let mut clade = references.to_vec();
        clade.sort_unstable();
        self.clades.insert(clade);
    }

    fn centres(&self, points: &[Point], k: usize, start: u32) -> Vec<Point> {
        let n = points.len() as u32;
        let key = hash(hash(self.seed ^ start).wrapping_add(n));
        let draw = |number: u32| points[(hash(key.wrapping_add(number.wrapping_mul(0x9e37_79b9))) % n) as usize];
        let mut centres = vec![draw(0)];
        for centre in 1..k as u32 {
            let first = 1 + (centre - 1) * self.settings.p;
            let far = |number: &u32| centres.iter().map(|centre| distance(centre, &draw(*number))).min().unwrap();
            let farthest = (first..first + self.settings.p).rev().max_by_key(far).unwrap();
            centres.push(draw(farthest));
        }
        centres
    }

    fn clustered(&self, points: &[Point], k: usize, start: u32) -> Vec<usize> {
        let mut centres = self.centres(points, k, start);
        for _ in 0..self.settings.i {
            let labels: Vec<usize> = points.iter().map(|point| nearest(&centres, point)).collect();
            for (j, centre) in centres.iter_mut().enumerate() {
                let own: Vec<&Point> = (0..points.len()).filter(|&i| labels[i] == j).map(|i| &points[i]).collect();
                if !own.is_empty() {
                    *centre = std::array::from_fn(|k| own.iter().map(|point| point[k]).sum::<u64>() / own.len() as u64);
                }
            }
        }
        points.iter().map(|point| nearest(&centres, point)).collect()
    }

    /// Joins the clusters of a large part, and makes the subtrees of these.
    fn join(&mut self, references: &[u32], k: usize, start: u32) -> Vec<u32> {
        let labels = self.clustered(&self.points(references), k, start);
        let members =
            |j: usize| (0..references.len()).filter(|&i| labels[i] == j).map(|i| references[i]).collect::<Vec<u32>>();
        let mut held: Vec<(Aabb, Vec<Vec<u32>>)> = (0..k)
            .map(members)
            .filter(|members| !members.is_empty())
            .map(|members| (self.aabb(&members), vec![members]))
            .collect();
        assert!(held.len() > 1, "no part of these scenes has all in one cluster");
        let mut pairs = Vec::new();
        while held.len() > 1 {
            let all = (0..held.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
            let area = |&(a, b): &(usize, usize)| half_area(&held[a].0.union(held[b].0));
            let (a, b) = all.min_by(|x, y| area(x).total_cmp(&area(y))).unwrap();
            let (aabb, clusters) = held.remove(b);
            held[a].0 = held[a].0.union(aabb);
            held[a].1.extend(clusters);
            pairs.push(held[a].1.concat());
        }
        let mut ordered = Vec::new();
        for cluster in held.pop().unwrap().1 {
            let begin = start + ordered.len() as u32;
            ordered.extend(self.grow(&cluster, begin));
        }
        pairs.iter().for_each(|pair| self.note(pair));
        ordered
    }

    /// The references of a small part in the order in which a partition in place leaves them, and how many are left.
    fn halves(&self, references: &[u32], start: u32) -> (Vec<u32>, usize) {
        let labels = self.clustered(&self.points(references), 2, start);
        let mut rest: Vec<(u32, usize)> = references.iter().copied().zip(labels).collect();
        let (mut low, mut high) = (Vec::new(), Vec::new());
        let mut at = 0;
        while at < rest.len() {
            if rest[at].1 == 0 {
                low.push(rest[at].0);
                at += 1;
            } else {
                high.push(rest[at].0);
                let last = rest.pop().unwrap();
                if at < rest.len() {
                    rest[at] = last;
                }
            }
        }
        let left = if low.is_empty() || high.is_empty() { references.len() / 2 } else { low.len() };
        high.reverse();
        low.extend(high);
        (low, left)
    }
}

#[test]
fn trees_are_those_of_a_naive_one() {
    for (n, k, p, i) in
        [(5, 2, 1, 0), (90, 2, 3, 4), (700, 4, 3, 2), (1500, 8, 5, 0), (3000, 16, 5, 5), (300, 64, 30, 3)]
    {
        let triangles = working(&soup(n, 0.1, u64::from(k)));
        let settings = settings(k, p, i);
        let tree = NaiveTree::decode(&everywhere(&triangles, &settings, "soup")).clades();
        let expected = Naive::of(&triangles, settings);
        assert_eq!(expected.len(), n - 1);
        let alike = tree.intersection(&expected).count();
        assert_eq!(alike, n - 1, "{n} references, {settings:?}");
        // A planted fault: another seed.
        let other = Naive::of(&triangles, settings.with(|s| s.seed = 2));
        assert!(n < 10 || tree != other, "{settings:?}");
    }
}

#[test]
fn every_size_and_every_kind_of_input_has_its_tree() {
    let most = CHUNK as usize + 1;
    for n in [1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 63, 64, 65, most] {
        let triangles = working(&soup(n, 0.1, 3));
        for settings in [settings(2, 2, 2), settings(4, 5, 1), KMeansSettings::Q3] {
            let what = format!("{n}, {settings}");
            valid(&everywhere(&triangles, &settings, &what), &triangles, &what);
        }
    }
    for (what, triangles) in inputs() {
        let triangles = working(&triangles);
        valid(&everywhere(&triangles, &settings(4, 5, 2), what), &triangles, what);
    }
}

#[test]
fn bad_input_makes_no_deep_trees() {
    let depth = |triangles: &[Triangle], settings: &KMeansSettings, what: &str| {
        let triangles = working(triangles);
        let (_, mut device) = cpu_devices().pop().unwrap();
        let nodes = built(&mut *device, &triangles, settings);
        quality(&valid(&nodes, &triangles, what), &Default::default()).max_depth
    };
    // 2^16 < 70,000.
    assert!(depth(&vec![soup(1, 0.3, 2)[0]; 70_000], &KMeansSettings::Q2, "equal boxes") <= 18);
    let thrice: Vec<Triangle> = built_in(2000).triangles.iter().flat_map(|triangle| [*triangle; 3]).collect();
    assert!(depth(&thrice, &KMeansSettings::Q3, "three of each") <= 60);
    let mut beside: Vec<Triangle> = soup(4000, 1e-4, 8);
    beside.push(Triangle { a: [1e9; 3], b: [1e9 + 1e3, 1e9, 1e9], c: [1e9, 1e9 + 1e3, 1e9] });
    assert!(depth(&beside, &KMeansSettings::Q3, "dense beside far") <= 60);
    assert!(depth(&nested(5000), &KMeansSettings::Q3, "boxes in boxes") <= 1000);
}

#[test]
fn more_rounds_and_clusters_make_better_trees() {
    let triangles = working(&built_in(20_000).triangles);
    let (_, mut device) = cpu_devices().pop().unwrap();
    let mut cost = |settings: &KMeansSettings| {
        let nodes = built(&mut *device, &triangles, settings);
        quality(&valid(&nodes, &triangles, "hall"), &Default::default()).sah_cost
    };
    let costs = [KMeansSettings::Q1, KMeansSettings::Q3, KMeansSettings::Q5].map(|settings| cost(&settings));
    eprintln!("Q1, Q3, Q5: {costs:?}");
    // The first rounds bring most.
    assert!(costs[1] < 0.9 * costs[0] && costs[2] < 1.02 * costs[1], "{costs:?}");
}

#[test]
fn small_parts_that_do_not_end_and_bad_settings_are_errors() {
    let triangles = working(&soup(100, 0.1, 1));
    let (_, device) = cpu_devices().pop().unwrap();
    let mut device = Planted::new(device, |dispatch, device| {
        if dispatch.kernel == Kernel::KmeansHalve {
            change(device, &dispatch.buffers[7], |waiting: &mut [u32]| waiting[0] = 1)?;
        }
        Ok(())
    });
    let mut refused = |settings: KMeansSettings| {
        kmeans(&mut device, &triangles, MortonBits::Sixty, &settings).map(|_| ()).unwrap_err().to_string()
    };
    let error = refused(settings(4, 5, 2));
    assert!(error.contains("1 parts are not done"), "{error}");
    let error = refused(settings(65, 5, 2));
    assert!(error.contains("kmeans.k is 65, but must be 2 to 64"), "{error}");
    assert_eq!(device.memory().bytes, 0, "all buffers are given back");
    assert_eq!(size_of::<HalveParams>(), Kernel::KmeansHalve.info().push_bytes);
}

//! k-means (Meister & Bittner 2016, *Parallel BVH Construction Using k-means Clustering*): from the top down each part becomes up to `k` clusters of boxes
//! that are alike, and these become a binary subtree by agglomeration.
//!
//! A box is a point of six coordinates, its smallest and its largest corner (§3.1). The means are sums of whole numbers, so that no order of adding
//! changes them.

use super::clusters::{Cluster, Clusters};
use super::top_down::{Part, SERIAL, in_range, top_down};
use crate::check::{SettingError, must};
use crate::parameters::parameters;
use crate::random::Random;
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use std::sync::Arc;

/// Settings of [`kmeans`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct KMeansSettings {
    /// Clusters of a part, 2 to 256.
    pub k: u32,
    /// References that are drawn for each centre after the first: the one farthest from the centres before it is taken. 1 to 65,536.
    pub p: u32,
    /// Rounds in which the centres become the means of their clusters; 0: the clusters are those of the first centres.
    pub i: u32,
    /// Seed of the draws.
    pub seed: u64,
}

impl KMeansSettings {
    /// As published, the fastest first.
    pub const Q1: Self = Self { k: 8, p: 5, i: 0, seed: 1 };
    /// See [`Self::Q1`].
    pub const Q2: Self = Self { i: 2, ..Self::Q1 };
    /// See [`Self::Q1`].
    pub const Q3: Self = Self { k: 16, i: 5, ..Self::Q1 };
    /// See [`Self::Q1`].
    pub const Q4: Self = Self { k: 32, p: 20, i: 10, ..Self::Q1 };
    /// See [`Self::Q1`].
    pub const Q5: Self = Self { k: 64, p: 30, i: 15, ..Self::Q1 };

    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that makes none.
    pub fn check(&self) -> Result<(), SettingError> {
        must("kmeans.k", self.k, (2..=256).contains(&self.k), "2 to 256")?;
        must("kmeans.p", self.p, (1..=1 << 16).contains(&self.p), "1 to 65536")
    }
}

impl Default for KMeansSettings {
    fn default() -> Self {
        Self::Q3
    }
}

parameters!(
    KMeansSettings,
    known "q1, q2, q3, q4, q5, k=N, p=N, i=N, seed=N",
    presets { "q1" => Self::Q1, "q2" => Self::Q2, "q3" => Self::Q3, "q4" => Self::Q4, "q5" => Self::Q5, "" => Self::default() },
    k, p, i, seed
);

/// Parts of fewer references per cluster are split in two instead.
const LEAST_PER_CLUSTER: usize = 4;

/// Deepest level of clusters; parts below it are halved. Only made-up inputs come so far.
const MOST_LEVELS: u32 = 64;

/// Largest coordinate of a point as a whole number: sums of 2^31 have 62 bits.
const FINEST: f64 = 2_147_483_647.0;

/// Builds a tree of one triangle per leaf on the CPU by k-means, with all threads of the current rayon pool; the tree does not depend on their number.
/// Returns `nodes[2n-1]` for [`DeviceTree::upload`](super::DeviceTree::upload), numbered depth-first. `triangles` are finite and of any size.
///
/// Of equally near centres the first is taken. References whose boxes are all the same are halved in their order.
/// Of no triangles there is no tree, and no nodes.
///
/// # Errors
/// If a setting makes no sense.
pub fn kmeans(triangles: &[Triangle], settings: &KMeansSettings) -> Result<Vec<Node>, SettingError> {
    settings.check()?;
    Ok(kmeans_until(triangles, settings, None).unwrap_or_default())
}

/// [`kmeans`] with settings that make sense; none of no triangles, or if an end was asked for.
pub(crate) fn kmeans_until(
    triangles: &[Triangle],
    settings: &KMeansSettings,
    stop: Option<&Stop>,
) -> Option<Vec<Node>> {
    if triangles.is_empty() {
        return None;
    }
    let boxes: Vec<Aabb> = in_range(triangles).par_iter().map(Triangle::aabb).collect();
    let mut ids: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut spare = vec![0; boxes.len()];
    let (ids, spare) = (&mut ids[..], &mut spare[..]);
    top_down(Means { boxes: &boxes, settings, ids, spare, start: 0, level: 0, subtree: None }, triangles, stop)
}

/// A box as a point.
type Point = [f32; 6];

fn point(aabb: &Aabb) -> Point {
    let Aabb { min: [a, b, c], max: [d, e, f] } = *aabb;
    [a, b, c, d, e, f]
}

/// Squared.
fn distance(a: &Point, b: &Point) -> f32 {
    let mut sum = 0.0;
    for k in 0..6 {
        let d = a[k] - b[k];
        sum += d * d;
    }
    sum
}

/// References, and the binary subtree over clusters of them that is being walked down.
struct Means<'a> {
    boxes: &'a [Aabb],
    settings: &'a KMeansSettings,
    ids: &'a mut [u32],
    spare: &'a mut [u32],
    /// Place of the first one among all.
    start: usize,
    /// Levels of clusters above.
    level: u32,
    subtree: Option<Subtree>,
}

/// A place in a binary tree over clusters, whose references lie in the order of its leaves.
#[derive(Clone)]
struct Subtree {
    pairs: Arc<[Pair]>,
    at: usize,
}

/// Two of a binary tree over clusters.
struct Pair {
    /// References of the left one.
    left: usize,
    /// Those that are pairs, by their places.
    children: [Option<usize>; 2],
}

impl Means<'_> {
    /// Makes clusters and puts the references in the order of the binary tree over these. None where all boxes are the same.
    fn cluster(&mut self) -> Option<Subtree> {
        if self.level >= MOST_LEVELS {
            return None;
        }
        let (k, labels) = self.labels()?;
        let mut sizes = vec![0usize; k];
        let mut boxes = vec![Aabb::EMPTY; k];
        for (&id, &label) in self.ids.iter().zip(&labels) {
            let label = usize::from(label);
            sizes[label] += 1;
            boxes[label] = boxes[label].union(self.boxes[id as usize]);
        }
        let mut joined: Vec<[u32; 2]> = Vec::with_capacity(k);
        let taken = (0..k).filter(|&label| sizes[label] > 0);
        let mut clusters = Clusters::new(taken.map(|label| Cluster::of(label as u32, boxes[label])));
        if clusters.len() < 2 {
            return None;
        }
        clusters.merge_down(1, |a, b| {
            joined.push([a, b]);
            Some((k + joined.len() - 1) as u32)
        })?;
        let (pairs, order) = subtree(k as u32, &joined, &sizes);

        // Where the references of each cluster begin.
        let mut places = vec![0; k];
        let mut next = 0;
        for label in order {
            places[label] = next;
            next += sizes[label];
        }
        for (&id, &label) in self.ids.iter().zip(&labels) {
            let place = &mut places[usize::from(label)];
            self.spare[*place] = id;
            *place += 1;
        }
        self.ids.copy_from_slice(self.spare);
        Some(Subtree { pairs: pairs.into(), at: 0 })
    }

    /// How many clusters there may be, and the one of each reference. None where all boxes are the same.
    fn labels(&self) -> Option<(usize, Vec<u8>)> {
        let n = self.ids.len();
        let origin = self.smallest();
        let largest = self.fold(
            |sum: Point, p| std::array::from_fn(|k| sum[k].max(p[k] - origin[k])),
            [0.0; 6],
            |a, b| std::array::from_fn(|k| a[k].max(b[k])),
        );
        let extent = largest.into_iter().fold(0.0, f32::max);
        if extent <= 0.0 {
            return None;
        }
        let k = self.settings.k as usize;
        let k = if n < LEAST_PER_CLUSTER * k { 2 } else { k };
        let mut centres = self.first_centres(k);
        let mut labels = vec![0; n];
        self.assign(&centres, &mut labels);
        let scale = FINEST / f64::from(extent);
        for _ in 0..self.settings.i {
            let sums = self.sums(&labels, k, &origin, scale);
            for (centre, (sum, count)) in centres.iter_mut().zip(sums) {
                if count > 0 {
                    let mean = |k: usize| f64::from(origin[k]) + sum[k] as f64 / count as f64 / scale;
                    *centre = std::array::from_fn(|k| mean(k) as f32);
                }
            }
            if !self.assign(&centres, &mut labels) {
                break;
            }
        }
        Some((k, labels))
    }

    /// Each is drawn from the part; after the first the one of `p` that is farthest from those before it.
    fn first_centres(&self, k: usize) -> Vec<Point> {
        let n = self.ids.len() as u32;
        // A part has a start and a length that no other one has.
        let place = (self.start as u64) << 32 | u64::from(n);
        let mut random = Random::new(Random::new(self.settings.seed ^ place).bits());
        let mut draw = || point(&self.boxes[self.ids[random.below(n) as usize] as usize]);
        let mut centres = vec![draw()];
        while centres.len() < k {
            let mut farthest = (draw(), f32::NEG_INFINITY);
            for candidate in 0..self.settings.p {
                let drawn = if candidate == 0 { farthest.0 } else { draw() };
                let nearest = centres.iter().map(|centre| distance(centre, &drawn)).fold(f32::INFINITY, f32::min);
                if nearest > farthest.1 {
                    farthest = (drawn, nearest);
                }
            }
            centres.push(farthest.0);
        }
        centres
    }

    /// Gives each reference the nearest centre, the first of equal ones. Whether one changed.
    fn assign(&self, centres: &[Point], labels: &mut [u8]) -> bool {
        let assign = |(ids, labels): (&[u32], &mut [u8])| {
            let mut is_changed = false;
            for (&id, label) in ids.iter().zip(labels) {
                let point = point(&self.boxes[id as usize]);
                let mut nearest = (0, f32::INFINITY);
                for (k, centre) in centres.iter().enumerate() {
                    let distance = distance(centre, &point);
                    if distance < nearest.1 {
                        nearest = (k as u8, distance);
                    }
                }
                is_changed |= *label != nearest.0;
                *label = nearest.0;
            }
            is_changed
        };
        if self.ids.len() < 2 * SERIAL {
            return assign((self.ids, labels));
        }
        self.ids.par_chunks(SERIAL).zip(labels.par_chunks_mut(SERIAL)).map(assign).reduce(|| false, |a, b| a | b)
    }

    /// Sums of the points of each cluster, in whole steps of `1/scale` from the origin, and how many they are.
    fn sums(&self, labels: &[u8], k: usize, origin: &Point, scale: f64) -> Vec<([u64; 6], u64)> {
        let sum = |(ids, labels): (&[u32], &[u8])| {
            let mut sums = vec![([0u64; 6], 0u64); k];
            for (&id, &label) in ids.iter().zip(labels) {
                let point = point(&self.boxes[id as usize]);
                let (sum, count) = &mut sums[usize::from(label)];
                *count += 1;
                for k in 0..6 {
                    sum[k] += ((f64::from(point[k]) - f64::from(origin[k])) * scale) as u64;
                }
            }
            sums
        };
        let add = |mut a: Vec<([u64; 6], u64)>, b: Vec<([u64; 6], u64)>| {
            for (a, b) in a.iter_mut().zip(b) {
                a.1 += b.1;
                a.0.iter_mut().zip(b.0).for_each(|(a, b)| *a += b);
            }
            a
        };
        if self.ids.len() < 2 * SERIAL {
            return sum((self.ids, labels));
        }
        let none = || vec![([0; 6], 0); k];
        self.ids.par_chunks(SERIAL).zip(labels.par_chunks(SERIAL)).map(sum).reduce(none, add)
    }

    /// Smallest coordinates of the points.
    fn smallest(&self) -> Point {
        let smaller = |a: Point, b: Point| std::array::from_fn(|k| a[k].min(b[k]));
        self.fold(|sum, p| smaller(sum, *p), [f32::INFINITY; 6], smaller)
    }

    /// Folds the points; `fold` and `merge` are of a kind that asks for no order.
    fn fold(
        &self,
        fold: impl Fn(Point, &Point) -> Point + Sync,
        start: Point,
        merge: impl Fn(Point, Point) -> Point + Sync + Send,
    ) -> Point {
        let of = |ids: &[u32]| ids.iter().fold(start, |sum, &id| fold(sum, &point(&self.boxes[id as usize])));
        if self.ids.len() < 2 * SERIAL {
            return of(self.ids);
        }
        self.ids.par_chunks(SERIAL).map(of).reduce(|| start, merge)
    }
}

/// The pairs of a binary tree depth-first, and its clusters from left to right. Numbers below `k` are clusters, `k` and above those of `joined`, the last
/// of which is the root.
fn subtree(k: u32, joined: &[[u32; 2]], sizes: &[usize]) -> (Vec<Pair>, Vec<usize>) {
    let mut references = sizes.to_vec();
    for &[a, b] in joined {
        references.push(references[a as usize] + references[b as usize]);
    }
    let mut pairs: Vec<Pair> = Vec::with_capacity(joined.len());
    let mut order = Vec::with_capacity(joined.len() + 1);
    let mut pending = vec![(k + joined.len() as u32 - 1, None)];
    while let Some((number, above)) = pending.pop() {
        if number < k {
            order.push(number as usize);
            continue;
        }
        let place = pairs.len();
        if let Some((parent, side)) = above {
            let parent: &mut Pair = &mut pairs[parent];
            parent.children[side] = Some(place);
        }
        let [left, right] = joined[(number - k) as usize];
        pairs.push(Pair { left: references[left as usize], children: [None; 2] });
        pending.extend([(right, Some((place, 1))), (left, Some((place, 0)))]);
    }
    (pairs, order)
}

impl Part for Means<'_> {
    fn len(&self) -> usize {
        self.ids.len()
    }

    fn first(&self) -> u32 {
        self.ids[0]
    }

    fn split(mut self) -> (Self, Self) {
        if self.subtree.is_none() {
            self.subtree = self.cluster();
            self.level += 1;
        }
        let Self { boxes, settings, ids, spare, start, level, subtree } = self;
        let pair = subtree.as_ref().map(|subtree| &subtree.pairs[subtree.at]);
        let left = pair.map_or(ids.len() / 2, |pair| pair.left);
        let below = |side: usize| {
            let at = pair?.children[side]?;
            subtree.as_ref().map(|subtree| Subtree { at, ..subtree.clone() })
        };
        let subtrees = [below(0), below(1)];
        let (ids, spare) = (ids.split_at_mut(left), spare.split_at_mut(left));
        let [first, second] = subtrees;
        (
            Self { boxes, settings, ids: ids.0, spare: spare.0, start, level, subtree: first },
            Self { boxes, settings, ids: ids.1, spare: spare.1, start: start + left, level, subtree: second },
        )
    }
}

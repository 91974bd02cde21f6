//! Binned SAH (Wald 2007): splits between equally wide bins of the centres.

use super::top_down::{Part, SERIAL, Split, in_range, stable_partition, top_down};
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// Bins of an axis.
const BINS: usize = 32;

/// Builds a tree of one triangle per leaf on the CPU, with all threads of the current rayon pool; the tree does not depend on their
/// number. Returns `nodes[2n-1]` for [`DeviceTree::upload`](super::DeviceTree::upload). `triangles` are finite and of any size: the splits are
/// those of their [working coordinates](crate::scene::SafeRange).
///
/// The 32 bins of each axis span the centres of the part's boxes. Of equally good splits the one closest to the middle is taken, then the
/// first axis. References whose centres are all the same are halved in their order.
/// Of no triangles there is no tree, and no nodes.
#[must_use]
pub fn sah_binned(triangles: &[Triangle]) -> Vec<Node> {
    binned_until(triangles, None).unwrap_or_default()
}

/// [`sah_binned`]; none of no triangles, or if an end was asked for.
pub(crate) fn binned_until(triangles: &[Triangle], stop: Option<&Stop>) -> Option<Vec<Node>> {
    if triangles.is_empty() {
        return None;
    }
    let split = in_range(triangles);
    let boxes: Vec<Aabb> = split.par_iter().map(Triangle::aabb).collect();
    let mut ids: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut spare = vec![0; boxes.len()];
    top_down(Binned { boxes: &boxes, ids: &mut ids, spare: &mut spare }, triangles, stop)
}

struct Binned<'a> {
    boxes: &'a [Aabb],
    ids: &'a mut [u32],
    spare: &'a mut [u32],
}

/// Twice the centre: the factor changes no split.
fn centre(aabb: &Aabb) -> [f32; 3] {
    [0, 1, 2].map(|axis| aabb.min[axis] + aabb.max[axis])
}

/// What lies in a bin.
#[derive(Clone, Copy)]
struct Bin {
    aabb: Aabb,
    references: usize,
}

impl Bin {
    const EMPTY: Self = Self { aabb: Aabb::EMPTY, references: 0 };

    fn union(self, other: Self) -> Self {
        Self { aabb: self.aabb.union(other.aabb), references: self.references + other.references }
    }
}

type Bins = [[Bin; BINS]; 3];

/// Where the bins of each axis lie.
#[derive(Clone, Copy)]
struct Grid {
    origin: [f32; 3],
    /// Bins per unit; 0 where all centres are the same.
    scale: [f32; 3],
}

impl Grid {
    fn of(centres: &Aabb) -> Self {
        let scale = |axis: usize| {
            let extent = centres.max[axis] - centres.min[axis];
            if extent > 0.0 { BINS as f32 / extent } else { 0.0 }
        };
        Self { origin: centres.min, scale: [scale(0), scale(1), scale(2)] }
    }

    /// Grows with the coordinate. The smallest centre is in bin 0, the largest in the last one.
    fn bin(&self, axis: usize, coordinate: f32) -> usize {
        (((coordinate - self.origin[axis]) * self.scale[axis]) as usize).min(BINS - 1)
    }
}

impl Binned<'_> {
    /// Maps chunks of references, on several threads where it is worth it, and folds the results in order.
    fn map_chunks<T: Send>(&self, map: impl Fn(&[u32]) -> T + Sync + Send, fold: impl Fn(T, T) -> T) -> T {
        let mapped: Vec<T> = if self.ids.len() < 2 * SERIAL {
            vec![map(self.ids)]
        } else {
            self.ids.par_chunks(SERIAL).map(&map).collect()
        };
        mapped.into_iter().reduce(fold).expect("a part has references")
    }

    fn centres(&self) -> Aabb {
        let map = |ids: &[u32]| {
            let points = ids.iter().map(|&id| centre(&self.boxes[id as usize]));
            points.fold(Aabb::EMPTY, |sum, point| sum.union(Aabb { min: point, max: point }))
        };
        self.map_chunks(map, Aabb::union)
    }

    fn bins(&self, grid: &Grid) -> Bins {
        let map = |ids: &[u32]| {
            let mut bins = [[Bin::EMPTY; BINS]; 3];
            for &id in ids {
                let aabb = self.boxes[id as usize];
                for (axis, coordinate) in centre(&aabb).into_iter().enumerate() {
                    let bin = &mut bins[axis][grid.bin(axis, coordinate)];
                    *bin = bin.union(Bin { aabb, references: 1 });
                }
            }
            bins
        };
        let fold = |mut sum: Bins, bins: Bins| {
            for (sum, bin) in sum.iter_mut().flatten().zip(bins.iter().flatten()) {
                *sum = sum.union(*bin);
            }
            sum
        };
        self.map_chunks(map, fold)
    }
}

/// The best split between two bins, and the first bin on its right; none where one bin holds all.
fn best_split(bins: &[Bin; BINS], references: usize) -> Option<(Split, usize)> {
    let mut right = [Bin::EMPTY; BINS];
    let mut sum = Bin::EMPTY;
    for k in (1..BINS).rev() {
        sum = sum.union(bins[k]);
        right[k] = sum;
    }
    let mut best: Option<(Split, usize)> = None;
    let mut left = Bin::EMPTY;
    for k in 1..BINS {
        left = left.union(bins[k - 1]);
        if left.references > 0 && right[k].references > 0 {
            let areas = (left.aabb.half_area(), right[k].aabb.half_area());
            let split = Split::new(areas.0, areas.1, left.references, references);
            if best.is_none_or(|(best, _)| split.beats(&best, references)) {
                best = Some((split, k));
            }
        }
    }
    best
}

impl Part for Binned<'_> {
    fn len(&self) -> usize {
        self.ids.len()
    }

    fn first(&self) -> u32 {
        self.ids[0]
    }

    fn split(self) -> (Self, Self) {
        let n = self.ids.len();
        let grid = Grid::of(&self.centres());
        let mut best = Split::worst(n);
        let mut place = None;
        for (axis, bins) in self.bins(&grid).iter().enumerate() {
            if let Some((split, bin)) = best_split(bins, n)
                && split.beats(&best, n)
            {
                best = split;
                place = Some((axis, bin));
            }
        }
        let boxes = self.boxes;
        let left = match place {
            Some((axis, bin)) => {
                stable_partition(self.ids, self.spare, |id| grid.bin(axis, centre(&boxes[id as usize])[axis]) < bin)
            }
            None => best.left,
        };
        let (ids, spare) = (self.ids.split_at_mut(left), self.spare.split_at_mut(left));
        (Self { boxes, ids: ids.0, spare: spare.0 }, Self { boxes, ids: ids.1, spare: spare.1 })
    }
}

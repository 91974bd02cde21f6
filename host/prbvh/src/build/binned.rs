//! Binned SAH (Wald 2007): splits between equally wide bins of the centres.

use super::Bins;
use super::top_down::{Part, SERIAL, Split, in_range, stable_partition, top_down};
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::math::{max, min};
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// Room for the bins of an axis.
const MOST: usize = Bins::MAX.get() as usize;

/// Parts of so few references are sorted by their bins: fewer steps than there are bins.
const FEW: usize = 16;

/// Builds a tree of one triangle per leaf on the CPU, with all threads of the current rayon pool; the tree does not depend on their
/// number. Returns `nodes[2n-1]` for [`DeviceTree::upload`](super::DeviceTree::upload). `triangles` are finite and of any size: the splits are
/// those of their [working coordinates](crate::scene::SafeRange).
///
/// The 32 bins of each axis span the centres of the part's boxes. Of equally good splits the one closest to the middle is taken, then the
/// first axis. References whose centres are all the same are halved in their order.
/// Of no triangles there is no tree, and no nodes.
#[must_use]
pub fn sah_binned(triangles: &[Triangle]) -> Vec<Node> {
    sah_binned_by(triangles, Bins::DEFAULT)
}

/// [`sah_binned`] with another number of bins.
#[must_use]
pub fn sah_binned_by(triangles: &[Triangle], bins: Bins) -> Vec<Node> {
    binned_until(triangles, bins, None).unwrap_or_default()
}

/// [`sah_binned_by`]; none of no triangles, or if an end was asked for.
pub(crate) fn binned_until(triangles: &[Triangle], bins: Bins, stop: Option<&Stop>) -> Option<Vec<Node>> {
    if triangles.is_empty() {
        return None;
    }
    let mut references: Vec<Reference> = {
        let split = in_range(triangles);
        split.par_iter().zip(0u32..split.len() as u32).map(|(t, id)| Reference::of(&t.aabb(), id)).collect()
    };
    let mut spare = references.clone();
    let centres = centres(&references);
    let part = Binned { bins: bins.get() as usize, references: &mut references, spare: &mut spare, centres };
    top_down(part, triangles, stop)
}

/// Corners of a box, or a range of points, as four numbers each, of which the last is 0: the ordinary compiler makes one instruction of a union's four.
#[derive(Clone, Copy)]
struct Corners {
    min: [f32; 4],
    max: [f32; 4],
}

impl Corners {
    const EMPTY: Self = Self { min: [f32::INFINITY; 4], max: [f32::NEG_INFINITY; 4] };

    fn at(point: [f32; 4]) -> Self {
        Self { min: point, max: point }
    }

    fn union(self, other: Self) -> Self {
        let mut all = self;
        for k in 0..4 {
            all.min[k] = min(self.min[k], other.min[k]);
            all.max[k] = max(self.max[k], other.max[k]);
        }
        all
    }

    fn half_area(&self) -> f32 {
        let ([a, b, c, _], [d, e, f, _]) = (self.min, self.max);
        Aabb { min: [a, b, c], max: [d, e, f] }.half_area()
    }
}

/// A box stays with its reference: whoever goes over a part goes over one piece of memory.
#[derive(Clone, Copy)]
struct Reference {
    min: [f32; 3],
    id: u32,
    max: [f32; 3],
    zero: f32,
}

impl Reference {
    fn of(aabb: &Aabb, id: u32) -> Self {
        Self { min: aabb.min, id, max: aabb.max, zero: 0.0 }
    }

    fn corners(&self) -> Corners {
        let ([a, b, c], [d, e, f]) = (self.min, self.max);
        Corners { min: [a, b, c, 0.0], max: [d, e, f, self.zero] }
    }

    /// Twice the centre: the factor changes no split.
    fn centre(&self) -> [f32; 4] {
        let Corners { min, max } = self.corners();
        [min[0] + max[0], min[1] + max[1], min[2] + max[2], 0.0]
    }
}

struct Binned<'a> {
    /// Bins of an axis.
    bins: usize,
    references: &'a mut [Reference],
    /// As long.
    spare: &'a mut [Reference],
    /// Around all centres.
    centres: Corners,
}

/// What lies in a bin.
#[derive(Clone, Copy)]
struct Bin {
    corners: Corners,
    references: usize,
}

impl Bin {
    const EMPTY: Self = Self { corners: Corners::EMPTY, references: 0 };

    fn union(self, other: Self) -> Self {
        Self { corners: self.corners.union(other.corners), references: self.references + other.references }
    }
}

type AllBins = [[Bin; MOST]; 3];

/// Where the bins of each axis lie.
#[derive(Clone, Copy)]
struct Grid {
    bins: usize,
    origin: [f32; 4],
    /// Bins per unit; 0 where all centres are the same.
    scale: [f32; 4],
}

impl Grid {
    fn of(centres: &Corners, bins: usize) -> Self {
        let scale = |axis: usize| {
            let extent = centres.max[axis] - centres.min[axis];
            if extent > 0.0 { bins as f32 / extent } else { 0.0 }
        };
        Self { bins, origin: centres.min, scale: [scale(0), scale(1), scale(2), 0.0] }
    }

    /// Axes on which not all lie in one bin.
    fn axes(&self) -> impl Iterator<Item = usize> + use<> {
        let scale = self.scale;
        (0..3).filter(move |&axis| scale[axis] > 0.0)
    }

    /// Grows with the coordinate. The smallest centre is in bin 0, the largest in the last one; on an axis of no extent all are in bin 0.
    fn bin(&self, axis: usize, centre: [f32; 4]) -> usize {
        // No centre of the part is below the origin, and none is so far above that 32 bits are too few.
        (((centre[axis] - self.origin[axis]) * self.scale[axis]) as i32 as usize).min(self.bins - 1)
    }
}

/// A split, on which axis, and the first bin on its right.
type Place = (Split, usize, usize);

impl Binned<'_> {
    /// Maps chunks of references, on several threads where it is worth it, and folds the results in order.
    fn map_chunks<T: Send>(&self, map: impl Fn(&[Reference]) -> T + Sync + Send, fold: impl Fn(T, T) -> T) -> T {
        if self.references.len() < 2 * SERIAL {
            return map(self.references);
        }
        let mapped: Vec<T> = self.references.par_chunks(SERIAL).map(&map).collect();
        mapped.into_iter().reduce(fold).expect("a part has references")
    }

    fn fill(&self, grid: &Grid) -> AllBins {
        let map = |references: &[Reference]| {
            let mut bins = [[Bin::EMPTY; MOST]; 3];
            for reference in references {
                let (centre, corners) = (reference.centre(), reference.corners());
                for (axis, bins) in bins.iter_mut().enumerate() {
                    let bin = &mut bins[grid.bin(axis, centre)];
                    bin.corners = bin.corners.union(corners);
                    bin.references += 1;
                }
            }
            bins
        };
        let fold = |mut sum: AllBins, bins: AllBins| {
            for (sum, bin) in sum.iter_mut().flatten().zip(bins.iter().flatten()) {
                *sum = sum.union(*bin);
            }
            sum
        };
        self.map_chunks(map, fold)
    }

    /// The best split between two bins; none where all lie in one.
    fn best_split(&self, grid: &Grid) -> Option<Place> {
        let n = self.references.len();
        let mut best = None;
        if n <= FEW {
            for axis in grid.axes() {
                self.split_few(grid, axis, &mut best);
            }
        } else {
            let bins = self.fill(grid);
            for axis in grid.axes() {
                split_bins(&bins[axis][..grid.bins], (axis, n), &mut best);
            }
        }
        best
    }

    /// As [`split_bins`], without the bins that hold nothing.
    fn split_few(&self, grid: &Grid, axis: usize, best: &mut Option<Place>) {
        let n = self.references.len();
        // Bin and place in one word: a few bytes are sorted, not boxes.
        let mut sorted = [0u16; FEW];
        for (k, reference) in self.references.iter().enumerate() {
            let key = (grid.bin(axis, reference.centre()) << 8 | k) as u16;
            let mut at = k;
            while at > 0 && sorted[at - 1] > key {
                sorted[at] = sorted[at - 1];
                at -= 1;
            }
            sorted[at] = key;
        }
        let corners = |key: u16| self.references[usize::from(key & 0xff)].corners();
        let mut right = [0.0; FEW];
        let mut sum = Corners::EMPTY;
        for k in (1..n).rev() {
            sum = sum.union(corners(sorted[k]));
            right[k] = sum.half_area();
        }
        let mut left = Corners::EMPTY;
        for k in 1..n {
            let bin = sorted[k - 1] >> 8;
            left = left.union(corners(sorted[k - 1]));
            if sorted[k] >> 8 > bin {
                offer((Split::new(left.half_area(), right[k], k, n), axis, usize::from(bin) + 1), n, best);
            }
        }
    }
}

/// Looks at every split between two bins of an axis of `n` references that leaves neither side empty.
fn split_bins(bins: &[Bin], (axis, n): (usize, usize), best: &mut Option<Place>) {
    let mut right = [0.0; MOST];
    let mut sum = Corners::EMPTY;
    for k in (1..bins.len()).rev() {
        sum = sum.union(bins[k].corners);
        right[k] = sum.half_area();
    }
    let mut left = Bin::EMPTY;
    for k in 1..bins.len() {
        left = left.union(bins[k - 1]);
        // Behind an empty bin the split is the one before.
        if bins[k - 1].references > 0 && left.references < n {
            offer((Split::new(left.corners.half_area(), right[k], left.references, n), axis, k), n, best);
        }
    }
}

fn offer(place: Place, n: usize, best: &mut Option<Place>) {
    if best.is_none_or(|(best, ..)| place.0.beats(&best, n)) {
        *best = Some(place);
    }
}

/// Around the centres of some references, by all threads where it is worth it.
fn centres(references: &[Reference]) -> Corners {
    let of = |references: &[Reference]| {
        let points = references.iter().map(|reference| Corners::at(reference.centre()));
        points.fold(Corners::EMPTY, Corners::union)
    };
    match references.len() {
        // Nobody asks.
        0..=2 => Corners::EMPTY,
        few if few < 2 * SERIAL => of(references),
        _ => references.par_chunks(SERIAL).map(of).reduce(|| Corners::EMPTY, Corners::union),
    }
}

/// Moves the references on the left to the front, in their order, by all threads where it is worth it. Returns how many they are, the references, and what is spare.
fn partition<'a>(
    references: &'a mut [Reference],
    spare: &'a mut [Reference],
    is_left: impl Fn(&Reference) -> bool + Sync,
) -> (usize, &'a mut [Reference], &'a mut [Reference]) {
    if references.len() < 2 * SERIAL {
        let left = stable_partition(references, spare, is_left);
        return (left, references, spare);
    }
    let count = |chunk: &[Reference]| chunk.iter().filter(|reference| is_left(reference)).count();
    let counts: Vec<usize> = references.par_chunks(SERIAL).map(count).collect();
    let left = counts.iter().sum();
    let (mut lefts, mut rights) = spare.split_at_mut(left);
    let mut chunks = Vec::with_capacity(counts.len());
    for (chunk, count) in references.chunks(SERIAL).zip(counts) {
        let sides = (lefts.split_at_mut(count), rights.split_at_mut(chunk.len() - count));
        (lefts, rights) = (sides.0.1, sides.1.1);
        chunks.push((chunk, sides.0.0, sides.1.0));
    }
    chunks.into_par_iter().for_each(|(chunk, lefts, rights)| {
        let (mut lefts, mut rights) = (lefts.iter_mut(), rights.iter_mut());
        for reference in chunk {
            let side = if is_left(reference) { lefts.next() } else { rights.next() };
            *side.expect("as many as were counted") = *reference;
        }
    });
    (left, spare, references)
}

impl Part for Binned<'_> {
    fn len(&self) -> usize {
        self.references.len()
    }

    fn first(&self) -> u32 {
        self.references[0].id
    }

    fn split(self) -> (Self, Self) {
        let bins = self.bins;
        let (left, references, spare) = if let [a, b] = self.references {
            // Half of all splits: the cost is the same on each axis.
            let (p, q) = (a.centre(), b.centre());
            if (0..3).find(|&axis| p[axis] != q[axis]).is_some_and(|axis| q[axis] < p[axis]) {
                std::mem::swap(a, b);
            }
            (1, self.references, self.spare)
        } else {
            let grid = Grid::of(&self.centres, bins);
            let best = self.best_split(&grid);
            let Self { references, spare, .. } = self;
            match best {
                Some((_, axis, bin)) => {
                    partition(references, spare, |reference| grid.bin(axis, reference.centre()) < bin)
                }
                None => (references.len() / 2, references, spare),
            }
        };
        let (references, spare) = (references.split_at_mut(left), spare.split_at_mut(left));
        let around = (centres(references.0), centres(references.1));
        (
            Self { bins, references: references.0, spare: spare.0, centres: around.0 },
            Self { bins, references: references.1, spare: spare.1, centres: around.1 },
        )
    }
}

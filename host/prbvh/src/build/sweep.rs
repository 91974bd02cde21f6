//! Full-sweep SAH (MacDonald & Booth 1990; Hunt 2007 for sorting once): every split between two references, on every axis.

use super::top_down::{Part, SERIAL, Split, in_range, stable_partition, top_down};
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Builds a tree of one triangle per leaf on the CPU, with all threads of the current rayon pool; the tree does not depend on their
/// number. Returns `nodes[2n-1]` for [`DeviceTree::upload`](super::DeviceTree::upload). `triangles` are finite and of any size: the splits are
/// those of their [working coordinates](crate::scene::SafeRange).
///
/// The references are sorted by the centres of their boxes once per axis, equal ones by their number; a split keeps the three orders. Of
/// equally good splits the one closest to the middle is taken, then the first axis.
/// Of no triangles there is no tree, and no nodes.
#[must_use]
pub fn sah_sweep(triangles: &[Triangle]) -> Vec<Node> {
    sweep_until(triangles, None).unwrap_or_default()
}

/// [`sah_sweep`]; none of no triangles, or if an end was asked for.
pub(crate) fn sweep_until(triangles: &[Triangle], stop: Option<&Stop>) -> Option<Vec<Node>> {
    if triangles.is_empty() {
        return None;
    }
    let split = in_range(triangles);
    let boxes: Vec<Aabb> = split.par_iter().map(Triangle::aabb).collect();
    let is_left: Vec<AtomicBool> = boxes.iter().map(|_| AtomicBool::new(false)).collect();
    let mut orders = [const { Vec::new() }; 3];
    for (axis, order) in orders.iter_mut().enumerate() {
        // Of a large scene each of them takes longer than somebody who asks for an end should wait.
        if stop.is_some_and(Stop::is_asked) {
            return None;
        }
        *order = sorted(&boxes, axis);
    }
    let mut scratch = [0, 1, 2].map(|_| vec![0u32; boxes.len()]);
    let [x, y, z] = &mut orders;
    let [a, b, c] = &mut scratch;
    let axes = [Axis { ids: x, scratch: a }, Axis { ids: y, scratch: b }, Axis { ids: z, scratch: c }];
    top_down(Sweep { boxes: &boxes, is_left: &is_left, axes }, triangles, stop)
}

fn sorted(boxes: &[Aabb], axis: usize) -> Vec<u32> {
    let doubled_centre = |id: u32| boxes[id as usize].min[axis] + boxes[id as usize].max[axis];
    let mut ids: Vec<u32> = (0..boxes.len() as u32).collect();
    ids.par_sort_unstable_by(|&a, &b| doubled_centre(a).total_cmp(&doubled_centre(b)).then(a.cmp(&b)));
    ids
}

struct Sweep<'a> {
    boxes: &'a [Aabb],
    /// For each reference whether it goes to the left in the split that its part is in.
    is_left: &'a [AtomicBool],
    axes: [Axis<'a>; 3],
}

/// The references of a part, sorted along an axis.
struct Axis<'a> {
    ids: &'a mut [u32],
    scratch: &'a mut [u32],
}

impl Axis<'_> {
    fn best_split(&mut self, boxes: &[Aabb]) -> Split {
        let n = self.ids.len();
        let mut aabb = Aabb::EMPTY;
        for k in (1..n).rev() {
            aabb = aabb.union(boxes[self.ids[k] as usize]);
            self.scratch[k] = aabb.half_area().to_bits();
        }
        let mut best = Split::worst(n);
        let mut aabb = Aabb::EMPTY;
        for k in 1..n {
            aabb = aabb.union(boxes[self.ids[k - 1] as usize]);
            let split = Split::new(aabb.half_area(), f32::from_bits(self.scratch[k]), k, n);
            if split.beats(&best, n) {
                best = split;
            }
        }
        best
    }

    fn split_at(self, left: usize) -> (Self, Self) {
        let (ids, scratch) = (self.ids.split_at_mut(left), self.scratch.split_at_mut(left));
        (Self { ids: ids.0, scratch: scratch.0 }, Self { ids: ids.1, scratch: scratch.1 })
    }
}

impl Part for Sweep<'_> {
    fn len(&self) -> usize {
        self.axes[0].ids.len()
    }

    fn first(&self) -> u32 {
        self.axes[0].ids[0]
    }

    fn split(mut self) -> (Self, Self) {
        let Self { boxes, is_left, .. } = self;
        let n = self.len();
        let splits = for_each_axis(&mut self.axes, n, |axis| axis.best_split(boxes));
        let mut best = 0;
        for axis in 1..3 {
            if splits[axis].beats(&splits[best], n) {
                best = axis;
            }
        }
        let left = splits[best].left;
        for (k, &id) in self.axes[best].ids.iter().enumerate() {
            is_left[id as usize].store(k < left, Ordering::Relaxed);
        }
        for_each_axis(&mut self.axes, n, |axis| {
            stable_partition(axis.ids, axis.scratch, |&id| is_left[id as usize].load(Ordering::Relaxed));
        });
        let [x, y, z] = self.axes.map(|axis| axis.split_at(left));
        (Self { boxes, is_left, axes: [x.0, y.0, z.0] }, Self { boxes, is_left, axes: [x.1, y.1, z.1] })
    }
}

/// The three axes beside one another where `n` references are worth it.
fn for_each_axis<'a, T: Send>(axes: &mut [Axis<'a>; 3], n: usize, f: impl Fn(&mut Axis<'a>) -> T + Sync) -> [T; 3] {
    let [x, y, z] = axes;
    if n < SERIAL {
        return [f(x), f(y), f(z)];
    }
    let (x, (y, z)) = rayon::join(|| f(x), || rayon::join(|| f(y), || f(z)));
    [x, y, z]
}

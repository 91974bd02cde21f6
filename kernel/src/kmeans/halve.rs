//! Small parts, down to their leaves.

use super::{Frame, LEFT, Point, distance, drawn, key, link, node_of};
use crate::aabb::Aabb;
use crate::mem::{AtomicU32, Slot};
use crate::node::{AtomicNode, NO_NODE, ROOT};
use bytemuck::{Pod, Zeroable};

/// Push constants of [`halve`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct HalveParams {
    /// Invocations: one per small part.
    pub count: u32,
    /// References of all parts, `n`.
    pub references: u32,
    /// Parts that an invocation looks at before it pauses.
    pub steps: u32,
    /// References drawn for the second centre, `p`.
    pub candidates: u32,
    /// Rounds in which the centres become means, `i`.
    pub rounds: u32,
    /// What the draws are made of.
    pub seed: u32,
}

/// Invocation `i` goes on to split the small part that begins at place `small[i]` in two, and its parts likewise, from place `small[i] + cursors[i]` on.
///
/// Reads `starts[n]`; reads and writes those of `order[n]` and `sizes[n]` that belong to the part; writes links of `nodes[2n-1]`. `cursors` starts as 0. Adds to
/// `waiting[1]` the parts that are not done.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a kernel has a parameter for each buffer")]
pub fn halve(
    i: u32,
    params: &HalveParams,
    small: &[u32],
    starts: &[u32],
    boxes: &[Aabb],
    order: &[Slot<u32>],
    sizes: &[Slot<u32>],
    cursors: &[Slot<u32>],
    nodes: &[AtomicNode],
    waiting: &[AtomicU32],
) {
    let references = params.references;
    let first = small[i as usize];
    let is_in = move |at: u32| at < references && starts[at as usize] == first;
    let mut at = first + cursors[i as usize].get();
    for _ in 0..params.steps {
        if !is_in(at) {
            break;
        }
        let size = sizes[at as usize].get();
        let count = size & !LEFT;
        if count > 1 {
            let node = node_of(at, count, size & LEFT != 0, references);
            if node == ROOT {
                nodes[0].set_up(NO_NODE);
            }
            let left = split(at, count, params, boxes, order);
            link(node, at, left, count - left, references, nodes);
            sizes[at as usize].set(left | LEFT);
            sizes[(at + left) as usize].set(count - left);
        } else {
            at += 1;
        }
    }
    cursors[i as usize].set(at - first);
    if is_in(at) {
        waiting[0].add(1);
    }
}

/// Splits `count` references from place `at` on, two or more, by 2-means; in the middle where all are as near to the first centre as to the second. Returns how many are left.
#[inline(always)]
fn split(at: u32, count: u32, params: &HalveParams, boxes: &[Aabb], order: &[Slot<u32>]) -> u32 {
    if count == 2 {
        return 1;
    }
    let aabb_of = move |k: u32| boxes[order[(at + k) as usize].get() as usize];
    let mut aabb = Aabb::EMPTY;
    for k in 0..count {
        aabb = aabb.union(aabb_of(k));
    }
    let frame = Frame::of(aabb.min, aabb.max);
    let key = key(params.seed, at, count);
    let draw = move |number: u32| frame.point(aabb_of(drawn(key, number, count)));
    let mut low = draw(0);
    let (mut farthest, mut most) = (1, -1.0);
    for number in 1..params.candidates + 1 {
        let away = distance(low, draw(number));
        if away > most {
            most = away;
            farthest = number;
        }
    }
    let mut high = draw(farthest);
    for _ in 0..params.rounds {
        let (mut lows, mut highs) = ([0u32; 6], [0u32; 6]);
        let mut low_count = 0;
        for k in 0..count {
            let point = frame.point(aabb_of(k));
            if distance(high, point) < distance(low, point) {
                add(&mut highs, point);
            } else {
                add(&mut lows, point);
                low_count += 1;
            }
        }
        let (next_low, next_high) = (mean(lows, low_count, low), mean(highs, count - low_count, high));
        let moved = distance(low, next_low) + distance(high, next_high);
        low = next_low;
        high = next_high;
        if moved == 0.0 {
            break;
        }
    }
    let (mut left, mut right) = (0, count);
    for _ in 0..count {
        let reference = order[(at + left) as usize].get();
        let point = frame.point(boxes[reference as usize]);
        if distance(high, point) < distance(low, point) {
            right -= 1;
            let other = order[(at + right) as usize].get();
            order[(at + right) as usize].set(reference);
            order[(at + left) as usize].set(other);
        } else {
            left += 1;
        }
    }
    if left == 0 || left == count { count / 2 } else { left }
}

#[inline(always)]
fn add(sums: &mut [u32; 6], point: Point) {
    // No loop: it would count among those that a device bounds.
    sums[0] += point[0] as u32;
    sums[1] += point[1] as u32;
    sums[2] += point[2] as u32;
    sums[3] += point[3] as u32;
    sums[4] += point[4] as u32;
    sums[5] += point[5] as u32;
}

/// The mean of so many, or what it was.
#[inline(always)]
fn mean(sums: [u32; 6], count: u32, before: Point) -> Point {
    if count == 0 {
        return before;
    }
    let of = move |axis: usize| (sums[axis] / count) as f32;
    [of(0), of(1), of(2), of(3), of(4), of(5)]
}

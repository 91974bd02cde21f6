//! Slots that suit the octants of rays.
//!
//! Source: Ylitie, Karras & Laine 2017, §3.3. A ray of octant `o` takes the child in slot `s` as the (`s` xor `o`)-th. So a child fits slot `s` the better the
//! less far it lies in the direction of octant `s`; the sum over all children is made as small as it can be. The paper does so by auctions; here it is the method of
//! Kuhn 1955 and Munkres 1957 in the form of shortest paths, whose result is the least sum itself.

use super::{SLOTS, WideChild, WideNode};
use prbvh_kernel::aabb::Aabb;
use std::cmp::Ordering;

/// Costs of each child (row) in each slot (column).
type Costs = [[f64; SLOTS]; SLOTS];

/// The same children in their slots, whichever they were in before.
pub(super) fn by_octants(node: &WideNode) -> WideNode {
    let around = node.aabb();
    let centre = |min: f32, max: f32| f64::from(min) / 2.0 + f64::from(max) / 2.0;
    // Of several assignments of least cost the order of the children decides: it must not be that of their slots.
    let mut children: Vec<WideChild> = node.children().copied().collect();
    children.sort_by(|a, b| order(&a.aabb, &b.aabb));
    let mut costs: Costs = [[0.0; SLOTS]; SLOTS];
    for (child, costs) in children.iter().zip(&mut costs) {
        let offset: [f64; 3] = std::array::from_fn(|k| {
            centre(child.aabb.min[k], child.aabb.max[k]) - centre(around.min[k], around.max[k])
        });
        for (slot, cost) in costs.iter_mut().enumerate() {
            let sign = |bit: usize| if slot & bit == 0 { 1.0 } else { -1.0 };
            *cost = sign(4) * offset[0] + sign(2) * offset[1] + sign(1) * offset[2];
        }
    }
    let mut slots = assignment(&costs, children.len());
    // Equal boxes stay in the order in which they came.
    let mut first = 0;
    for run in children.chunk_by(|a, b| order(&a.aabb, &b.aabb).is_eq()) {
        slots[first..first + run.len()].sort_unstable();
        first += run.len();
    }
    let mut placed = WideNode::default();
    for (child, slot) in children.iter().zip(slots) {
        placed.slots[slot] = Some(*child);
    }
    placed
}

/// By coordinates; both zeros are one.
fn order(a: &Aabb, b: &Aabb) -> Ordering {
    let pairs = a.min.iter().chain(&a.max).zip(b.min.iter().chain(&b.max));
    pairs.map(|(a, b)| (a + 0.0).total_cmp(&(b + 0.0))).find(|ordering| ordering.is_ne()).unwrap_or(Ordering::Equal)
}

/// The slot of each of the first `count` children in the assignment of least cost.
fn assignment(costs: &Costs, count: usize) -> [usize; SLOTS] {
    const NOBODY: usize = usize::MAX;
    // One more column, from which each path starts.
    let start = SLOTS;
    let mut owner = [NOBODY; SLOTS + 1];
    let (mut of_child, mut of_slot) = ([0.0f64; SLOTS], [0.0f64; SLOTS + 1]);
    for child in 0..count {
        owner[start] = child;
        let mut at = start;
        let mut shortest = [f64::INFINITY; SLOTS];
        let mut from = [start; SLOTS];
        let mut is_done = [false; SLOTS + 1];
        while owner[at] != NOBODY {
            is_done[at] = true;
            let row = owner[at];
            let (mut step, mut next) = (f64::INFINITY, start);
            for slot in (0..SLOTS).filter(|&slot| !is_done[slot]) {
                let reduced = costs[row][slot] - of_child[row] - of_slot[slot];
                if reduced < shortest[slot] {
                    (shortest[slot], from[slot]) = (reduced, at);
                }
                if shortest[slot] < step {
                    (step, next) = (shortest[slot], slot);
                }
            }
            for slot in 0..=SLOTS {
                if is_done[slot] {
                    of_child[owner[slot]] += step;
                    of_slot[slot] -= step;
                } else {
                    shortest[slot] -= step;
                }
            }
            at = next;
        }
        // Along the path everybody moves on by one.
        while at != start {
            owner[at] = owner[from[at]];
            at = from[at];
        }
    }
    let mut slots = [0; SLOTS];
    for (slot, &child) in owner[..SLOTS].iter().enumerate() {
        if child != NOBODY {
            slots[child] = slot;
        }
    }
    slots
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::testing::Rng;
    use crate::wide::WideContent;

    fn random(rng: &mut Rng) -> f64 {
        rng.below(1000) as f64 - 500.0
    }

    /// The least sum over all ways to give slots to the children from `child` on.
    fn least(costs: &Costs, count: usize, child: usize, taken: usize) -> f64 {
        if child == count {
            return 0.0;
        }
        let free = (0..SLOTS).filter(|slot| taken >> slot & 1 == 0);
        let sums = free.map(|slot| costs[child][slot] + least(costs, count, child + 1, taken | 1 << slot));
        sums.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_sum_is_the_least_of_all() {
        let mut rng = Rng::new(5);
        for round in 0..60 {
            let count = 1 + round % 6;
            let costs: Costs = std::array::from_fn(|_| std::array::from_fn(|_| random(&mut rng)));
            let slots = assignment(&costs, count);
            let mut seen = [false; SLOTS];
            let mut sum = 0.0;
            for (child, &slot) in slots[..count].iter().enumerate() {
                assert!(!std::mem::replace(&mut seen[slot], true), "{slots:?}");
                sum += costs[child][slot];
            }
            assert_eq!(sum, least(&costs, count, 0, 0), "{costs:?}");
        }
    }

    #[test]
    fn children_in_the_corners_take_the_slots_of_their_octants() {
        let mut node = WideNode::default();
        for corner in 0..SLOTS {
            let place = |bit: usize| if corner & bit == 0 { 0.0 } else { 10.0 };
            let min = [place(4), place(2), place(1)];
            let aabb = Aabb { min, max: min.map(|x| x + 1.0) };
            node.slots[(corner * 3 + 1) % SLOTS] = Some(WideChild { aabb, content: WideContent::Node(corner as u32) });
        }
        let placed = by_octants(&node);
        for (slot, child) in placed.slots.iter().enumerate() {
            assert_eq!(child.map(|child| child.content), Some(WideContent::Node(slot as u32)));
        }
    }
}

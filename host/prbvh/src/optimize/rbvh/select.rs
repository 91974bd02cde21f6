//! Which nodes to reinsert next (Bittner, Hapala & Havran 2013, the combined inefficiency measure).

use super::tree::RbvhTree;
use crate::bvh::ROOT;
use crate::random::Random;

/// A child of less area, as a part of the node's, counts as this: it may have none at all.
const SMALLEST_PART: f32 = 1e-6;

/// Fewest nodes of a batch, where the tree has so many: 1 % of a small tree is too few to tell that nothing is gained any more.
const SMALLEST_BATCH: usize = 32;

/// Picks the nodes of a batch; its memory is kept from one batch to the next.
#[derive(Debug)]
pub(super) struct Selection {
    /// Nodes of the batch, in the order in which they are reinserted.
    pub(super) batch: Vec<u32>,
    /// Whether a node is in the batch and still the one that was picked.
    picked: Vec<bool>,
    /// Bits of the inefficiency, which is no negative number, above the complement of the id.
    keys: Vec<u64>,
    /// An inefficiency that the next batch's nodes most likely have: saves most keys.
    floor: f32,
    part: f64,
    random: Random,
}

impl Selection {
    pub(super) fn new(tree: &RbvhTree, part: f64, seed: u64) -> Self {
        let internal = tree.internal() as usize;
        Self {
            batch: Vec::new(),
            picked: vec![false; internal],
            keys: Vec::with_capacity(internal),
            floor: 0.0,
            part,
            random: Random::new(seed),
        }
    }

    /// Picks the most inefficient nodes, the worst first; of equally bad ones the one with the smaller number.
    pub(super) fn pick_worst(&mut self, tree: &RbvhTree) {
        self.forget();
        let mut count = self.collect(tree, self.floor);
        if self.keys.len() < count {
            count = self.collect(tree, 0.0);
        }
        if count < self.keys.len() {
            self.keys.select_nth_unstable_by(count, |a, b| b.cmp(a));
        }
        let worst = &mut self.keys[..count];
        worst.sort_unstable_by(|a, b| b.cmp(a));
        self.floor = worst.last().map_or(0.0, |key| f32::from_bits((key >> 32) as u32) * 0.8);
        self.batch.extend(worst.iter().map(|&key| !(key as u32)));
        self.batch.iter().for_each(|&v| self.picked[v as usize] = true);
    }

    /// Collects the keys of the eligible nodes whose inefficiency is at least `floor`. Returns how many a batch takes.
    fn collect(&mut self, tree: &RbvhTree, floor: f32) -> usize {
        self.keys.clear();
        let mut eligible = 0;
        for v in (ROOT + 1..tree.placed()).filter(|&v| is_eligible(tree, v)) {
            eligible += 1;
            let inefficiency = inefficiency(tree, v);
            if inefficiency >= floor {
                self.keys.push(key(inefficiency, v));
            }
        }
        self.count(eligible)
    }

    /// Picks as many nodes at random, all with the same chance.
    pub(super) fn pick_random(&mut self, tree: &RbvhTree) {
        self.forget();
        let internal = tree.placed();
        let count = self.count((internal as usize).saturating_sub(1));
        // Most nodes have a grandparent and few are drawn twice; the bound is for trees where that is not so.
        for _ in 0..4 * count {
            if self.batch.len() == count {
                break;
            }
            let v = 1 + self.random.below(internal - 1);
            if is_eligible(tree, v) && !self.picked[v as usize] {
                self.picked[v as usize] = true;
                self.batch.push(v);
            }
        }
    }

    /// Whether `v` of the batch is still the node that was picked, and can be reinserted.
    pub(super) fn is_due(&self, tree: &RbvhTree, v: u32) -> bool {
        self.picked[v as usize] && is_eligible(tree, v)
    }

    /// Takes note that the numbers of removed nodes stand for new ones.
    pub(super) fn recycled(&mut self, slots: [u32; 2]) {
        slots.iter().for_each(|&slot| self.picked[slot as usize] = false);
    }

    fn forget(&mut self) {
        self.batch.drain(..).for_each(|v| self.picked[v as usize] = false);
    }

    /// Nodes of a batch out of so many.
    fn count(&self, nodes: usize) -> usize {
        let part = (self.part * nodes as f64).ceil() as usize;
        part.max(SMALLEST_BATCH).min(nodes)
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.batch.capacity() * 4 + self.picked.capacity() + self.keys.capacity() * 8) as u64
    }
}

/// Whether a node that is not the root has a grandparent.
fn is_eligible(tree: &RbvhTree, v: u32) -> bool {
    tree.parent(v) != ROOT
}

/// `M_SUM · M_MIN · M_AREA`: area of the node over the mean and over the smaller of its children's areas, times its area.
fn inefficiency(tree: &RbvhTree, v: u32) -> f32 {
    let own = tree.half_area(v);
    if own <= 0.0 {
        return 0.0;
    }
    let [left, right] = tree.node(v).children.map(|child| tree.half_area(child) / own);
    own / ((0.5 * (left + right)).max(SMALLEST_PART) * left.min(right).max(SMALLEST_PART))
}

/// Orders by inefficiency, then the smaller number above the larger one.
fn key(inefficiency: f32, v: u32) -> u64 {
    u64::from(inefficiency.to_bits()) << 32 | u64::from(!v)
}

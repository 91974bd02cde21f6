//! Which nodes to reinsert next (Bittner, Hapala & Havran 2013, the combined inefficiency measure).

use super::tree::{RbvhTree, area};
use crate::bvh::ROOT;

/// Area ratios beyond this count as this: a child may have no area at all.
const LARGEST_RATIO: f64 = 1e6;

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
    part: f64,
    random: u64,
}

impl Selection {
    pub(super) fn new(tree: &RbvhTree, part: f64, seed: u64) -> Self {
        let internal = tree.internal() as usize;
        Self {
            batch: Vec::new(),
            picked: vec![false; internal],
            keys: Vec::with_capacity(internal),
            part,
            random: seed,
        }
    }

    /// Picks the most inefficient nodes, the worst first; of equally bad ones the one with the smaller number.
    pub(super) fn pick_worst(&mut self, tree: &RbvhTree) {
        self.forget();
        self.keys.clear();
        let scale = 1.0 / tree.root_area().max(f64::MIN_POSITIVE);
        let eligible = (ROOT + 1..tree.internal()).filter(|&v| is_eligible(tree, v));
        self.keys.extend(eligible.map(|v| key((inefficiency(tree, v) * scale) as f32, v)));
        let count = self.count(self.keys.len());
        if count < self.keys.len() {
            self.keys.select_nth_unstable_by(count, |a, b| b.cmp(a));
        }
        let worst = &mut self.keys[..count];
        worst.sort_unstable_by(|a, b| b.cmp(a));
        self.batch.extend(worst.iter().map(|&key| !(key as u32)));
        self.batch.iter().for_each(|&v| self.picked[v as usize] = true);
    }

    /// Picks as many nodes at random, all with the same chance.
    pub(super) fn pick_random(&mut self, tree: &RbvhTree) {
        self.forget();
        let internal = tree.internal();
        let count = self.count((internal as usize).saturating_sub(1));
        // Most nodes have a grandparent and few are drawn twice; the bound is for trees where that is not so.
        for _ in 0..4 * count {
            if self.batch.len() == count {
                break;
            }
            let v = 1 + self.below(internal - 1);
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

    /// A number below `end`, which is not 0 (SplitMix64, Steele, Lea & Flood 2014).
    fn below(&mut self, end: u32) -> u32 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (((z >> 32) * u64::from(end)) >> 32) as u32
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
fn inefficiency(tree: &RbvhTree, v: u32) -> f64 {
    let [left, right] = tree.node(v).children.map(|child| area(&tree.node(child).aabb));
    let own = area(&tree.node(v).aabb);
    let over = |part: f64| if own > 0.0 { own / part.max(own / LARGEST_RATIO) } else { 0.0 };
    over(0.5 * (left + right)) * over(left.min(right)) * own
}

/// Orders by inefficiency, then the smaller number above the larger one.
fn key(inefficiency: f32, v: u32) -> u64 {
    u64::from(inefficiency.to_bits()) << 32 | u64::from(!v)
}

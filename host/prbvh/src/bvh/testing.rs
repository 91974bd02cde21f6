//! Trees for tests.

use super::{Bvh, NO_NODE};
use prbvh_kernel::node::{Node, RIGHT};
use prbvh_kernel::setup::Triangle;

/// SplitMix64 (Steele, Lea & Flood 2014).
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// In [-1, 1], often exactly one of both zeros.
    fn coordinate(&mut self) -> f32 {
        match self.below(8) {
            0 => 0.0,
            1 => -0.0,
            _ => (self.next() >> 40) as f32 / (1 << 23) as f32 - 1.0,
        }
    }

    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }

    pub(crate) fn triangles(&mut self, count: usize) -> Vec<Triangle> {
        let mut point = || std::array::from_fn(|_| self.coordinate());
        (0..count).map(|_| Triangle { a: point(), b: point(), c: point() }).collect()
    }
}

/// Fills the links and the box of `p` from its two children.
fn join(nodes: &mut [Node], p: u32, [left, right]: [u32; 2]) {
    let aabb = nodes[left as usize].aabb().union(nodes[right as usize].aabb());
    nodes[left as usize].up = right;
    nodes[right as usize].up = p | RIGHT;
    nodes[p as usize] = Node { min: aabb.min, up: NO_NODE, max: aabb.max, down: left };
}

fn leaves(triangles: &[Triangle], order: &[u32]) -> Vec<Node> {
    let internal = triangles.len() - 1;
    let mut nodes = vec![Node { min: [0.0; 3], up: NO_NODE, max: [0.0; 3], down: 0 }; internal + triangles.len()];
    for (leaf, &triangle) in nodes[internal..].iter_mut().zip(order) {
        let aabb = triangles[triangle as usize].aabb();
        (leaf.min, leaf.max, leaf.down) = (aabb.min, aabb.max, triangle);
    }
    nodes
}

/// A random tree over `n` random triangles with random ids, as a device would leave it.
pub(crate) fn device_tree(n: usize, rng: &mut Rng) -> (Vec<Triangle>, Vec<Node>) {
    let triangles = rng.triangles(n);
    let mut order: Vec<u32> = (0..n as u32).collect();
    rng.shuffle(&mut order);
    let mut nodes = leaves(&triangles, &order);
    let mut ids: Vec<u32> = (1..(n as u32).max(2) - 1).collect();
    rng.shuffle(&mut ids);
    let mut roots: Vec<u32> = (n as u32 - 1..2 * n as u32 - 1).collect();
    while roots.len() > 1 {
        let mut take = || {
            let at = rng.below(roots.len());
            roots.swap_remove(at)
        };
        let pair = [take(), take()];
        let p = ids.pop().unwrap_or(0);
        join(&mut nodes, p, pair);
        roots.push(p);
    }
    (triangles, nodes)
}

/// A tree of depth `n-1`: internal node `p` has leaf `p` on the left.
pub(crate) fn chain(n: usize) -> (Vec<Triangle>, Vec<Node>) {
    let triangles = Rng::new(n as u64).triangles(n);
    let order: Vec<u32> = (0..n as u32).collect();
    let mut nodes = leaves(&triangles, &order);
    let internal = n as u32 - 1;
    for p in (0..internal).rev() {
        let right = if p + 1 < internal { p + 1 } else { internal + p + 1 };
        join(&mut nodes, p, [internal + p, right]);
    }
    (triangles, nodes)
}

/// A random tree and its triangles.
pub(crate) fn tree(n: usize, seed: u64) -> (Vec<Triangle>, Bvh) {
    let (triangles, nodes) = device_tree(n, &mut Rng::new(seed));
    let tree = Bvh::from_device(&nodes).unwrap_or_else(|faults| panic!("{}", super::summary(&faults)));
    (triangles, tree)
}

/// The same tree with its nodes (but for the root) and its triangle positions renumbered.
pub(crate) fn renumbered(tree: &Bvh, rng: &mut Rng) -> Bvh {
    use super::{BvhNode, Content};
    let mut ids: Vec<u32> = (0..tree.nodes.len() as u32).collect();
    rng.shuffle(&mut ids[1..]);
    let id = |v: u32| if v == NO_NODE { NO_NODE } else { ids[v as usize] };
    let mut nodes = tree.nodes.clone();
    let mut triangle_order = Vec::new();
    let mut olds: Vec<usize> = (0..tree.nodes.len()).collect();
    rng.shuffle(&mut olds);
    for old in olds {
        let node = tree.nodes[old];
        let content = match node.content {
            Content::Internal { left, right } => Content::Internal { left: id(left), right: id(right) },
            Content::Leaf { first, count } => {
                let start = triangle_order.len() as u32;
                triangle_order.extend_from_slice(tree.triangles_of(first, count));
                Content::Leaf { first: start, count }
            }
        };
        nodes[id(old as u32) as usize] = BvhNode { parent: id(node.parent), content, ..node };
    }
    Bvh { nodes, triangle_order }
}

//! Peers that do what peers have been seen to do, for the tests of the comparison.

use prbvh::bvh::Content;
use prbvh_kernel::setup::Triangle;
use prbvh_lab::compare::peers::{Peer, PeerTree};
use std::time::Duration;

/// All; none of them is compared where no methods are named.
pub const PLANTED: &[Peer] = &[
    Peer { name: "planted-panic", method: "planted-panic", is_default: false, build: panic },
    Peer { name: "planted-hang", method: "planted-hang", is_default: false, build: hang },
    Peer { name: "planted-wrong", method: "planted-wrong", is_default: false, build: wrong },
];

/// Panics on a thread of the pool.
fn panic(triangles: &[Triangle]) -> PeerTree {
    let build = || -> PeerTree { panic!("planted: {} triangles are too many", triangles.len()) };
    rayon::join(|| (), build).1
}

/// Never ends.
fn hang(_: &[Triangle]) -> PeerTree {
    loop {
        std::thread::sleep(Duration::from_secs(1));
    }
}

/// A chain in which the last triangle is there twice and the first one not at all.
fn wrong(triangles: &[Triangle]) -> PeerTree {
    let n = triangles.len() as u32;
    let leaf = |first| Content::Leaf { first, count: 1 };
    let mut nodes = Vec::new();
    for k in 0..n - 1 {
        let left = 2 * k + 1;
        nodes.push(Content::Internal { left, right: left + 1 });
        nodes.push(leaf(k));
    }
    nodes.push(leaf(n - 1));
    let mut triangle_order: Vec<u32> = (0..n).collect();
    triangle_order[0] = n - 1;
    PeerTree { build_s: 1e-9, nodes, triangle_order }
}

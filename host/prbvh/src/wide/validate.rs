//! Whether a wide tree is right.

use super::{WideBvh, WideChild, WideContent, WideFault};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;

/// Whether every node is reached once, every position of the triangle order is in one leaf, and every box is one; with `triangles` also whether each of them is
/// there once, and in every box that is to hold it. A box may be larger than that: compressed ones are.
///
/// # Errors
/// All faults, in the order in which they were found.
pub fn validate(tree: &WideBvh, triangles: Option<&[Triangle]>) -> Result<(), Vec<WideFault>> {
    let mut faults = Vec::new();
    if tree.nodes.is_empty() || u32::try_from(tree.nodes.len()).is_err() {
        return Err(vec![WideFault::NodeCount { nodes: tree.nodes.len() }]);
    }
    let mut seen = Seen { nodes: vec![false; tree.nodes.len()], positions: vec![false; tree.triangle_order.len()] };
    seen.nodes[0] = true;
    let mut stack = vec![0u32];
    while let Some(v) = stack.pop() {
        let node = &tree.nodes[v as usize];
        if node.children().next().is_none() {
            faults.push(WideFault::EmptyNode { node: v });
        }
        for (slot, child) in node.slots.iter().enumerate() {
            let Some(child) = child else { continue };
            if slot >= tree.width.get() {
                faults.push(WideFault::BeyondWidth { node: v, slot, width: tree.width.get() });
            }
            let known = faults.len();
            look(tree, (v, slot), child, &mut seen, &mut faults);
            if faults.len() > known {
                continue;
            }
            if let WideContent::Node(below) = child.content {
                stack.push(below);
            }
        }
    }
    let unseen = |seen: &[bool]| -> Vec<u32> { (0..seen.len() as u32).filter(|&k| !seen[k as usize]).collect() };
    faults.extend(unseen(&seen.nodes).into_iter().map(|node| WideFault::Unreachable { node }));
    faults.extend(unseen(&seen.positions).into_iter().map(|position| WideFault::PositionUnused { position }));
    if let Some(triangles) = triangles {
        ids(tree, triangles.len(), &mut faults);
        if faults.is_empty() {
            outside(tree, triangles, &mut faults);
        }
    }
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}

/// What was met.
struct Seen {
    nodes: Vec<bool>,
    positions: Vec<bool>,
}

/// The link, the range and the box of a child.
fn look(tree: &WideBvh, (node, slot): (u32, usize), child: &WideChild, seen: &mut Seen, faults: &mut Vec<WideFault>) {
    match child.content {
        WideContent::Node(below) => match seen.nodes.get_mut(below as usize) {
            None => faults.push(WideFault::LinkOutOfRange { node, slot, child: below, nodes: tree.nodes.len() }),
            Some(true) => faults.push(WideFault::Shared { node, slot, child: below }),
            Some(seen) => *seen = true,
        },
        WideContent::Leaf { count: 0, .. } => faults.push(WideFault::EmptyLeaf { node, slot }),
        WideContent::Leaf { first, count } => {
            let positions = seen.positions.len();
            let end = u64::from(first) + u64::from(count);
            if end > positions as u64 {
                faults.push(WideFault::LeafRange { node, slot, first, count, positions });
            } else {
                for position in first..end as u32 {
                    if std::mem::replace(&mut seen.positions[position as usize], true) {
                        faults.push(WideFault::PositionShared { node, slot, position });
                    }
                }
            }
        }
    }
    let Aabb { min, max } = child.aabb;
    let is_box = (0..3).all(|k| min[k].is_finite() && max[k].is_finite() && min[k] <= max[k]);
    if !is_box {
        faults.push(WideFault::NoBox { node, slot, aabb: child.aabb });
    }
}

/// Whether each box holds the triangles below it. That it holds the boxes below it is not asked: those of a compressed node are larger, on a grid of its own.
fn outside(tree: &WideBvh, triangles: &[Triangle], faults: &mut Vec<WideFault>) {
    let exact = tree.clone().with_boxes_of(triangles);
    for (v, (node, exact)) in tree.nodes.iter().zip(&exact.nodes).enumerate() {
        for (slot, (child, exact)) in node.slots.iter().zip(&exact.slots).enumerate() {
            if let (Some(WideChild { aabb: have, .. }), Some(WideChild { aabb: need, .. })) = (*child, *exact)
                && !have.contains(need)
            {
                faults.push(WideFault::Outside { node: v as u32, slot, have, need });
            }
        }
    }
}

/// Whether each triangle is there once.
fn ids(tree: &WideBvh, triangles: usize, faults: &mut Vec<WideFault>) {
    let mut seen = vec![false; triangles];
    for (position, &triangle) in tree.triangle_order.iter().enumerate() {
        let position = position as u32;
        match seen.get_mut(triangle as usize) {
            None => faults.push(WideFault::TriangleOutOfRange { position, triangle, triangles }),
            Some(true) => faults.push(WideFault::TriangleTwice { triangle, position }),
            Some(seen) => *seen = true,
        }
    }
    let missing = (0..triangles as u32).filter(|&triangle| !seen[triangle as usize]);
    faults.extend(missing.map(|triangle| WideFault::TriangleMissing { triangle }));
}

/// The first faults, and how many more there are.
#[must_use]
pub fn summary(faults: &[WideFault]) -> String {
    const SHOWN: usize = 3;
    let mut texts: Vec<String> = faults.iter().take(SHOWN).map(ToString::to_string).collect();
    if faults.len() > SHOWN {
        texts.push(format!("and {} more", faults.len() - SHOWN));
    }
    texts.join("; ")
}

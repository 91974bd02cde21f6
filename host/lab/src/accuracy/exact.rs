//! What a reinsertion is worth, in f64 and by differences that lose nothing: the referee of the search.

use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{Links, Node, ROOT};

/// How much the sum of half areas falls when the subtree of `input` becomes the sibling of `output`, scene units²; the formula is
/// that of [`prbvh_kernel::prbvh`]. Extents of float32 boxes and their differences are taken in f64, and areas of nested boxes are
/// subtracted by a formula without cancellation, so that also a large box that hardly changes contributes with full precision.
/// `output` is neither the input's sibling nor above or below the input.
#[must_use]
pub fn area_decrease(nodes: &[Node], input: u32, output: u32) -> f64 {
    let aabb = |v: u32| nodes[v as usize].aabb();
    let input_box = aabb(input);
    let (parent, sibling) = (nodes.parent(input), nodes.sibling(input));
    let mut above_input = vec![parent];
    while above_input[above_input.len() - 1] != ROOT {
        above_input.push(nodes.parent(above_input[above_input.len() - 1]));
    }
    let mut increase = 0.0;
    let mut pivot = nodes.parent(output);
    while !above_input.contains(&pivot) {
        increase += area_difference(aabb(pivot).union(input_box), aabb(pivot));
        pivot = nodes.parent(pivot);
    }
    let mut decrease = 0.0;
    let mut without = aabb(sibling);
    for pair in above_input.windows(2).take_while(|pair| pair[0] != pivot && pair[1] != pivot) {
        without = without.union(aabb(nodes.sibling(pair[0])));
        decrease += area_difference(aabb(pair[1]), without);
    }
    half_area(aabb(parent)) - half_area(aabb(output).union(input_box)) + (decrease - increase)
}

fn extents(aabb: Aabb) -> [f64; 3] {
    [0, 1, 2].map(|k| f64::from(aabb.max[k]) - f64::from(aabb.min[k]))
}

pub(super) fn half_area(aabb: Aabb) -> f64 {
    let [x, y, z] = extents(aabb);
    x * y + y * z + z * x
}

/// Half area of `outer` less that of `inner`, a box inside it: a sum of products that are not negative.
pub(super) fn area_difference(outer: Aabb, inner: Aabb) -> f64 {
    let [_, y, z] = extents(outer);
    let [a, b, _] = extents(inner);
    // Both gaps of an axis are differences of float32 numbers.
    let gap = |k: usize| {
        let low = f64::from(inner.min[k]) - f64::from(outer.min[k]);
        let high = f64::from(outer.max[k]) - f64::from(inner.max[k]);
        low + high
    };
    gap(0) * (y + z) + gap(1) * (a + z) + gap(2) * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::build;
    use prbvh::bvh::Bvh;
    use prbvh::scene::{SafeRange, built_in};
    use prbvh_kernel::prbvh::search::checked_area_decrease;

    #[test]
    fn differences_keep_what_a_large_area_hides() {
        let outer = Aabb { min: [0.0; 3], max: [1.0; 3] };
        let inner = Aabb { min: [0.0, 1e-30, 0.0], max: [1.0; 3] };
        assert_eq!(area_difference(outer, inner), 2.0 * f64::from(1e-30f32));
        assert_eq!(area_difference(outer, outer), 0.0);
        let half = Aabb { min: [0.0; 3], max: [0.5, 0.25, 1.0] };
        assert_eq!(area_difference(outer, half), 3.0 - 0.125 - 0.25 - 0.5);
    }

    /// The sum of half areas of a tree after a move, by the move.
    fn moved(nodes: &[Node], input: u32, output: u32, triangles: &[prbvh_kernel::setup::Triangle]) -> f64 {
        let mut nodes = nodes.to_vec();
        let cut = |nodes: &mut Vec<Node>, old: u32, new: u32| {
            let up = nodes[old as usize].up;
            if nodes[old as usize].is_left() {
                let parent = nodes.parent(old);
                nodes[parent as usize].down = new;
            } else {
                let left = nodes[nodes.parent(old) as usize].down;
                nodes[left as usize].up = new;
            }
            nodes[new as usize].up = up;
        };
        let (parent, sibling) = (nodes.parent(input), nodes.sibling(input));
        cut(&mut nodes, parent, sibling);
        cut(&mut nodes, output, parent);
        nodes[parent as usize].down = output;
        nodes[output as usize].up = input;
        nodes[input as usize].up = parent | prbvh_kernel::node::RIGHT;
        let tree = Bvh::from_device(&nodes).unwrap().with_boxes_of(triangles);
        tree.nodes[..triangles.len() - 1].iter().map(|node| half_area(node.aabb)).sum()
    }

    #[test]
    fn a_decrease_is_what_the_move_does() {
        let scene = built_in(16).triangles;
        let triangles = SafeRange::of(&scene).apply(&scene);
        let nodes = build::sah_binned(&triangles);
        let before: f64 = nodes[..triangles.len() - 1].iter().map(|node| half_area(node.aabb())).sum();
        let above = |v: u32| std::iter::successors(Some(v), |&v| (v != ROOT).then(|| nodes.parent(v)));
        let mut moves = 0;
        for input in 1..nodes.len() as u32 {
            for output in 1..nodes.len() as u32 {
                let related = above(output).any(|v| v == input) || above(input).any(|v| v == output);
                // A child of the root takes another way through the links.
                if related || output == nodes.sibling(input) || nodes.parent(input) == ROOT {
                    continue;
                }
                let after = moved(&nodes, input, output, &triangles);
                let decrease = area_decrease(&nodes, input, output);
                assert!((before - after - decrease).abs() < 1e-12 * before, "{input} to {output}");
                let pivot = above(output).skip(1).find(|v| above(input).skip(1).any(|u| u == *v)).unwrap();
                let kernel = f64::from(checked_area_decrease(input, output, pivot, &nodes[..]));
                assert!(kernel == 0.0 || (kernel / decrease - 1.0).abs() < 1e-3, "{kernel} {decrease}");
                moves += 1;
            }
        }
        assert!(moves > 200, "{moves}");
    }
}

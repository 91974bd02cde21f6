//! What a dual reinsertion is worth, in f64: the move alone, made on a few links beside the tree.

use super::exact::{area_difference, half_area};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{Links, Node, ROOT};
use prbvh_kernel::prbvh::Move;
use prbvh_kernel::prbvh::dual::DualMove;
use std::collections::{BTreeMap, BTreeSet};

/// How much the sum of half areas falls by a [dual move](prbvh_kernel::prbvh::dual) alone, scene units²: the links of the move are
/// changed beside the tree, and all boxes above them made anew. Boxes are exact, their areas and differences are those of
/// [`area_decrease`](super::area_decrease). None if it is no move: its nodes are not what they must be, or what it makes is no tree.
#[must_use]
pub fn dual_area_decrease(nodes: &[Node], found: &Move) -> Option<f64> {
    let internal = nodes.len() as u32 / 2;
    let input = found.input();
    if input == ROOT || input >= internal || nodes.parent(input) == ROOT {
        return None;
    }
    let dual = DualMove::new(nodes, found);
    let parent = nodes.parent(input);
    let is_output = |v: u32| v != ROOT && v != input && (v as usize) < nodes.len();
    let DualMove { first, first_output, second, second_output, .. } = dual;
    let is_move =
        is_output(first_output) && first_output != parent && first_output != second && is_output(second_output);
    if !is_move || first_output == first || second_output == second {
        return None;
    }
    let mut moved = Moved { nodes, parents: BTreeMap::new(), children: BTreeMap::new() };
    // Input and parent leave the tree, and come back one above each child.
    moved.replace(nodes.parent(parent), parent, nodes.sibling(input));
    moved.insert(first, first_output, parent)?;
    moved.insert(second, second_output, input)?;
    moved.decrease(&[nodes.parent(parent), parent, input])
}

/// A tree with other links, its boxes stale.
struct Moved<'a> {
    nodes: &'a [Node],
    parents: BTreeMap<u32, u32>,
    children: BTreeMap<u32, [u32; 2]>,
}

impl Moved<'_> {
    fn parent(&self, v: u32) -> u32 {
        self.parents.get(&v).copied().unwrap_or_else(|| self.nodes.parent(v))
    }

    fn children(&self, v: u32) -> [u32; 2] {
        self.children.get(&v).copied().unwrap_or_else(|| {
            let left = self.nodes.down(v);
            [left, self.nodes.up(left)]
        })
    }

    /// `new` takes the place of `old` below `above`.
    fn replace(&mut self, above: u32, old: u32, new: u32) {
        let children = self.children(above).map(|child| if child == old { new } else { child });
        self.children.insert(above, children);
        self.parents.insert(new, above);
    }

    /// `child` becomes the sibling of `output`, with `new` as their parent; none if the output is no longer in the tree.
    fn insert(&mut self, child: u32, output: u32, new: u32) -> Option<()> {
        let above = self.parent(output);
        if !self.children(above).contains(&output) {
            return None;
        }
        self.replace(above, output, new);
        self.children.insert(new, [output, child]);
        self.parents.insert(output, new);
        self.parents.insert(child, new);
        Some(())
    }

    /// The sum of areas less what it is now; only boxes of nodes from `changed` up to the root are others. None if a way up does not end.
    fn decrease(&self, changed: &[u32]) -> Option<f64> {
        let mut by_depth = BTreeSet::new();
        for &from in changed {
            let mut way = vec![from];
            let mut v = from;
            while v != ROOT {
                v = self.parent(v);
                way.push(v);
                if way.len() > self.nodes.len() {
                    return None;
                }
            }
            by_depth.extend(way.iter().rev().enumerate().map(|(depth, &v)| (depth, v)));
        }
        let mut boxes: BTreeMap<u32, Aabb> = BTreeMap::new();
        let mut decrease = 0.0;
        for &(_, v) in by_depth.iter().rev() {
            let box_of = |child: u32| boxes.get(&child).copied().unwrap_or_else(|| self.nodes[child as usize].aabb());
            let [left, right] = self.children(v).map(box_of);
            let (old, new) = (self.nodes[v as usize].aabb(), left.union(right));
            decrease += if old.contains(new) {
                area_difference(old, new)
            } else if new.contains(old) {
                -area_difference(new, old)
            } else {
                half_area(old) - half_area(new)
            };
            boxes.insert(v, new);
        }
        Some(decrease)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::build;
    use prbvh::bvh::Bvh;
    use prbvh::scene::{SafeRange, built_in};
    use prbvh_kernel::node::RIGHT;

    /// The sum of half areas of internal nodes, from the leaves up.
    fn total(nodes: &[Node], children: &[Option<[u32; 2]>]) -> f64 {
        fn below(v: u32, nodes: &[Node], children: &[Option<[u32; 2]>], sum: &mut f64) -> Aabb {
            let Some([left, right]) = children[v as usize] else { return nodes[v as usize].aabb() };
            let aabb = below(left, nodes, children, sum).union(below(right, nodes, children, sum));
            *sum += half_area(aabb);
            aabb
        }
        let mut sum = 0.0;
        below(ROOT, nodes, children, &mut sum);
        sum
    }

    /// Every move of every input in a small tree, made on lists of children.
    #[test]
    fn a_decrease_is_what_the_move_does() {
        let scene = built_in(14).triangles;
        let nodes = build::sah_binned(&SafeRange::of(&scene).apply(&scene));
        let internal = nodes.len() as u32 / 2;
        let links: Vec<Option<[u32; 2]>> =
            (0..nodes.len() as u32).map(|v| (v < internal).then(|| [nodes.down(v), nodes.up(nodes.down(v))])).collect();
        let before = total(&nodes, &links);
        let above = |v: u32| std::iter::successors(Some(v), |&v| (v != ROOT).then(|| nodes.parent(v)));
        let mut moves = 0;
        for input in (1..internal).filter(|&v| nodes.parent(v) != ROOT) {
            let (parent, [left, right]) = (nodes.parent(input), links[input as usize].unwrap());
            let places: Vec<u32> = (1..nodes.len() as u32)
                .filter(|&v| above(v).all(|u| u != input) && above(input).all(|u| u != v))
                .collect();
            for (first, second, flag) in [(left, right, 0), (right, left, RIGHT)] {
                for &output in &places {
                    for &other in places.iter().chain([&parent, &first]) {
                        let found = Move { area_decrease: 1.0, input, output, other: other | flag };
                        let decrease = dual_area_decrease(&nodes, &found).unwrap();
                        let mut after = links.clone();
                        let mut children = after.iter_mut().flatten().flatten();
                        *children.find(|child| **child == parent).unwrap() = nodes.sibling(input);
                        after[parent as usize] = None;
                        after[input as usize] = None;
                        for (child, output, new) in [(first, output, parent), (second, other, input)] {
                            let mut lists = after.iter_mut().flatten().flatten();
                            *lists.find(|child| **child == output).unwrap() = new;
                            after[new as usize] = Some([output, child]);
                        }
                        let expected = before - total(&nodes, &after);
                        assert!((expected - decrease).abs() < 1e-12 * before, "{found:?}: {decrease}, not {expected}");
                        moves += 1;
                    }
                }
            }
        }
        assert!(moves > 1000, "{moves}");
    }

    #[test]
    fn what_is_no_move_is_worth_nothing() {
        let scene = built_in(100).triangles;
        let nodes = build::sah_binned(&SafeRange::of(&scene).apply(&scene));
        assert!(Bvh::from_device(&nodes).is_ok());
        let internal = nodes.len() as u32 / 2;
        let is_deep = |v: u32| nodes.parent(v) != ROOT && nodes.parent(nodes.parent(v)) != ROOT;
        let input = (1..internal).find(|&v| is_deep(v) && nodes.down(v) < internal).unwrap();
        let (parent, left) = (nodes.parent(input), nodes.down(input));
        let place = nodes.sibling(parent);
        let of = |input, output, other| dual_area_decrease(&nodes, &Move { area_decrease: 1.0, input, output, other });
        assert!(of(input, place, place).is_some() && of(input, place, left).is_some());
        for (input, output, other) in [
            (ROOT, place, place),
            (nodes.down(ROOT), place, place),
            (internal, place, place),
            (input, ROOT, place),
            (input, parent, place),
            (input, input, place),
            (input, left, place),
            (input, place, nodes.up(left)),
            (input, nodes.len() as u32, place),
            (input, place, nodes.len() as u32),
        ] {
            assert_eq!(of(input, output, other), None, "{input}: {output}, {other}");
        }
        assert_eq!(of(input, nodes.down(left), place), None, "below itself");
    }
}

//! Whether a run of ours says the truth: about its costs, its tree, and the runs before it.

use prbvh::bvh::{Bvh, SahModel, quality, summary, validate};
use prbvh::scene::Scene;
use prbvh_kernel::node::Node;

/// Costs of two runs are the same bits as far as the shorter one goes.
///
/// # Errors
/// Where they part, and both costs.
pub fn same_costs(earlier: &[f64], again: &[f64]) -> Result<(), String> {
    let differ = earlier.iter().zip(again).position(|(a, b)| a.to_bits() != b.to_bits());
    differ.map_or(Ok(()), |k| Err(format!("cost {} at point {k}, {} in an earlier run", again[k], earlier[k])))
}

/// `claimed / cost - 1`, if that is within the tolerance.
///
/// # Errors
/// If it is not.
pub fn confirmed(claimed: f64, cost: f64, tolerance: f64) -> Result<f64, String> {
    let error = claimed / cost - 1.0;
    if error.abs() <= tolerance { Ok(error) } else { Err(format!("cost {claimed} is {cost}")) }
}

/// SAH cost of a device's tree over the triangles of the scene, by the f64 evaluator.
///
/// # Errors
/// If it is no tree over them.
pub fn evaluated(nodes: &[Node], scene: &Scene) -> Result<f64, String> {
    let tree = Bvh::from_device(nodes).map(|tree| tree.with_boxes_of(&scene.triangles));
    let tree = tree.and_then(|tree| validate(&tree, Some(&scene.triangles)).map(|_| tree));
    Ok(quality(&tree.map_err(|faults| summary(&faults))?, &SahModel::default()).sah_cost)
}

/// SAH cost from the boxes of a device's nodes as they are, in f64: as [`evaluated`], but quick enough for every iteration, since nothing
/// is checked.
#[must_use]
pub fn cost_of_boxes(nodes: &[Node]) -> f64 {
    let SahModel { c_traversal, c_intersect } = SahModel::default();
    let half_area = |node: &Node| {
        let [x, y, z] = std::array::from_fn(|k| f64::from(node.max[k]) - f64::from(node.min[k]));
        x * y + y * z + z * x
    };
    let (internal, leaves) = nodes.split_at(nodes.len() / 2);
    let sum = |nodes: &[Node]| nodes.iter().map(half_area).sum::<f64>();
    // With one triangle the root is a leaf.
    let root = half_area(&nodes[0]);
    if root > 0.0 {
        (c_traversal * sum(internal) + c_intersect * sum(leaves)) / root
    } else {
        c_traversal * internal.len() as f64 + c_intersect * leaves.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{soup, working};
    use prbvh::build::sah_binned;

    fn built(count: usize) -> (Scene, Vec<Node>) {
        let triangles = soup(count, 0.1, 7);
        let nodes = sah_binned(&working(&triangles));
        (Scene::from_triangles("soup", triangles).unwrap(), nodes)
    }

    #[test]
    fn both_evaluators_agree() {
        for count in [1, 2, 700] {
            let (scene, nodes) = built(count);
            let cost = evaluated(&nodes, &scene).unwrap();
            assert!(confirmed(cost_of_boxes(&nodes), cost, 1e-12).is_ok(), "{} {cost}", cost_of_boxes(&nodes));
        }
    }

    #[test]
    fn a_planted_fault_of_the_tree_is_found() {
        let (scene, mut nodes) = built(100);
        nodes[199 - 1].down = nodes[199 - 2].down;
        assert!(evaluated(&nodes, &scene).is_err());
        let (scene, mut nodes) = built(100);
        nodes[5].down = 0;
        assert!(evaluated(&nodes, &scene).is_err());
        assert!(evaluated(&built(99).1, &scene).is_err());
    }

    #[test]
    fn a_planted_box_changes_the_cost_of_the_boxes_alone() {
        let (scene, mut nodes) = built(100);
        let before = evaluated(&nodes, &scene).unwrap();
        nodes[3].max[0] += nodes[3].max[0] - nodes[3].min[0];
        assert_eq!(evaluated(&nodes, &scene), Ok(before));
        assert!(confirmed(cost_of_boxes(&nodes), before, 1e-9).is_err());
    }

    #[test]
    fn a_planted_cost_is_found() {
        assert!(confirmed(100.02, 100.0, 1e-4).unwrap_err().contains("cost 100.02 is 100"));
        assert!(confirmed(f64::NAN, 100.0, 1e-4).is_err());
        assert!(confirmed(100.005, 100.0, 1e-4).unwrap() > 0.0);
        assert_eq!(same_costs(&[3.0, 2.0, 1.0], &[3.0, 2.0]), Ok(()));
        let next = f64::from_bits(2.0f64.to_bits() + 1);
        assert!(same_costs(&[3.0, 2.0], &[3.0, next, 1.0]).unwrap_err().contains("at point 1"));
    }
}

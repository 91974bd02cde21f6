//! obvhs 0.4 with its feature `parallel`, as a peer. Its costs come from our f64 evaluator, over boxes recomputed from the triangles.

use glam::Vec3A;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use obvhs::triangle::Triangle;
use prbvh::bvh::{self, SahModel, TreeFault, quality, validate};
use prbvh::interop::obvhs::from_bvh2;
use prbvh::scene::Scene;
use prbvh_kernel::aabb::Aabb;

/// Name, version and features, as every row of the peer states them.
pub const PROGRAM: &str = "obvhs 0.4.0 (parallel)";

/// A peer's own boxes may be larger than need be, which is no fault of its tree. Smaller ones by more than this part of the cost are.
const TOLERANCE: f64 = 1e-6;

/// The scene's triangles as obvhs takes them.
#[must_use]
pub fn triangles(scene: &Scene) -> Vec<Triangle> {
    let corner = Vec3A::from_array;
    scene.triangles.iter().map(|t| Triangle { v0: corner(t.a), v1: corner(t.b), v2: corner(t.c) }).collect()
}

/// PLOC with radius 32 on all levels, one triangle per leaf: its best initial tree.
#[must_use]
pub fn ploc(triangles: &[Triangle]) -> Bvh2 {
    let indices: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut builder = PlocBuilder::with_capacity(triangles.len());
    builder.build(PlocSearchDistance::VeryHigh, triangles, indices, SortPrecision::U64, 0)
}

/// SAH cost of the tree over the scene by our evaluator.
///
/// # Errors
/// If it is no tree over the triangles with one of them in each leaf, or its own boxes do not hold them.
pub fn cost(tree: &Bvh2, scene: &Scene) -> Result<f64, String> {
    let invalid = |faults: Vec<TreeFault>| format!("{PROGRAM}: {}", bvh::summary(&faults));
    let decoded = from_bvh2(tree).map_err(invalid)?;
    let mut bare = decoded.clone();
    let nowhere = Aabb { min: [0.0; 3], max: [0.0; 3] };
    bare.nodes.iter_mut().for_each(|node| node.aabb = nowhere);
    let shape = validate(&bare, None).map_err(invalid)?;
    if shape.leaves as usize != scene.triangles.len() {
        return Err(format!("{PROGRAM}: {} leaves over {} triangles", shape.leaves, scene.triangles.len()));
    }
    let tight = bare.with_boxes_of(&scene.triangles);
    validate(&tight, Some(&scene.triangles)).map_err(invalid)?;
    let cost = quality(&tight, &SahModel::default()).sah_cost;
    let claimed = quality(&decoded, &SahModel::default()).sah_cost;
    if claimed < cost * (1.0 - TOLERANCE) {
        return Err(format!("{PROGRAM}: cost {claimed} over its own boxes, {cost} over those of the triangles"));
    }
    Ok(cost)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::soup;
    use obvhs::bvh2::reinsertion::ReinsertionOptimizer;

    fn built() -> (Scene, Bvh2) {
        let scene = Scene::from_triangles("soup", soup(500, 0.1, 3)).unwrap();
        let tree = ploc(&triangles(&scene));
        (scene, tree)
    }

    #[test]
    fn a_tree_of_the_peer_has_the_cost_of_its_boxes() {
        let (scene, mut tree) = built();
        let before = cost(&tree, &scene).unwrap();
        let claimed = quality(&from_bvh2(&tree).unwrap(), &SahModel::default()).sah_cost;
        assert!((claimed / before - 1.0).abs() < 1e-9, "{claimed} {before}");
        ReinsertionOptimizer::default().run(&mut tree, 1.0, None);
        let after = cost(&tree, &scene).unwrap();
        assert!(after < before, "{after} {before}");
    }

    #[test]
    fn planted_leaves_that_change_places_without_a_refit_are_caught() {
        let (scene, mut tree) = built();
        let last = tree.primitive_indices.len() - 1;
        tree.primitive_indices.swap(0, last);
        let error = cost(&tree, &scene).unwrap_err();
        assert!(error.contains("over its own boxes"), "{error}");
    }

    #[test]
    fn a_planted_box_that_is_too_small_is_caught() {
        let (scene, mut tree) = built();
        let inner = (1..tree.nodes.len()).find(|&v| tree.nodes[v].prim_count == 0).unwrap();
        let mut aabb = *tree.nodes[inner].aabb();
        aabb.max = aabb.min;
        tree.nodes[inner].set_aabb(aabb);
        assert!(cost(&tree, &scene).unwrap_err().contains("over its own boxes"));
    }

    #[test]
    fn a_planted_box_that_is_too_large_does_not_count() {
        let (scene, mut tree) = built();
        let before = cost(&tree, &scene).unwrap();
        let inner = (1..tree.nodes.len()).find(|&v| tree.nodes[v].prim_count == 0).unwrap();
        let whole = *tree.nodes[0].aabb();
        tree.nodes[inner].set_aabb(whole);
        assert_eq!(cost(&tree, &scene), Ok(before));
    }

    #[test]
    fn planted_faults_of_the_tree_are_caught() {
        let (scene, tree) = built();
        let mut twice = tree.clone();
        twice.primitive_indices[0] = twice.primitive_indices[1];
        assert!(cost(&twice, &scene).is_err());
        let mut cyclic = tree.clone();
        let inner = (1..tree.nodes.len()).find(|&v| tree.nodes[v].prim_count == 0).unwrap();
        cyclic.nodes[inner].first_index = 1;
        assert!(cost(&cyclic, &scene).is_err());
        let other = Scene::from_triangles("soup", soup(499, 0.1, 3)).unwrap();
        assert!(cost(&tree, &other).unwrap_err().contains("500 leaves over 499 triangles"));
    }
}

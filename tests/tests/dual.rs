//! The kernels of the dual moves against brute force.

use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{NO_NODE, Node};
use prbvh_kernel::prbvh::dual::DualMove;
use prbvh_kernel::prbvh::{PrbvhParams, Reinsertion, lock_key};
use prbvh_kernel::status::{APPLIED, FAULTS, FOUND, OWNED, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::dual::{measured_area_decrease, moves, reinsert, topology};
use prbvh_tests::fixtures::{on_a_lattice, soup, stiff};
use prbvh_tests::oracle::{NaiveTree, half_area, tree_of};
use proptest::prelude::*;

const REPORT: usize = REPORT_WORDS as usize;

fn params(mu: u32, first: u32, nodes: usize) -> PrbvhParams {
    let internal = nodes as u32 / 2;
    PrbvhParams { count: internal.saturating_sub(first).div_ceil(mu), mu, first, nodes: nodes as u32, floor: 0.0 }
}

/// `found` and `seconds`, the same on every device in every order.
fn search(tree: &NaiveTree, params: &PrbvhParams) -> (Vec<Reinsertion>, Vec<u32>) {
    let length = params.count.max(1) as usize;
    let case = Case::new(Kernel::DualSearch, params.count, params).with(&tree.encode());
    let result = case.zeros(length).zeros(length).zeros(REPORT).run_everywhere();
    let found: Vec<Reinsertion> = result.get("found");
    let report: Vec<u32> = result.get("report");
    assert_eq!(report[FAULTS], 0);
    let count = found.iter().take(params.count as usize).filter(|found| found.output != NO_NODE).count();
    assert_eq!(report[FOUND] as usize, if params.count == 0 { 0 } else { count });
    (found, result.get("seconds"))
}

/// The moves that a search found, by invocation.
fn found_moves(
    nodes: &[Node],
    params: &PrbvhParams,
    found: &[Reinsertion],
    seconds: &[u32],
) -> Vec<Option<(DualMove, f32)>> {
    (0..params.count as usize)
        .map(|i| {
            let reinsertion = found[i];
            let dual = DualMove::new(nodes, params.input(i as u32), reinsertion, seconds[i]);
            (reinsertion.output != NO_NODE).then_some((dual, reinsertion.area_decrease))
        })
        .collect()
}

/// The search says what each of its moves is worth alone, and finds moves that are at least as good as the best greedy one: the first
/// child where it costs least, then the second.
fn check_search(tree: &NaiveTree) {
    let params = params(1, 0, tree.children.len());
    let (found, seconds) = search(tree, &params);
    let nodes = tree.encode();
    let scale = half_area(&tree.boxes[0]);
    for (input, found) in (0u32..).zip(found_moves(&nodes, &params, &found, &seconds)) {
        let possible = moves(tree, input);
        let best = greedy(tree, &possible);
        match found {
            None => assert!(best < 1e-4 * scale, "a decrease of {best} for {input} was missed"),
            Some((dual, said)) => {
                assert!(possible.contains(&dual), "{dual:?}");
                let measured = measured_area_decrease(tree, &dual);
                let said = f64::from(said);
                assert!((measured - said).abs() < 1e-5 * scale, "{dual:?}: said {said}, measured {measured}");
                assert!(best - measured < 1e-4 * scale, "{dual:?}: {measured} found, {best} possible");
            }
        }
    }
}

/// The decrease of the better order, each child greedily.
fn greedy(tree: &NaiveTree, possible: &[DualMove]) -> f64 {
    let firsts: Vec<u32> = possible.iter().map(|dual| dual.first).collect();
    let mut best = 0.0f64;
    for order in [firsts.first(), firsts.last()].into_iter().flatten() {
        // Where the first child goes: of all moves that leave the second one alone in the world, the cheapest.
        let cost_of_first = |dual: &&DualMove| {
            let mut alone = tree.clone();
            reinsert(&mut alone, dual);
            let slot = alone.parent(dual.second).expect("inserted");
            let above = alone.parent(slot).expect("not the root");
            let sibling = alone.sibling(dual.second).expect("inserted");
            alone.children[above as usize].iter_mut().filter(|v| **v == slot).for_each(|v| *v = sibling);
            alone.children[slot as usize].clear();
            alone.refit(0);
            (0..alone.children.len())
                .filter(|&v| !alone.children[v].is_empty())
                .map(|v| half_area(&alone.boxes[v]))
                .sum::<f64>()
        };
        let of_order = || possible.iter().filter(|dual| dual.first == *order);
        let input = possible[0].input;
        let parent = tree.parent(input).expect("has a grandparent");
        let places = of_order().filter(|dual| dual.second_output == parent);
        let least = places.clone().map(|dual| cost_of_first(&dual)).fold(f64::INFINITY, f64::min);
        // Of equally good places any may be taken; the least that they lead to is what can be asked for.
        let tolerance = 1e-6 * half_area(&tree.boxes[0]);
        let tied: Vec<u32> =
            places.filter(|dual| cost_of_first(dual) <= least + tolerance).map(|d| d.first_output).collect();
        let of_place = |place: u32| {
            of_order()
                .filter(|dual| dual.first_output == place)
                .map(|dual| measured_area_decrease(tree, dual))
                .fold(0.0, f64::max)
        };
        best = best.max(tied.into_iter().map(of_place).fold(f64::INFINITY, f64::min));
    }
    best
}

#[test]
fn the_search_finds_the_greedy_move_in_small_trees() {
    for n in [1, 2, 3, 4, 5, 8, 16] {
        for seed in 0..4 {
            check_search(&tree_of(&soup(n, 0.3, seed), seed + 100));
        }
    }
}

#[test]
fn the_oracle_of_the_search_notices_a_wrong_decrease() {
    let tree = tree_of(&soup(16, 0.3, 1), 1);
    let params = params(1, 0, tree.children.len());
    let (found, seconds) = search(&tree, &params);
    let (dual, said) = found_moves(&tree.encode(), &params, &found, &seconds).into_iter().flatten().next().unwrap();
    let planted = DualMove { second_output: dual.first, ..dual };
    let planted = if planted == dual { DualMove { second_output: dual.first_output, ..dual } } else { planted };
    assert!((measured_area_decrease(&tree, &dual) - f64::from(said)).abs() < 1e-5);
    assert!((measured_area_decrease(&tree, &planted) - f64::from(said)).abs() > 1e-5);
}

/// Search, lock, check and reinsert, each against a naive version. Returns the tree after.
fn check_iteration(tree: &NaiveTree, mu: u32, first: u32) -> NaiveTree {
    let length = tree.children.len();
    let params = params(mu, first, length);
    let nodes = tree.encode();
    let (found, seconds) = search(tree, &params);
    let duals = found_moves(&nodes, &params, &found, &seconds);

    let mut locks = vec![0u64; length];
    for (dual, decrease) in duals.iter().flatten() {
        for v in topology(tree, dual) {
            locks[v as usize] = locks[v as usize].max(lock_key(*decrease, dual.input));
        }
    }
    let case = |kernel| Case::new(kernel, params.count, &params).with(&nodes);
    let both = |kernel| case(kernel).with(&found).with(&seconds);
    assert_eq!(both(Kernel::DualLock).zeros(length).run_everywhere().get::<u64>("locks"), locks);
    let decreases: Vec<u32> = both(Kernel::DualLockDecrease).zeros(length).run_everywhere().get("decreases");
    let inputs = both(Kernel::DualLockInput).with(&decreases).zeros(length).run_everywhere();
    let inputs: Vec<u32> = inputs.get("inputs");
    let words = decreases.iter().zip(&inputs).map(|(&high, &low)| u64::from(high) << 32 | u64::from(low));
    assert_eq!(words.collect::<Vec<_>>(), locks);

    let owns = |(dual, decrease): &(DualMove, f32)| {
        topology(tree, dual).iter().all(|&v| locks[v as usize] == lock_key(*decrease, dual.input))
    };
    let owners: Vec<Option<(DualMove, f32)>> = duals.iter().map(|dual| dual.filter(owns)).collect();
    let owned = owners.iter().flatten().count();
    assert_eq!(owned == 0, duals.iter().flatten().count() == 0, "something moves whenever something was found");
    let checked = case(Kernel::DualCheck).with(&seconds).with(&locks).with(&found).zeros(REPORT).run_everywhere();
    let words = case(Kernel::DualCheckWords).with(&seconds).with(&decreases).with(&inputs).with(&found);
    let kept: Vec<Reinsertion> = checked.get("found");
    assert_eq!(kept, words.zeros(REPORT).run_everywhere().get::<Reinsertion>("found"));
    assert_eq!(checked.get::<u32>("report")[OWNED] as usize, owned);
    for (i, owner) in owners.iter().enumerate() {
        assert_eq!(kept[i], if owner.is_some() { found[i] } else { Reinsertion::NONE });
    }

    let result = Case::new(Kernel::DualReinsert, params.count, &params).with(&kept).with(&seconds).with(&nodes);
    let result = result.zeros(REPORT).run_everywhere();
    assert_eq!(result.get::<u32>("report")[APPLIED] as usize, owned);
    let mut expected = tree.clone();
    owners.iter().flatten().for_each(|(dual, _)| reinsert(&mut expected, dual));
    // Reads every link: whatever is no tree ends here.
    let mut after = NaiveTree::decode(&result.get::<Node>("nodes"));
    assert_eq!(after.children, expected.children);
    after.refit(0);
    after
}

#[test]
fn iterations_do_what_the_naive_ones_do_and_end() {
    for (n, mu) in [(2, 1), (3, 1), (4, 1), (40, 1), (40, 3), (300, 9)] {
        let mut tree = tree_of(&soup(n, 0.2, n as u64), n as u64);
        let initial = tree.internal_area();
        for iteration in 0..6 {
            tree = check_iteration(&tree, mu, iteration % mu);
        }
        assert!(tree.internal_area() <= initial * (1.0 + 1e-6));
    }
}

/// Boxes in a row, the tree a comb: the search would take more rounds than it may.
#[test]
fn a_search_over_the_bound_moves_nothing_on_any_device() {
    let n = 20_000u32;
    let boxes: Vec<Aabb> =
        (0..n).map(|k| Aabb { min: [k as f32, 0.0, 0.0], max: [k as f32 + 0.5, 1.0, 1.0] }).collect();
    let internal = n - 1;
    let mut nodes: Vec<Node> = vec![bytemuck::Zeroable::zeroed(); 2 * n as usize - 1];
    for (k, aabb) in boxes.iter().enumerate() {
        let leaf = internal as usize + k;
        (nodes[leaf].min, nodes[leaf].max, nodes[leaf].down) = (aabb.min, aabb.max, k as u32);
    }
    nodes[0].up = NO_NODE;
    for v in (0..internal).rev() {
        let (left, right) = (internal + v, if v + 1 < internal { v + 1 } else { internal + v + 1 });
        nodes[v as usize].down = left;
        nodes[left as usize].up = right;
        nodes[right as usize].up = v | prbvh_kernel::node::RIGHT;
        let aabb = nodes[left as usize].aabb().union(nodes[right as usize].aabb());
        (nodes[v as usize].min, nodes[v as usize].max) = (aabb.min, aabb.max);
    }
    let params =
        PrbvhParams { count: internal.div_ceil(499), mu: 499, first: 498, nodes: nodes.len() as u32, floor: 0.0 };
    let case = Case::new(Kernel::DualSearch, params.count, &params).with(&nodes);
    let result = case.zeros(params.count as usize).zeros(params.count as usize).zeros(REPORT).run_everywhere();
    let report: Vec<u32> = result.get("report");
    assert_eq!(report[FAULTS], 0);
    // The deepest inputs are past the bound, and the topmost ones are not.
    assert_eq!(report[prbvh_kernel::status::MOST_STEPS], prbvh_kernel::prbvh::dual::MAX_ROUNDS);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn degenerate_trees_stay_trees(
        triangles in on_a_lattice(40),
        seed in any::<u64>(),
        mu in 1u32..4,
    ) {
        let mut tree = tree_of(&triangles, seed);
        for iteration in 0..4 {
            tree = check_iteration(&tree, mu, iteration % mu);
        }
    }

    #[test]
    fn stiff_trees_stay_trees((triangles, seed) in stiff(40)) {
        let mut tree = tree_of(&triangles, seed);
        for _ in 0..3 {
            tree = check_iteration(&tree, 1, 0);
        }
    }
}

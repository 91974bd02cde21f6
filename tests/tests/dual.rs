//! The kernels of the dual moves against brute force.

use prbvh_kernel::Kernel;
use prbvh_kernel::node::{NO_NODE, Node};
use prbvh_kernel::prbvh::dual::DualMove;
use prbvh_kernel::prbvh::dual::search::{DualParams, MAX_ROUNDS, TO_THE_ROOT};
use prbvh_kernel::prbvh::worst::books::{BOOKS_WORDS, LIST_LENGTH};
use prbvh_kernel::prbvh::worst::keys::{IN_POOL, TIRED};
use prbvh_kernel::prbvh::{DUAL, Move, PrbvhParams};
use prbvh_kernel::status::{FAULTS, FOUND, MOST_STEPS, REPORT_WORDS, VISITS};
use prbvh_kernel::sum::scale_of;
use prbvh_tests::compare::Case;
use prbvh_tests::dual::{measured_area_decrease, moves, reinsert, topology};
use prbvh_tests::fixtures::{on_a_lattice, soup, stiff};
use prbvh_tests::locks::{Claimant, fault_of, lock_and_check};
use prbvh_tests::moved::{self, kept_fault, nothing_kept, paths_fault};
use prbvh_tests::oracle::{NaiveTree, half_area, row_comb, tree_of};
use proptest::prelude::*;

const REPORT: usize = REPORT_WORDS as usize;

/// What a full search takes: both orders, up to the root.
fn full(nodes: usize) -> DualParams {
    let (count, nodes) = (nodes as u32 / 2, nodes as u32);
    DualParams { count, nodes, both_orders: 1, climb: TO_THE_ROOT, slack: 0.0, row: 0 }
}

/// What is found for the nodes of a list, the same on every device in every order, and the row of the report.
fn search(nodes: &[Node], list: &[u32], params: &DualParams) -> (Vec<Move>, Vec<u32>) {
    let places = (nodes.len() / 2).max(1);
    let mut books = vec![0; BOOKS_WORDS as usize];
    books[LIST_LENGTH] = list.len() as u32;
    let mut padded = list.to_vec();
    // Whoever reads behind the end of the list comes to no node.
    padded.resize(places, NO_NODE);
    // No key has both bits from the start.
    let keys: Vec<u32> = (0..places as u32).map(|v| (v + 1) << 1 | IN_POOL).collect();
    let case = Case::new(Kernel::DualSearch, params.count, params).with(nodes).with(&padded).zeros(places);
    let result = case.with(&keys).with(&books).zeros(REPORT).run_everywhere();
    let mut found: Vec<Move> = result.get("found");
    let behind = found.split_off(list.len());
    assert!(behind.iter().take((params.count as usize).saturating_sub(list.len())).all(|found| *found == Move::NONE));
    let report: Vec<u32> = result.get("report");
    assert_eq!(report[FAULTS], 0);
    assert_eq!(report[FOUND] as usize, found.iter().filter(|found| found.output != NO_NODE).count());
    for (v, key) in result.get::<u32>("keys").into_iter().enumerate() {
        let in_vain = list.iter().zip(&found).any(|(&input, found)| input == v as u32 && found.output == NO_NODE);
        assert_eq!(
            key,
            keys[v] | if in_vain { TIRED } else { 0 },
            "who is searched in vain is tired, and nobody else: {v}"
        );
    }
    (found, report)
}

/// A full search for every `mu`-th internal node; what is found, by input.
fn search_all(tree: &NaiveTree, mu: usize, first: u32) -> Vec<(u32, Move)> {
    let list: Vec<u32> = (first..tree.children.len() as u32 / 2).step_by(mu).collect();
    let (found, _) = search(&tree.encode(), &list, &full(tree.children.len()));
    list.into_iter().zip(found).collect()
}

/// The search says what each of its moves is worth alone, and finds moves that are at least as good as the best greedy one: the first
/// child where it costs least, then the second.
fn check_search(tree: &NaiveTree) {
    let nodes = tree.encode();
    let scale = half_area(&tree.boxes[0]);
    for (input, found) in search_all(tree, 1, 0) {
        let found = (found.output != NO_NODE).then(|| (DualMove::new(&nodes[..], &found), found.area_decrease));
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
    let (_, found) = search_all(&tree, 1, 0).into_iter().find(|(_, found)| found.output != NO_NODE).unwrap();
    let (dual, said) = (DualMove::new(&tree.encode()[..], &found), found.area_decrease);
    let planted = DualMove { second_output: dual.first, ..dual };
    let planted = if planted == dual { DualMove { second_output: dual.first_output, ..dual } } else { planted };
    assert!((measured_area_decrease(&tree, &dual) - f64::from(said)).abs() < 1e-5);
    assert!((measured_area_decrease(&tree, &planted) - f64::from(said)).abs() > 1e-5);
}

/// Search, lock, check, reinsert and refit, each against a naive version. Returns the tree after.
fn check_iteration(tree: &NaiveTree, mu: usize, first: u32) -> NaiveTree {
    let length = tree.children.len();
    let nodes = tree.encode();
    let found: Vec<Move> = search_all(tree, mu, first).into_iter().map(|(_, found)| found).collect();
    let scale = scale_of(half_area(&tree.boxes[0]));
    let params =
        PrbvhParams { count: found.len() as u32, flags: DUAL, scale, ..PrbvhParams::every(1, 0, length as u32) };
    // A buffer has an element also where nothing is searched.
    let mut buffer = found.clone();
    buffer.resize(found.len().max(1), Move::NONE);
    let dual_of = |found: &Move| DualMove::new(&nodes[..], found);
    let open = found.iter().filter(|found| found.is_open());
    let claimants: Vec<Claimant> = open.map(|found| Claimant::alone(*found, topology(tree, &dual_of(found)))).collect();
    let checked = lock_and_check(&nodes, &buffer, &vec![0; length], &params);
    assert_eq!(fault_of(&found, &claimants, &checked, scale), None);

    let moved = moved::reinsert(&nodes, &checked.found, &nothing_kept(length), 1, &params);
    let mut expected = tree.clone();
    let winners: Vec<&Move> = checked.found.iter().filter(|found| found.has_won()).collect();
    winners.iter().for_each(|found| reinsert(&mut expected, &dual_of(found)));
    assert_eq!(moved.applied, winners.len());
    // Reads every link: whatever is no tree ends here.
    let mut after = NaiveTree::decode(&moved.nodes);
    assert_eq!(after.children, expected.children);
    assert_eq!(kept_fault(tree, &moved, 1), None);
    assert_eq!(paths_fault(&moved, &params), None);
    after.refit(0);
    after
}

#[test]
fn iterations_do_what_the_naive_ones_do_and_end() {
    for (n, mu) in [(2, 1), (3, 1), (4, 1), (40, 1), (40, 3), (300, 9)] {
        let mut tree = tree_of(&soup(n, 0.2, n as u64), n as u64);
        let initial = tree.internal_area();
        for iteration in 0..6 {
            tree = check_iteration(&tree, mu, iteration % mu as u32);
        }
        assert!(tree.internal_area() <= initial * (1.0 + 1e-6));
    }
}

/// What the worst-first order asks for: one order, a short climb.
#[test]
fn a_short_search_looks_at_less_and_gains_nearly_as_much() {
    let tree = tree_of(&soup(200, 0.1, 3), 3);
    let nodes = tree.encode();
    let list: Vec<u32> = (1..nodes.len() as u32 / 2).rev().collect();
    let whole = full(nodes.len());
    let short = DualParams { both_orders: 0, climb: 1, slack: 0.1, ..whole };
    let ((all, looked), (few, looked_short)) = (search(&nodes, &list, &whole), search(&nodes, &list, &short));
    assert!(2 * looked_short[VISITS] < looked[VISITS], "{} and {} visits", looked_short[VISITS], looked[VISITS]);
    for found in few.iter().filter(|found| found.output != NO_NODE) {
        let dual = DualMove::new(&nodes[..], found);
        let measured = measured_area_decrease(&tree, &dual);
        assert!((measured - f64::from(found.area_decrease)).abs() < 1e-5 * half_area(&tree.boxes[0]), "{dual:?}");
    }
    let gain = |found: &[Move]| found.iter().map(|found| f64::from(found.area_decrease)).sum::<f64>();
    let part = gain(&few) / gain(&all);
    assert!(part > 0.7 && part < 1.0, "{part}");
}

/// The search would take more rounds than it may.
#[test]
fn a_search_over_the_bound_moves_nothing_on_any_device() {
    let nodes = row_comb(20_000).encode();
    let list: Vec<u32> = (498..nodes.len() as u32 / 2).step_by(499).collect();
    let (_, report) = search(&nodes, &list, &full(nodes.len()));
    // The deepest inputs are past the bound, and the topmost ones are not.
    assert_eq!(report[MOST_STEPS], MAX_ROUNDS);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn degenerate_trees_stay_trees(
        triangles in on_a_lattice(40),
        seed in any::<u64>(),
        mu in 1usize..4,
    ) {
        let mut tree = tree_of(&triangles, seed);
        for iteration in 0..4 {
            tree = check_iteration(&tree, mu, iteration % mu as u32);
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

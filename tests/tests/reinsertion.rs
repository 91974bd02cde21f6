//! The kernels of the single moves against brute force.

use prbvh_kernel::Kernel;
use prbvh_kernel::node::NO_NODE;
use prbvh_kernel::prbvh::worst::books::BOOKS_WORDS;
use prbvh_kernel::prbvh::{Move, PrbvhParams, WON};
use prbvh_kernel::status::{FAULTS, FOUND, OWNED, PREDICTED, REPORT_WORDS};
use prbvh_kernel::sum::scale_of;
use prbvh_tests::compare::Case;
use prbvh_tests::fixtures::{on_a_lattice, soup, stiff};
use prbvh_tests::footprint::topology;
use prbvh_tests::locks::{Checked, Claimant, fault_of, lock_and_check};
use prbvh_tests::moved::{kept_fault, nothing_kept, paths_fault, reinsert};
use prbvh_tests::oracle::{NaiveTree, half_area, tree_of};
use proptest::prelude::*;

const REPORT: usize = REPORT_WORDS as usize;

fn params(mu: u32, first: u32, nodes: usize) -> PrbvhParams {
    PrbvhParams::every(mu, first, nodes as u32)
}

fn search(tree: &NaiveTree, params: &PrbvhParams) -> (Vec<Move>, Vec<u32>) {
    let case = Case::new(Kernel::PrbvhSearch, params.count, params).with(&tree.encode());
    let result = case.zeros(params.count.max(1) as usize).zeros(BOOKS_WORDS as usize).zeros(REPORT).run_everywhere();
    (result.get("found"), result.get("report"))
}

/// The search finds the best output, and its decrease is the measured one.
fn check_search(tree: &NaiveTree) {
    let params = params(1, 0, tree.children.len());
    let (found, report) = search(tree, &params);
    let scale = half_area(&tree.boxes[0]);
    assert_eq!(report[FAULTS], 0);
    assert_eq!(report[FOUND] as usize, found.iter().filter(|found| found.output != NO_NODE).count());
    assert_eq!(found[0], Move::NONE, "the root stays");
    for (input, found) in (0u32..).zip(&found).skip(1) {
        let best = tree
            .outputs(input)
            .into_iter()
            .map(|output| tree.measured_area_decrease(input, output))
            .fold(0.0, f64::max);
        if found.output == NO_NODE {
            assert!(best < 1e-4 * scale, "a decrease of {best} for {input} was missed");
        } else {
            let measured = tree.measured_area_decrease(input, found.output);
            let said = f64::from(found.area_decrease);
            assert!((measured - said).abs() < 1e-5 * scale, "{input}: said {said}, measured {measured}");
            assert!(best - measured < 1e-5 * scale, "{input}: {measured} found, {best} possible");
        }
    }
}

#[test]
fn the_search_finds_the_best_output_in_small_trees() {
    for n in [1, 2, 3, 4, 5, 8, 30] {
        for seed in 0..4 {
            check_search(&tree_of(&soup(n, 0.3, seed), seed + 100));
        }
    }
}

#[test]
fn the_oracle_of_the_search_notices_a_wrong_decrease() {
    let tree = tree_of(&soup(30, 0.3, 1), 1);
    let (found, _) = search(&tree, &params(1, 0, tree.children.len()));
    let (input, found) = (0u32..).zip(found).find(|(_, found)| found.output != NO_NODE).unwrap();
    let measured = tree.measured_area_decrease(input, found.output);
    let wrong_output = tree.outputs(input).into_iter().find(|&output| output != found.output).unwrap();
    let planted = tree.measured_area_decrease(input, wrong_output);
    assert!((measured - f64::from(found.area_decrease)).abs() < 1e-5);
    assert!((planted - f64::from(found.area_decrease)).abs() > 1e-5);
}

#[test]
fn sparse_searches_take_every_mu_th_node() {
    let tree = tree_of(&soup(40, 0.3, 5), 5);
    let nodes = tree.children.len();
    let (all, _) = search(&tree, &params(1, 0, nodes));
    for mu in [2, 9, 78, 79, 1000] {
        for first in [0, 1, mu - 1] {
            let params = params(mu, first, nodes);
            let (sparse, _) = search(&tree, &params);
            for i in 0..params.count {
                assert_eq!(sparse[i as usize], all[params.input(i) as usize]);
            }
        }
    }
}

/// Search, lock, check, reinsert and refit, each against a naive version. Returns the tree after.
fn check_iteration(tree: &NaiveTree, mu: u32, first: u32) -> NaiveTree {
    let length = tree.children.len();
    let params = PrbvhParams { scale: scale_of(half_area(&tree.boxes[0])), ..params(mu, first, length) };
    let nodes = tree.encode();
    let (found, _) = search(tree, &params);
    let claimants: Vec<Claimant> = offers(&found, &params)
        .map(|found| Claimant::alone(*found, topology(tree, found.input, found.output)))
        .collect();
    let checked = lock_and_check(&nodes, &found, &vec![0; length], &params);
    assert_eq!(fault_of(&found, &claimants, &checked, params.scale), None);

    let moved = reinsert(&nodes, &checked.found, &nothing_kept(length), 1, &params);
    let winners: Vec<Move> = checked.found.iter().copied().filter(Move::has_won).collect();
    assert_eq!(moved.applied, winners.len());
    let mut expected = tree.clone();
    winners.iter().for_each(|found| expected.reinsert(found.input(), found.output));
    let mut after = NaiveTree::decode(&moved.nodes);
    assert_eq!(after.children, expected.children);
    assert_eq!(after.references[length / 2..], tree.references[length / 2..]);
    assert_eq!(kept_fault(tree, &moved, 1), None);
    assert_eq!(paths_fault(&moved, &params), None);
    after.refit(0);
    after
}

/// What a search found. A buffer has an element also where there is no input.
fn offers<'a>(found: &'a [Move], params: &PrbvhParams) -> impl Iterator<Item = &'a Move> {
    found.iter().take(params.count as usize).filter(|found| found.is_open())
}

/// The locks' comparer itself.
#[test]
fn a_move_that_should_not_have_won_is_noticed() {
    let tree = tree_of(&soup(40, 0.3, 1), 1);
    let params = PrbvhParams { scale: scale_of(half_area(&tree.boxes[0])), ..params(1, 0, tree.children.len()) };
    let (found, _) = search(&tree, &params);
    let claimants: Vec<Claimant> = offers(&found, &params)
        .map(|found| Claimant::alone(*found, topology(&tree, found.input, found.output)))
        .collect();
    let right = lock_and_check(&tree.encode(), &found, &vec![0; found.len()], &params);
    let fault = |checked: &Checked| fault_of(&found, &claimants, checked, params.scale);
    assert_eq!(fault(&right), None);
    let mut wrong = right.clone();
    wrong.found.iter_mut().find(|found| found.is_open()).unwrap().input |= WON;
    assert!(fault(&wrong).is_some(), "a loser moves");
    let mut wrong = right.clone();
    wrong.found.iter_mut().find(|found| found.has_won()).unwrap().input &= !WON;
    assert!(fault(&wrong).is_some(), "a winner stays");
    let mut wrong = right.clone();
    *wrong.locked.iter_mut().find(|lock| **lock != 0).unwrap() ^= 1;
    assert!(fault(&wrong).is_some(), "a lock");
    let mut wrong = right.clone();
    wrong.report[PREDICTED + 1] += 1;
    assert!(fault(&wrong).is_some(), "a promise");
    let mut wrong = right;
    wrong.report[OWNED] -= 1;
    assert!(fault(&wrong).is_some(), "a count");
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

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn degenerate_trees_stay_trees(
        triangles in on_a_lattice(24),
        seed in any::<u64>(),
        mu in 1u32..4,
    ) {
        let mut tree = tree_of(&triangles, seed);
        check_search(&tree);
        for iteration in 0..3 {
            tree = check_iteration(&tree, mu, iteration % mu);
        }
    }

    #[test]
    fn stiff_trees_stay_trees((triangles, seed) in stiff(24)) {
        let mut tree = tree_of(&triangles, seed);
        check_search(&tree);
        for _ in 0..3 {
            tree = check_iteration(&tree, 1, 0);
        }
    }
}

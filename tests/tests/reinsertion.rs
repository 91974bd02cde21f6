//! PRBVH's four kernels against brute force.

use prbvh_kernel::Kernel;
use prbvh_kernel::node::{NO_NODE, Node};
use prbvh_kernel::prbvh::{PrbvhParams, Reinsertion, lock_key};
use prbvh_kernel::status::{APPLIED, FAULTS, FOUND, OWNED, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::fixtures::{on_a_lattice, soup, stiff};
use prbvh_tests::footprint::topology;
use prbvh_tests::oracle::{NaiveTree, half_area, tree_of};
use proptest::prelude::*;
use std::collections::BTreeMap;

const REPORT: usize = REPORT_WORDS as usize;

fn params(mu: u32, first: u32, nodes: usize) -> PrbvhParams {
    PrbvhParams::every(mu, first, nodes as u32)
}

fn search(tree: &NaiveTree, params: &PrbvhParams) -> (Vec<Reinsertion>, Vec<u32>) {
    let case = Case::new(Kernel::PrbvhSearch, params.count, params).with(&tree.encode());
    let result = case.zeros(params.count.max(1) as usize).zeros(REPORT).run_everywhere();
    (result.get("found"), result.get("report"))
}

/// The search finds the best output, and its decrease is the measured one.
fn check_search(tree: &NaiveTree) {
    let params = params(1, 0, tree.children.len());
    let (found, report) = search(tree, &params);
    let scale = half_area(&tree.boxes[0]);
    assert_eq!(report[FAULTS], 0);
    assert_eq!(report[FOUND] as usize, found.iter().filter(|found| found.output != NO_NODE).count());
    assert_eq!(found[0], Reinsertion::NONE, "the root stays");
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

/// Search, lock, check and reinsert, each against a naive version. Returns the tree after.
fn check_iteration(tree: &NaiveTree, mu: u32, first: u32) -> NaiveTree {
    let nodes = tree.children.len();
    let params = params(mu, first, nodes);
    let (found, _) = search(tree, &params);
    let moves: Vec<(u32, Reinsertion)> = (0..params.count)
        .map(|i| (params.input(i), found[i as usize]))
        .filter(|(_, found)| found.output != NO_NODE)
        .collect();

    let mut locks = vec![0u64; nodes];
    for &(input, Reinsertion { area_decrease, output, .. }) in &moves {
        for v in topology(tree, input, output) {
            locks[v as usize] = locks[v as usize].max(lock_key(area_decrease, input));
        }
    }
    let case = Case::new(Kernel::PrbvhLock, params.count, &params).with(&tree.encode()).with(&found);
    assert_eq!(case.zeros(nodes).run_everywhere().get::<u64>("locks"), locks);

    // The locks of two words hold the same keys, upper and lower half.
    let case = Case::new(Kernel::PrbvhLockDecrease, params.count, &params).with(&tree.encode()).with(&found);
    let decreases = case.zeros(nodes).run_everywhere().get::<u32>("decreases");
    let case = Case::new(Kernel::PrbvhLockInput, params.count, &params).with(&tree.encode()).with(&found);
    let inputs = case.with(&decreases).zeros(nodes).run_everywhere().get::<u32>("inputs");
    let words = decreases.iter().zip(&inputs).map(|(&high, &low)| u64::from(high) << 32 | u64::from(low));
    assert_eq!(words.collect::<Vec<_>>(), locks);

    let owns = |&(input, Reinsertion { area_decrease, output, .. }): &(u32, Reinsertion)| {
        topology(tree, input, output).iter().all(|&v| locks[v as usize] == lock_key(area_decrease, input))
    };
    let owners: BTreeMap<u32, Reinsertion> = moves.iter().copied().filter(owns).collect();
    assert_eq!(owners.is_empty(), moves.is_empty(), "something moves whenever something was found");
    let case = Case::new(Kernel::PrbvhCheck, params.count, &params).with(&tree.encode()).with(&locks);
    let checked = case.with(&found).zeros(REPORT).run_everywhere();
    let case = Case::new(Kernel::PrbvhCheckWords, params.count, &params).with(&tree.encode());
    let checked_words = case.with(&decreases).with(&inputs).with(&found).zeros(REPORT).run_everywhere();
    let owned: Vec<Reinsertion> = checked.get("found");
    assert_eq!(owned, checked_words.get::<Reinsertion>("found"));
    assert_eq!(checked.get::<u32>("report")[OWNED] as usize, owners.len());
    for i in 0..params.count {
        let expected = owners.get(&params.input(i)).copied().unwrap_or(Reinsertion::NONE);
        assert_eq!(owned[i as usize], expected);
    }

    let case = Case::new(Kernel::PrbvhReinsert, params.count, &params).with(&owned).with(&tree.encode());
    let result = case.zeros(REPORT).run_everywhere();
    assert_eq!(result.get::<u32>("report")[APPLIED] as usize, owners.len());
    let mut expected = tree.clone();
    for (&input, found) in &owners {
        expected.reinsert(input, found.output);
    }
    let mut after = NaiveTree::decode(&result.get::<Node>("nodes"));
    assert_eq!(after.children, expected.children);
    assert_eq!(after.references[nodes / 2..], tree.references[nodes / 2..]);
    after.refit(0);
    check_paths(&params, &result.get::<Reinsertion>("found"), &result.get::<Node>("nodes"), &after);
    after
}

/// The refit of changed paths gives every node the box that a refit of all gives it, and leaves all counts at 0.
fn check_paths(params: &PrbvhParams, found: &[Reinsertion], nodes: &[Node], expected: &NaiveTree) {
    let internal = nodes.len() / 2;
    let case = Case::new(Kernel::PrbvhMarkPaths, params.count, params).with(found).with(nodes);
    let marked = case.zeros(internal.max(1)).run_everywhere();
    let ways: Vec<u32> = marked.get("ways");
    let case = Case::new(Kernel::PrbvhRefitPaths, params.count, params).with(found).with(nodes);
    let result = case.with(&ways).run_everywhere();
    assert_eq!(NaiveTree::decode(&result.get::<Node>("nodes")).boxes, expected.boxes);
    assert!(result.get::<u32>("ways").iter().all(|&ways| ways == 0));
    // Nobody passes a node that no move is below.
    assert!(ways.iter().filter(|&&ways| ways > 0).count() <= internal);
    // A buffer has an element where there is no input.
    let moves = found.iter().take(params.count as usize).any(|found| found.output != NO_NODE);
    assert_eq!(ways.iter().any(|&ways| ways > 0), moves);
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

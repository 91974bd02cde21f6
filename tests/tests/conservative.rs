//! The conservative strategy against its definition: what runs side by side changes the tree as each does alone.

use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::prbvh::lock::lock_key;
use prbvh_kernel::prbvh::worst::books::BOOKS_WORDS;
use prbvh_kernel::prbvh::{CONSERVATIVE, Move, PrbvhParams};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{FAULTS, FOUND, REPORT_WORDS};
use prbvh_kernel::sum::scale_of;
use prbvh_tests::compare::Case;
use prbvh_tests::fixtures::{grid, on_a_lattice, soup, stiff};
use prbvh_tests::footprint::{Footprint, additivity_fault, sum_fault};
use prbvh_tests::locks::{Claimant, fault_of, lock_and_check, locks};
use prbvh_tests::moved::{nothing_kept, reinsert};
use prbvh_tests::oracle::{NaiveTree, comb, half_area, random_tree, tree_of};
use proptest::prelude::*;
use std::collections::BTreeMap;

const REPORT: usize = REPORT_WORDS as usize;

fn params(mu: u32, first: u32, nodes: usize) -> PrbvhParams {
    PrbvhParams::every(mu, first, nodes as u32)
}

/// A search of all nodes of an iteration.
fn search(tree: &NaiveTree, params: &PrbvhParams) -> Vec<Move> {
    let case = Case::new(Kernel::PrbvhSearch, params.count, params).with(&tree.encode());
    let result = case.zeros(params.count.max(1) as usize).zeros(BOOKS_WORDS as usize).zeros(REPORT).run_everywhere();
    assert_eq!(result.get::<u32>("report")[FAULTS], 0);
    result.get("found")
}

/// A move that the search found, and what it does.
#[derive(Clone, Debug)]
struct Offer {
    found: Move,
    footprint: Footprint,
}

impl Offer {
    fn key(&self) -> u64 {
        lock_key(self.found.area_decrease, self.footprint.input)
    }

    fn claimant(&self) -> Claimant {
        let Footprint { written, read, .. } = &self.footprint;
        Claimant { found: self.found, written: written.clone(), read: read.clone() }
    }
}

/// All moves that were found.
fn offers(tree: &NaiveTree, params: &PrbvhParams, found: &[Move]) -> Vec<Offer> {
    let open = found.iter().take(params.count as usize).filter(|found| found.is_open());
    open.map(|&found| Offer { found, footprint: Footprint::of(tree, found.input, found.output) }).collect()
}

/// Those that keep all their nodes.
fn naive_check(nodes: usize, offers: &[Offer]) -> Vec<Footprint> {
    let claimants: Vec<Claimant> = offers.iter().map(Offer::claimant).collect();
    let locks = locks(nodes, &claimants);
    let stays = claimants.iter().map(|each| each.wins(&locks));
    offers.iter().zip(stays).filter(|(_, stays)| *stays).map(|(offer, _)| offer.footprint.clone()).collect()
}

/// Search, lock, check and reinsert of one iteration on every device, each against a naive version, and the claim about their boxes.
/// Returns the tree after.
fn check_iteration(tree: &NaiveTree, mu: u32, first: u32) -> NaiveTree {
    let nodes = tree.children.len();
    let scale = scale_of(half_area(&tree.boxes[0]));
    let params = PrbvhParams { flags: CONSERVATIVE, scale, ..params(mu, first, nodes) };
    let found = search(tree, &params);
    let offers = offers(tree, &params, &found);
    for each in &offers {
        assert_eq!(each.found.other, each.footprint.top, "{each:?}");
    }
    let claimants: Vec<Claimant> = offers.iter().map(Offer::claimant).collect();
    let checked = lock_and_check(&tree.encode(), &found, &vec![0; nodes], &params);
    assert_eq!(fault_of(&found, &claimants, &checked, scale), None);

    let moved = reinsert(&tree.encode(), &checked.found, &nothing_kept(nodes), 1, &params);
    let stay = naive_check(nodes, &offers);
    assert_eq!(moved.applied, stay.len());
    let mut after = NaiveTree::decode(&moved.nodes);
    after.refit(0);
    assert_eq!(additivity_fault(tree, &stay), None);
    assert_eq!(sum_fault(tree, &after, &stay), None);
    assert!(after.internal_area() <= tree.internal_area() * (1.0 + 1e-12), "the areas rise");
    after
}

fn iterate(mut tree: NaiveTree, mu: u32, iterations: u32) -> NaiveTree {
    for iteration in 0..iterations {
        tree = check_iteration(&tree, mu, iteration % mu);
    }
    tree
}

#[test]
fn iterations_take_off_what_each_move_takes_off_alone() {
    for (n, mu) in [(1, 1), (2, 1), (3, 1), (4, 1), (40, 1), (40, 3), (300, 9), (300, 1)] {
        let tree = tree_of(&soup(n, 0.2, n as u64), n as u64);
        let before = tree.internal_area();
        let after = iterate(tree, mu, 5).internal_area();
        assert!(n < 40 || after < 0.9 * before, "{n} triangles: {before} → {after}");
    }
}

#[test]
fn ties_duplicates_and_flat_scenes_too() {
    iterate(tree_of(&grid(12), 1), 1, 4);
    iterate(tree_of(&grid(8).repeat(2), 2), 2, 4);
    iterate(tree_of(&vec![soup(1, 0.5, 0)[0]; 30], 3), 1, 2);
    let line = |k: u8| Triangle { a: [f32::from(k), 0.0, 0.0], b: [f32::from(k) + 1.5, 0.0, 0.0], c: [0.0; 3] };
    iterate(tree_of(&(0..40).map(line).collect::<Vec<_>>(), 4), 1, 3);
}

/// A box of height and width 1.
fn bar(from: f32, to: f32) -> Aabb {
    Aabb { min: [from, 0.0, 0.0], max: [to, 1.0, 1.0] }
}

#[test]
fn paths_have_no_limit() {
    // Each leaf but the second fills its parent; that one belongs beside the last, 300 levels down.
    let mut boxes: Vec<Aabb> = (1..=300u16).rev().map(|k| bar(0.0, f32::from(k))).collect();
    boxes[1] = bar(0.0, 0.25);
    let tree = comb(&boxes);
    let params = params(1, 0, tree.children.len());
    let offers = offers(&tree, &params, &search(&tree, &params));
    let longest = offers.iter().map(|each| each.footprint.up.len() + each.footprint.down.len()).max();
    assert!(longest > Some(127), "the longest path has {longest:?} nodes");
    let stay = naive_check(tree.children.len(), &offers);
    assert!(stay.iter().any(|each| each.down.len() > 127), "it moves");
    check_iteration(&tree, 1, 0);
}

/// Owners of their topology nodes: the aggressive strategy.
fn aggressive(offers: &[Offer]) -> Vec<Footprint> {
    let rivals = |a: &Offer, b: &Offer| a.key() < b.key() && !a.footprint.topology.is_disjoint(&b.footprint.topology);
    let stays = |a: &&Offer| !offers.iter().any(|b| rivals(a, b));
    offers.iter().filter(stays).map(|each| each.footprint.clone()).collect()
}

/// Those that a check like that of the authors' code would keep: paths are locked with flags, and a loser is compared with the holder alone.
fn published(offers: &[Offer]) -> Vec<Footprint> {
    const TOPOLOGY: u8 = 4;
    const UP: u8 = 2;
    const CHANGES: u8 = 1;
    let flags = |each: &Offer| -> BTreeMap<u32, u8> {
        let Footprint { up, down, pivot, written, topology, shrunk_to, .. } = &each.footprint;
        let changes = |v: &u32| if written.contains(v) && Some(*v) != *shrunk_to { CHANGES } else { 0 };
        let mut flags: BTreeMap<u32, u8> = up.iter().map(|v| (*v, UP | changes(v))).collect();
        flags.extend(down.iter().map(|v| (*v, changes(v))));
        flags.insert(*pivot, 0);
        for &v in topology {
            *flags.entry(v).or_default() |= TOPOLOGY;
        }
        flags
    };
    let flags: Vec<BTreeMap<u32, u8>> = offers.iter().map(flags).collect();
    let holder = |v: u32| {
        let users = (0..offers.len()).filter(|&k| flags[k].contains_key(&v));
        users.max_by_key(|&k| offers[k].key()).expect("it is used")
    };
    let stays = |a: usize| {
        flags[a].iter().all(|(&v, &own)| {
            let b = holder(v);
            let other = flags[b][&v];
            let both = |bit| own & bit != 0 && other & bit != 0;
            let (up, changes) = (own & UP != 0, own & CHANGES != 0);
            a == b
                || !(own & TOPOLOGY != 0
                    || (other & TOPOLOGY != 0 && v != offers[a].footprint.pivot)
                    || both(CHANGES)
                    || (up && changes && other & UP == 0)
                    || (!up && !changes && other & UP != 0 && other & CHANGES != 0))
        })
    };
    (0..offers.len()).filter(|&a| stays(a)).map(|a| offers[a].footprint.clone()).collect()
}

/// Random trees until `keep` lets moves through of which the sum or a box is not what it would be alone.
fn finds_a_fault(keep: impl Fn(&[Offer]) -> Vec<Footprint>) -> Option<String> {
    (0..600).find_map(|seed| {
        let n = 20 + seed as usize % 50;
        let mut triangles = soup(n, 0.3, seed);
        if seed % 2 == 1 {
            // Boxes that share faces.
            let coarse = |p: [f32; 3]| p.map(|x| (x * 6.0).round());
            for t in &mut triangles {
                *t = Triangle { a: coarse(t.a), b: coarse(t.b), c: coarse(t.c) };
            }
        }
        let tree = tree_of(&triangles, seed);
        let params = params(1, 0, tree.children.len());
        let case = Case::new(Kernel::PrbvhSearch, params.count, &params).with(&tree.encode());
        let mut cpu = prbvh::device::cpu::CpuDevice::new(1).unwrap();
        let result =
            case.zeros(params.count as usize).zeros(BOOKS_WORDS as usize).zeros(REPORT).run_on(&mut cpu).unwrap();
        assert!(result.get::<u32>("report")[FOUND] > 0);
        let kept = keep(&offers(&tree, &params, &result.get::<Move>("found")));
        let mut together = tree.clone();
        for a in &kept {
            together.reinsert(a.input, a.output);
        }
        together.refit(0);
        sum_fault(&tree, &together, &kept)
    })
}

#[test]
fn the_oracle_goes_red_for_weaker_rules() {
    assert!(finds_a_fault(aggressive).is_some(), "aggressive");
    assert!(finds_a_fault(published).is_some(), "published");
    // No part of a footprint can be spared.
    type Spared = fn(&Footprint) -> Option<u32>;
    let spared: [(&str, Spared); 3] = [
        ("top", |a| Some(a.top)),
        ("first above the input that keeps its box", |a| a.shrunk_to),
        ("stop", |a| Some(a.grown_to)),
    ];
    for (name, spared) in spared {
        let without = |offers: &[Offer]| -> Vec<Footprint> {
            let mut offers = offers.to_vec();
            for Offer { footprint, .. } in &mut offers {
                let spared = spared(footprint).filter(|v| !footprint.topology.contains(v));
                if let Some(v) = spared {
                    footprint.read.remove(&v);
                    footprint.written.remove(&v);
                }
            }
            naive_check(offers[0].footprint.alone.children.len(), &offers)
        };
        assert!(finds_a_fault(without).is_some(), "without the {name}");
    }
    let whole = |offers: &[Offer]| -> Vec<Footprint> { naive_check(offers[0].footprint.alone.children.len(), offers) };
    assert_eq!(finds_a_fault(whole), None);
}

#[test]
fn a_pivot_that_stops_the_growth_is_read() {
    // 0 (1 (2 (3 (4 (10, 5 (11, 12)), 9), 8), 6 (13, 14)), 7 (15, 16)): 11 leaves 3, which does not feel it, for 6, which grows; 3 itself
    // leaves 1 for 7. Made together, 1 is left with 11.
    let leaves: [(u8, u8); 9] =
        [(0, 1), (100, 110), (100, 110), (103, 104), (109, 110), (101, 102), (2, 3), (95, 115), (95, 115)];
    let boxes: Vec<Aabb> = leaves.iter().map(|&(from, to)| bar(from.into(), to.into())).collect();
    let mut tree = random_tree(&boxes, 0);
    let children = [[1, 7], [2, 6], [3, 8], [4, 9], [10, 5], [11, 12], [13, 14], [15, 16]];
    for (v, children) in children.into_iter().enumerate() {
        tree.children[v] = children.to_vec();
    }
    tree.refit(0);
    let mut moves = [Footprint::of(&tree, 3, 15), Footprint::of(&tree, 11, 13)];
    for a in &moves {
        assert!(a.alone.internal_area() < tree.internal_area());
    }
    assert_eq!((moves[1].pivot, moves[1].grown_to), (1, 1));
    assert!(!moves[0].is_compatible(&moves[1]));
    moves[1].read.remove(&1);
    assert!(moves[0].is_compatible(&moves[1]));
    assert!(additivity_fault(&tree, &moves).is_some_and(|fault| fault.contains("box of 1")));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn degenerate_trees_add_up(
        triangles in on_a_lattice(40),
        seed in any::<u64>(),
        mu in 1u32..4,
    ) {
        iterate(tree_of(&triangles, seed), mu, 3);
    }

    #[test]
    fn stiff_trees_add_up((triangles, seed) in stiff(40)) {
        iterate(tree_of(&triangles, seed), 1, 3);
    }
}

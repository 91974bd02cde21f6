//! The conservative strategy against its definition: what runs side by side changes the tree as each does alone.

use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{NO_NODE, Node};
use prbvh_kernel::prbvh::conservative::claim;
use prbvh_kernel::prbvh::decrease::{DECREASE_CHUNK, DecreaseParams};
use prbvh_kernel::prbvh::{PrbvhParams, Reinsertion, lock_key};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{APPLIED, FAULTS, FOUND, OWNED, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::fixtures::{grid, on_a_lattice, soup, stiff};
use prbvh_tests::footprint::{Footprint, additivity_fault, sum_fault};
use prbvh_tests::oracle::{NaiveTree, random_tree, tree_of};
use proptest::prelude::*;
use std::collections::BTreeMap;

const REPORT: usize = REPORT_WORDS as usize;

fn params(mu: u32, first: u32, nodes: usize) -> PrbvhParams {
    PrbvhParams::every(mu, first, nodes as u32)
}

/// `found` and `tops` of the search, compared with the search of the aggressive strategy.
fn search(tree: &NaiveTree, params: &PrbvhParams) -> (Vec<Reinsertion>, Vec<u32>) {
    let length = params.count.max(1) as usize;
    let case = |kernel| Case::new(kernel, params.count, params).with(&tree.encode()).zeros(length);
    let with_tops = case(Kernel::PrbvhSearchTop).zeros(length).zeros(REPORT).run_everywhere();
    let without = case(Kernel::PrbvhSearch).zeros(REPORT).run_everywhere();
    let found: Vec<Reinsertion> = with_tops.get("found");
    assert_eq!(found, without.get::<Reinsertion>("found"));
    let report: Vec<u32> = with_tops.get("report");
    assert_eq!(report, without.get::<u32>("report"));
    assert_eq!(report[FAULTS], 0);
    (found, with_tops.get("tops"))
}

/// A move that the search found, and the key of its locks without the claim's kind.
#[derive(Clone, Debug)]
struct Move {
    area_decrease: f32,
    footprint: Footprint,
}

impl Move {
    fn key(&self) -> u64 {
        lock_key(self.area_decrease, self.footprint.input)
    }

    fn lock(&self, written: bool) -> u64 {
        lock_key(self.area_decrease, claim(self.footprint.input, written))
    }
}

/// All moves that were found.
fn moves(tree: &NaiveTree, params: &PrbvhParams, found: &[Reinsertion]) -> Vec<Move> {
    (0..params.count)
        .map(|i| (params.input(i), found[i as usize]))
        .filter(|(_, found)| found.output != NO_NODE)
        .map(|(input, found)| Move {
            area_decrease: found.area_decrease,
            footprint: Footprint::of(tree, input, found.output),
        })
        .collect()
}

/// The locks and those that stay.
fn naive_check(nodes: usize, moves: &[Move]) -> (Vec<u64>, BTreeMap<u32, Move>) {
    let mut locks = vec![0u64; nodes];
    for each in moves {
        let Footprint { written, read, .. } = &each.footprint;
        for (&v, lock) in written.iter().map(|v| (v, each.lock(true))).chain(read.iter().map(|v| (v, each.lock(false))))
        {
            locks[v as usize] = locks[v as usize].max(lock);
        }
    }
    let stays = |each: &&Move| {
        let Footprint { written, read, .. } = &each.footprint;
        written.iter().all(|&v| locks[v as usize] == each.lock(true))
            && read.iter().all(|&v| locks[v as usize] == each.lock(false) || locks[v as usize] & 1 == 0)
    };
    let stay = moves.iter().filter(stays).map(|each| (each.footprint.input, each.clone())).collect();
    (locks, stay)
}

/// Search, lock, check, sum and reinsert of one iteration on every device, each against a naive version, and the claim about their boxes.
/// Returns the tree after.
fn check_iteration(tree: &NaiveTree, mu: u32, first: u32) -> NaiveTree {
    let nodes = tree.children.len();
    let params = params(mu, first, nodes);
    let (found, tops) = search(tree, &params);
    let moves = moves(tree, &params, &found);
    for each in &moves {
        assert_eq!(tops[((each.footprint.input - first) / mu) as usize], each.footprint.top);
    }
    let (locks, stay) = naive_check(nodes, &moves);
    if let Some(first) = moves.iter().max_by_key(|each| each.key()) {
        assert!(stay.contains_key(&first.footprint.input), "the largest key stays");
    }

    let case = |kernel| Case::new(kernel, params.count, &params).with(&tree.encode());
    let lock = |kernel| case(kernel).with(&found).with(&tops);
    assert_eq!(lock(Kernel::ConservativeLock).zeros(nodes).run_everywhere().get::<u64>("locks"), locks);
    // The locks of two words hold the same keys, upper and lower half.
    let decreases = lock(Kernel::ConservativeLockDecrease).zeros(nodes).run_everywhere().get::<u32>("decreases");
    let inputs = lock(Kernel::ConservativeLockInput).with(&decreases).zeros(nodes).run_everywhere();
    let inputs = inputs.get::<u32>("inputs");
    let words = decreases.iter().zip(&inputs).map(|(&high, &low)| u64::from(high) << 32 | u64::from(low));
    assert_eq!(words.collect::<Vec<_>>(), locks);

    let checked = case(Kernel::ConservativeCheck).with(&tops).with(&locks);
    let checked = checked.with(&found).zeros(REPORT).run_everywhere();
    let words = case(Kernel::ConservativeCheckWords).with(&tops).with(&decreases).with(&inputs);
    let words = words.with(&found).zeros(REPORT).run_everywhere();
    let kept: Vec<Reinsertion> = checked.get("found");
    assert_eq!(kept, words.get::<Reinsertion>("found"));
    assert_eq!(checked.get::<u32>("report")[OWNED] as usize, stay.len());
    for i in 0..params.count {
        let expected = if stay.contains_key(&params.input(i)) { found[i as usize] } else { Reinsertion::NONE };
        assert_eq!(kept[i as usize], expected, "{}", params.input(i));
    }
    check_sums(&kept, params.count);

    let case = Case::new(Kernel::PrbvhReinsert, params.count, &params).with(&kept).with(&tree.encode());
    let result = case.zeros(REPORT).run_everywhere();
    assert_eq!(result.get::<u32>("report")[APPLIED] as usize, stay.len());
    let mut after = NaiveTree::decode(&result.get::<Node>("nodes"));
    after.refit(0);
    let footprints: Vec<Footprint> = stay.into_values().map(|each| each.footprint).collect();
    assert_eq!(additivity_fault(tree, &footprints), None);
    assert_eq!(sum_fault(tree, &after, &footprints), None);
    assert!(after.internal_area() <= tree.internal_area() * (1.0 + 1e-12), "the areas rise");
    after
}

/// The partial sums of decreases have the precision of one rounding, and lie where they were asked for.
fn check_sums(found: &[Reinsertion], count: u32) {
    let chunks = count.div_ceil(DECREASE_CHUNK);
    let params = DecreaseParams { count: chunks, found: count, first: 3 };
    let case = Case::new(Kernel::PrbvhDecrease, chunks, &params).with(found).zeros(chunks as usize + 4);
    let partial = case.run_everywhere().get::<f32>("partial");
    assert!(partial[..3].iter().chain(&partial[3 + chunks as usize..]).all(|&sum| sum == 0.0));
    for (chunk, &sum) in found[..count as usize].chunks(DECREASE_CHUNK as usize).zip(&partial[3..]) {
        let exact: f64 = chunk.iter().map(|found| f64::from(found.area_decrease)).sum();
        assert!((f64::from(sum) - exact).abs() <= 1.5e-7 * exact, "{sum}, not {exact}");
    }
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

/// A comb: internal node `k` holds leaf `k` and the rest, and the last two leaves end it.
fn comb(boxes: &[Aabb]) -> NaiveTree {
    let n = boxes.len();
    let mut tree = tree_of(&soup(n, 0.1, 0), 0);
    tree.boxes[n - 1..].copy_from_slice(boxes);
    for v in 0..n - 1 {
        let rest = if v + 2 < n { v + 1 } else { 2 * n - 2 };
        tree.children[v] = vec![(n - 1 + v) as u32, rest as u32];
    }
    tree.refit(0);
    tree
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
    let moves = moves(&tree, &params, &search(&tree, &params).0);
    let longest = moves.iter().map(|each| each.footprint.up.len() + each.footprint.down.len()).max();
    assert!(longest > Some(127), "the longest path has {longest:?} nodes");
    let (_, stay) = naive_check(tree.children.len(), &moves);
    assert!(stay.values().any(|each| each.footprint.down.len() > 127), "it moves");
    check_iteration(&tree, 1, 0);
}

/// Owners of their topology nodes: the aggressive strategy.
fn aggressive(moves: &[Move]) -> Vec<Footprint> {
    let rivals = |a: &Move, b: &Move| a.key() < b.key() && !a.footprint.topology.is_disjoint(&b.footprint.topology);
    let stays = |a: &&Move| !moves.iter().any(|b| rivals(a, b));
    moves.iter().filter(stays).map(|each| each.footprint.clone()).collect()
}

/// Those that a check like that of the authors' code would keep: paths are locked with flags, and a loser is compared with the holder alone.
fn published(moves: &[Move]) -> Vec<Footprint> {
    const TOPOLOGY: u8 = 4;
    const UP: u8 = 2;
    const CHANGES: u8 = 1;
    let flags = |each: &Move| -> BTreeMap<u32, u8> {
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
    let flags: Vec<BTreeMap<u32, u8>> = moves.iter().map(flags).collect();
    let holder = |v: u32| {
        let users = (0..moves.len()).filter(|&k| flags[k].contains_key(&v));
        users.max_by_key(|&k| moves[k].key()).expect("it is used")
    };
    let stays = |a: usize| {
        flags[a].iter().all(|(&v, &own)| {
            let b = holder(v);
            let other = flags[b][&v];
            let both = |bit| own & bit != 0 && other & bit != 0;
            let (up, changes) = (own & UP != 0, own & CHANGES != 0);
            a == b
                || !(own & TOPOLOGY != 0
                    || (other & TOPOLOGY != 0 && v != moves[a].footprint.pivot)
                    || both(CHANGES)
                    || (up && changes && other & UP == 0)
                    || (!up && !changes && other & UP != 0 && other & CHANGES != 0))
        })
    };
    (0..moves.len()).filter(|&a| stays(a)).map(|a| moves[a].footprint.clone()).collect()
}

/// Random trees until `keep` lets moves through of which the sum or a box is not what it would be alone.
fn finds_a_fault(keep: impl Fn(&[Move]) -> Vec<Footprint>) -> Option<String> {
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
        let result = case.zeros(params.count as usize).zeros(REPORT).run_on(&mut cpu).unwrap();
        assert!(result.get::<u32>("report")[FOUND] > 0);
        let kept = keep(&moves(&tree, &params, &result.get::<Reinsertion>("found")));
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
        let without = |moves: &[Move]| -> Vec<Footprint> {
            let mut moves = moves.to_vec();
            for Move { footprint, .. } in &mut moves {
                let spared = spared(footprint).filter(|v| !footprint.topology.contains(v));
                if let Some(v) = spared {
                    footprint.read.remove(&v);
                    footprint.written.remove(&v);
                }
            }
            let nodes = moves[0].footprint.alone.children.len();
            naive_check(nodes, &moves).1.into_values().map(|each| each.footprint).collect()
        };
        assert!(finds_a_fault(without).is_some(), "without the {name}");
    }
    let whole = |moves: &[Move]| -> Vec<Footprint> {
        let nodes = moves[0].footprint.alone.children.len();
        naive_check(nodes, moves).1.into_values().map(|each| each.footprint).collect()
    };
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

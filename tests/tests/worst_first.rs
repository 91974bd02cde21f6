//! Worst first: the whole run on every device, round by round.

use bytemuck::Zeroable;
use prbvh::build::{DeviceTree, UnfitTree};
use prbvh::bvh::{tree_hash, validate};
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{Limits, OptimizeError, PrbvhSettings, StopReason, WorstFirst, prbvh, prbvh_unchecked};
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene::Scene;
use prbvh_kernel::Kernel;
use prbvh_kernel::node::{NO_NODE, Node, RIGHT, ROOT};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BOOKS_WORDS, CLOSE, FRINGE_LENGTH, FRINGE_SIDE, POOL_LENGTH, POOL_SIDE};
use prbvh_kernel::prbvh::worst::keys::{COLD, IN_POOL};
use prbvh_kernel::prbvh::{DUAL, Move, PrbvhParams, WON};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{FAULT_BROKEN_TREE, FAULTS, REPORT_WORDS, SHRUNK};
use prbvh_tests::compare::Case;
use prbvh_tests::devices::{cpu_devices, devices, with_devices};
use prbvh_tests::fixtures::{flat, grid, inputs, nested, on_a_lattice, soup, stiff};
use prbvh_tests::hidden::Hidden;
use prbvh_tests::oracle::{NaiveTree, tree_of};
use prbvh_tests::worst::{Round, watched};
use proptest::prelude::*;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

fn settings(worst_first: WorstFirst) -> PrbvhSettings {
    PrbvhSettings::default().with(|s| {
        s.worst_first = worst_first;
        s.news = Duration::ZERO;
    })
}

/// Few nodes at first, and soon all of them.
fn broad(lock_rounds: u32, most_part: f64) -> PrbvhSettings {
    let growth = 4.0;
    settings(WorstFirst::default().with(|s| {
        s.first = 2;
        s.growth = growth;
        s.lock_rounds = lock_rounds;
        s.most_part = most_part;
        s.tail_part = most_part;
    }))
    .with(|s| s.limits = Limits::iterations(25))
}

/// Tree, cost and counts of every row.
type Rows = Vec<(u64, [u32; 4], Vec<(u32, u32)>)>;

/// A run. An observer finds at every row a tree with the boxes that a refit of all would give it.
fn run(tree: &NaiveTree, settings: &PrbvhSettings, device: &mut dyn Device) -> Rows {
    let uploaded = DeviceTree::upload(device, &tree.encode()).unwrap();
    let mut rows = Vec::new();
    let outcome = prbvh(device, &uploaded, settings, &mut |row, tree, device| {
        let nodes = tree.download(device).unwrap();
        let mut fresh = NaiveTree::decode(&nodes);
        fresh.refit(0);
        assert!(fresh.boxes.iter().zip(&nodes).all(|(fresh, node)| *fresh == node.aabb()), "row {}", row.iteration);
        let links = nodes.iter().map(|node| (node.up, node.down)).collect();
        rows.push((row.cost.to_bits(), [row.searched, row.found, row.owned, row.applied], links));
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(matches!(outcome.stop, StopReason::Converged | StopReason::MaxIterations), "{:?}", outcome.stop);
    let best = NaiveTree::decode(&uploaded.download(device).unwrap());
    assert!(best.internal_area() <= tree.internal_area() * (1.0 + 1e-6));
    uploaded.free(device);
    rows
}

/// The same rows on every device, with locks of one word and of two. Returns them.
fn same_everywhere(tree: &NaiveTree, settings: &PrbvhSettings) -> Rows {
    with_devices(|devices| {
        let mut first: Option<Rows> = None;
        for (name, device) in devices {
            let rows = run(tree, settings, &mut **device);
            let narrow = run(tree, settings, &mut Hidden::narrow(&mut **device));
            assert!(rows == narrow, "{name}: locks of two words");
            assert!(first.as_ref().is_none_or(|first| *first == rows), "{name}");
            first = Some(rows);
        }
        first.unwrap()
    })
}

#[test]
fn every_round_is_the_same_tree_on_every_device() {
    for lock_rounds in 1..=4 {
        let rows = same_everywhere(&tree_of(&soup(300, 0.1, 1), 1), &broad(lock_rounds, 1.0));
        assert!(rows.len() > 5, "{} rows", rows.len());
        assert!(rows.iter().any(|(_, [searched, ..], _)| *searched > 250), "{lock_rounds}: a round over most nodes");
    }
}

#[test]
fn a_new_top_is_a_better_tree_and_the_same_on_every_device() {
    let tree = tree_of(&soup(2500, 0.05, 6), 7);
    let rows = same_everywhere(
        &tree,
        &settings(WorstFirst::default().with(|s| {
            s.most_part = 0.2;
            s.tail_part = 0.0;
        })),
    );
    let costs: Vec<f64> = rows.iter().map(|(cost, ..)| f64::from_bits(*cost)).collect();
    // Nothing was searched, and yet the links are others.
    let renewed = |&k: &usize| rows[k].1 == [0; 4] && rows[k].2 != rows[k - 1].2;
    let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let tops: Vec<usize> = (1..rows.len()).filter(renewed).collect();
    assert!(!tops.is_empty() && costs.last() == Some(&best), "tops in rows {tops:?}, {best} of {costs:?}");
    for k in tops {
        let before = costs[..k].iter().copied().fold(f64::INFINITY, f64::min);
        assert!(costs[k] <= before, "row {k}: {} after {before}", costs[k]);
    }
}

#[test]
fn unkind_boxes_make_trees_too() {
    let pick = ["one", "two", "three", "equal", "points", "eight decades", "pairs"];
    for (name, triangles) in inputs().into_iter().filter(|(name, _)| pick.contains(name)) {
        println!("{name}");
        same_everywhere(&tree_of(&triangles[..triangles.len().min(200)], 3), &broad(2, 1.0));
    }
    for triangles in [flat(150), nested(150), grid(12)] {
        same_everywhere(&tree_of(&triangles, 4), &broad(3, 0.3));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn degenerate_trees_stay_trees(triangles in on_a_lattice(60), seed in any::<u64>(), lock_rounds in 1u32..5) {
        same_everywhere(&tree_of(&triangles, seed), &broad(lock_rounds, 1.0));
    }

    #[test]
    fn stiff_trees_stay_trees((triangles, seed) in stiff(60), lock_rounds in 1u32..5) {
        same_everywhere(&tree_of(&triangles, seed), &broad(lock_rounds, 1.0));
    }
}

/// A run of which each round is checked: tree, boxes, locks, keys, lists, and the sum of the areas. Returns the rounds.
fn checked(tree: &NaiveTree, settings: &PrbvhSettings, name: &str, device: Box<dyn Device>) -> Vec<Round> {
    let rounds = Rc::new(RefCell::new(Vec::new()));
    let mut before = tree.clone();
    let seen = Rc::clone(&rounds);
    let name = name.to_owned();
    let mut device = watched(device, move |round| {
        let number = seen.borrow().len();
        before = round.check(&before).unwrap_or_else(|fault| panic!("{name}, round {number}: {fault}"));
        seen.borrow_mut().push(round.clone());
    });
    let uploaded = DeviceTree::upload(&mut device, &tree.encode()).unwrap();
    prbvh(&mut device, &uploaded, settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap();
    uploaded.free(&mut device);
    drop(device);
    Rc::try_unwrap(rounds).unwrap().into_inner()
}

#[test]
fn keys_lists_locks_and_sums_are_right_after_every_round() {
    for (triangles, most_part) in [(soup(500, 0.1, 2), 0.05), (soup(200, 0.3, 3), 1.0), (grid(12), 0.5)] {
        let tree = tree_of(&triangles, 5);
        for (name, device) in devices() {
            let rounds = checked(&tree, &broad(2, most_part), &name, device);
            assert!(rounds.len() > 4, "{name}: {} rounds", rounds.len());
            assert!(rounds.iter().any(|round| round.report[SHRUNK] | round.report[SHRUNK + 1] > 0), "{name}");
        }
    }
}

/// The comparer itself.
#[test]
fn a_planted_fault_of_a_round_is_noticed() {
    let tree = tree_of(&soup(300, 0.1, 2), 5);
    let (name, device) = cpu_devices().swap_remove(0);
    let rounds = checked(&tree, &broad(2, 0.05), &name, device);
    let k = rounds.iter().position(|round| round.in_pool().unwrap().len() > 2).unwrap();
    let before = if k == 0 { tree } else { NaiveTree::decode(&rounds[k - 1].nodes) };
    let round = &rounds[k];
    let fault = |change: &dyn Fn(&mut Round)| {
        let mut round = round.clone();
        change(&mut round);
        round.check(&before).expect_err("a planted fault")
    };
    assert!(round.check(&before).is_ok());
    let places = round.nodes.len() / 2;
    let pool_at = round.books[POOL_SIDE] as usize * places;
    let pooled = round.in_pool().unwrap()[0] as usize;
    let length = POOL_LENGTH + round.books[POOL_SIDE] as usize;
    assert!(fault(&|round| round.pool[pool_at] = round.pool[pool_at + 1]).contains("twice"));
    assert!(fault(&|round| round.books[length] -= 1).contains("in the pool"));
    assert!(fault(&|round| round.books[length] = places as u32 + 1).contains("places"));
    assert!(fault(&|round| round.keys[pooled] ^= 1 << 10).contains("measure"));
    assert!(fault(&|round| round.keys[pooled] ^= IN_POOL).contains("in the pool"));
    assert!(
        fault(&|round| {
            round.keys[pooled] = COLD;
            let side = round.books[FRINGE_SIDE] as usize;
            round.books[FRINGE_LENGTH + side] = 0;
        })
        .contains("forgotten")
    );
    assert!(fault(&|round| round.nodes[0].max[0] += 1.0).contains("stale"));
    assert!(fault(&|round| round.is_free = false).contains("locked"));
    assert!(fault(&|round| round.report[SHRUNK + 1] += 1 << 11).contains("lose"));
    assert!(fault(&|round| round.report[FAULTS] = FAULT_BROKEN_TREE).contains("faults"));
}

/// A loop that hangs in the air leaves nodes that are marked and never refitted, by which the books know it.
#[test]
fn a_loop_is_never_refitted() {
    let tree = tree_of(&soup(20, 0.2, 1), 1);
    let mut nodes = tree.encode();
    let internal = nodes.len() / 2;
    // The parent of a node becomes its child.
    let has_parent = |&v: &u32| tree.parent(v).is_some_and(|parent| parent != ROOT);
    let v = (1..internal as u32).find(has_parent).unwrap();
    let (parent, right) = (tree.parent(v).unwrap(), tree.children[v as usize][1]);
    nodes[v as usize].down = parent;
    nodes[parent as usize].up = right;
    nodes[right as usize].up = v | RIGHT;
    let sound = tree.encode();
    for (nodes, expected) in [(&nodes, FAULT_BROKEN_TREE), (&sound, 0)] {
        let found = [Move { area_decrease: 1.0, input: v | WON, output: parent, other: parent }];
        let params = PrbvhParams { count: 1, flags: DUAL, scale: 1.0, ..PrbvhParams::every(1, 0, nodes.len() as u32) };
        let books = vec![0; BOOKS_WORDS as usize];
        let case = Case::new(Kernel::WorstMark, 1, &params).with(&found).with(nodes).zeros(internal).zeros(internal);
        let marked = case.zeros(2 * internal).with(&books).zeros(REPORT_WORDS as usize).run_everywhere();
        let (ways, keys): (Vec<u32>, Vec<u32>) = (marked.get("ways"), marked.get("keys"));
        let case = Case::new(Kernel::WorstRefit, 1, &params).with(&found).with(nodes).with(&ways).with(&keys);
        let case = case.zeros(2 * internal).with(&marked.get::<u32>("books")).with(&marked.get::<u32>("report"));
        let refitted = case.run_everywhere();
        let params = RoundParams {
            count: 1,
            nodes: nodes.len() as u32,
            root_area: 1.0,
            scale: 1.0,
            page: CLOSE,
            ..Zeroable::zeroed()
        }
        .wanting(0, 1);
        let case = Case::new(Kernel::WorstBooks, 1, &params).with(&refitted.get::<u32>("books")).zeros(2 * internal);
        let closed = case.with(&refitted.get::<u32>("report")).run_everywhere();
        assert_eq!(closed.get::<u32>("report")[FAULTS], expected);
    }
}

/// What the order is for: most of the gain in its first rounds, which search few nodes.
#[test]
fn most_of_the_gain_comes_first() {
    let scene = prbvh::scene::built_in(20_000);
    let mut device = CpuDevice::new(0).unwrap();
    let result = optimize(&scene, &mut device, &Settings::default(), &mut |_| ControlFlow::Continue(())).unwrap();
    let rows = &result.outcome.rows;
    let searched = |rows: &[prbvh::optimize::IterationRow]| rows.iter().map(|row| u64::from(row.searched)).sum::<u64>();
    let half = rows.iter().position(|row| rows[0].cost - row.cost > 0.5 * (rows[0].cost - result.outcome.best().cost));
    let half = half.unwrap();
    assert!(8 * searched(&rows[..=half]) < searched(rows), "half of the gain after {half} of {} rounds", rows.len());
}

fn pipeline_run(scene: &Scene, device: &mut dyn Device) -> (String, Vec<u64>, f64) {
    let result = optimize(scene, device, &Settings::default(), &mut |_| ControlFlow::Continue(())).unwrap();
    validate(&result.tree, Some(&scene.triangles)).unwrap();
    assert_eq!(result.outcome.stop, StopReason::Converged);
    let rows = &result.outcome.rows;
    assert!(result.outcome.best().cost <= rows[0].cost);
    let parted = result.outcome.best().cost / result.quality.sah_cost - 1.0;
    (tree_hash(&result.tree), rows.iter().map(|row| row.cost.to_bits()).collect(), parted.abs())
}

/// As the pipeline runs it: rounds of a submission together.
#[test]
fn the_default_makes_the_same_tree_on_every_device() {
    // Tiny beside huge: most areas are below what a sum sees.
    let mut huge = soup(60, 0.2, 4);
    huge.push(Triangle { a: [-1e6, -1e6, 0.0], b: [1e6, -1e6, 0.0], c: [0.0, 1e6, 1e6] });
    let few = soup(1, 0.1, 1).repeat(50);
    for triangles in [soup(3000, 0.05, 1), grid(12), soup(2, 0.1, 1), soup(3, 0.1, 1), few, huge] {
        let scene = Scene::from_triangles("scene", triangles).unwrap();
        with_devices(|devices| {
            let mut runs = devices.iter_mut().map(|(_, device)| pipeline_run(&scene, &mut **device));
            let first = runs.next().unwrap();
            assert!(first.2 < 1e-5, "{}: the cost of the best row is that of the tree", first.2);
            assert!(runs.all(|other| other == first));
        });
    }
}

/// The links are read before anything runs; without that the refit finds the fault, and no round runs.
#[test]
fn a_broken_initial_tree_is_an_error_and_stays_as_it_is() {
    let mut nodes = tree_of(&soup(20, 0.2, 1), 1).encode();
    // The way up leads past a node, which waits for both of its children.
    let right =
        nodes.iter().position(|node| !node.is_left() && node.up != NO_NODE && node.parent_of_right() != ROOT).unwrap();
    nodes[right].up = ROOT | RIGHT;
    with_devices(|devices| {
        for (name, device) in devices {
            let device = &mut **device;
            for settings in [PrbvhSettings::default(), PrbvhSettings::published()] {
                let tree = DeviceTree::upload(device, &nodes).unwrap();
                let refused = prbvh(device, &tree, &settings, &mut |_, _, _| ControlFlow::Continue(())).unwrap_err();
                assert!(matches!(refused, OptimizeError::Tree(UnfitTree::Broken { .. })), "{name}: {refused}");
                let fault = prbvh_unchecked(device, &tree, None, &settings, &mut |_, _, _| ControlFlow::Continue(()));
                let fault = fault.unwrap_err().to_string();
                assert!(fault.contains("fault 0x2: the links are no tree"), "{name}: {fault}");
                let after = tree.download(device).unwrap();
                let links = |nodes: &[Node]| nodes.iter().map(|node| (node.up, node.down)).collect::<Vec<_>>();
                assert_eq!(links(&after), links(&nodes), "{name}");
                tree.free(device);
            }
        }
    });
}

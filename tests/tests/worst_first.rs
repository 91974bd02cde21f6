//! Largest reinsertions first: candidates and floors against plain searches, refits of paths, and the whole descent on every device.

use prbvh::build::DeviceTree;
use prbvh::bvh::{Bvh, tree_hash, validate};
use prbvh::device::Device;
use prbvh::optimize::{Limits, Order, PrbvhSettings, StopReason, Strategy, prbvh};
use prbvh::pipeline::{Optimized, Optimizer, Settings, optimize};
use prbvh::scene::Scene;
use prbvh_kernel::Kernel;
use prbvh_kernel::node::{NO_NODE, Node, RIGHT, ROOT};
use prbvh_kernel::prbvh::candidates::largest_decrease;
use prbvh_kernel::prbvh::{PrbvhParams, Reinsertion};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{CANDIDATES, FOUND, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{grid, soup};
use prbvh_tests::oracle::{half_area, tree_of};
use std::ops::ControlFlow;

const REPORT: usize = REPORT_WORDS as usize;

fn params(nodes: usize, floor: f32) -> PrbvhParams {
    PrbvhParams { count: nodes as u32, mu: 1, first: 0, nodes: nodes as u32, floor }
}

fn search(nodes: &[Node], floor: f32) -> Vec<Reinsertion> {
    let case = Case::new(Kernel::PrbvhSearch, nodes.len() as u32, &params(nodes.len(), floor)).with(nodes);
    case.zeros(nodes.len()).zeros(REPORT).run_everywhere().get("found")
}

/// The list that the kernels make.
fn candidates(nodes: &[Node], floor: f32) -> Vec<u32> {
    let internal = nodes.len() / 2;
    let flagged = PrbvhParams { count: internal as u32 + 1, ..params(nodes.len(), floor) };
    let case = Case::new(Kernel::PrbvhFlag, flagged.count, &flagged).with(nodes);
    let flags: Vec<u32> = case.zeros(internal + 1).run_everywhere().get("flags");
    assert_eq!(flags.last(), Some(&0));
    let mut sum = 0;
    let mut places = Vec::new();
    for flag in &flags {
        places.push(sum);
        sum += flag;
    }
    let packed = PrbvhParams { count: internal as u32, ..flagged };
    let case = Case::new(Kernel::PrbvhPack, packed.count, &packed).with(&places).with(nodes);
    let packed = case.zeros((2 * internal).max(1)).zeros(REPORT).run_everywhere();
    let count = packed.get::<u32>("report")[CANDIDATES];
    assert_eq!(count, 2 * sum);
    packed.get::<u32>("candidates")[..count as usize].to_vec()
}

#[test]
fn the_list_has_the_children_of_large_nodes_in_order() {
    for n in [1, 2, 3, 40, 700] {
        let tree = tree_of(&soup(n, 0.2, n as u64), 7);
        let nodes = tree.encode();
        for floor in [0.0, 1e-3, 1e-1, 1e9] {
            let is_large = |p: &usize| 4.0 * nodes[*p].aabb().half_area() > floor;
            let expected: Vec<u32> =
                (0..nodes.len() / 2).filter(is_large).flat_map(|p| tree.children[p].iter().copied()).collect();
            assert_eq!(candidates(&nodes, floor), expected, "{n} triangles, floor {floor}");
        }
    }
}

/// What a second try starts from.
#[test]
fn who_finds_nothing_is_struck_off_the_list() {
    let nodes = tree_of(&soup(300, 0.2, 3), 5).encode();
    let found = search(&nodes, 0.0);
    let list: Vec<u32> = (1..nodes.len() as u32).rev().collect();
    for (mu, first) in [(1, 0), (3, 2)] {
        let count = (list.len() as u32 - first).div_ceil(mu);
        let params = PrbvhParams { count, mu, first, ..params(nodes.len(), 0.0) };
        let found: Vec<Reinsertion> = (0..count).map(|i| found[list[params.input(i) as usize] as usize]).collect();
        let case = Case::new(Kernel::PrbvhStrike, count, &params).with(&found).with(&list);
        let left: Vec<u32> = case.run_everywhere().get("candidates");
        let mut expected = list.clone();
        for (i, found) in found.iter().enumerate() {
            if found.output == NO_NODE {
                expected[params.input(i as u32) as usize] = NO_NODE;
            }
        }
        assert!(expected != list && expected.iter().any(|&input| input != NO_NODE));
        assert_eq!(left, expected);
    }
    // A struck one is searched no more.
    let none = [NO_NODE; 3];
    let params = PrbvhParams { count: 3, ..params(nodes.len(), 0.0) };
    let case = Case::new(Kernel::PrbvhSearchCandidates, 3, &params).with(&nodes).with(&none);
    let result = case.zeros(3).zeros(REPORT).run_everywhere();
    assert_eq!(result.get::<Reinsertion>("found"), [Reinsertion::NONE; 3]);
}

/// No reinsertion gains more than the bound, but for roundings of the areas that it was computed from.
#[test]
fn no_reinsertion_gains_more_than_the_bound() {
    for (n, seed) in [(4, 1), (30, 2), (500, 3)] {
        let tree = tree_of(&soup(n, 0.3, seed), seed);
        let nodes = tree.encode();
        let rounding = 1e-5 * half_area(&tree.boxes[0]) as f32;
        let bounded = |found: &[Reinsertion]| {
            (1u32..).zip(&found[1..]).all(|(input, found)| {
                found.output == NO_NODE || found.area_decrease <= largest_decrease(input, &nodes) + rounding
            })
        };
        let mut found = search(&nodes, 0.0);
        assert!(bounded(&found));
        let moved = found.iter_mut().find(|found| found.output != NO_NODE).unwrap();
        moved.area_decrease = 2.0 * half_area(&tree.boxes[0]) as f32 * n as f32;
        assert!(!bounded(&found), "a planted decrease");
    }
}

/// A floor changes nothing about what exceeds it: outputs, decreases, and the order of equal ones.
#[test]
fn a_floor_hides_the_smaller_reinsertions_and_no_others() {
    for seed in 0..4 {
        let nodes = tree_of(&soup(400, 0.2, seed), seed).encode();
        let all = search(&nodes, 0.0);
        let mut decreases: Vec<f32> = all.iter().map(|found| found.area_decrease).filter(|&d| d > 0.0).collect();
        decreases.sort_by(f32::total_cmp);
        let middle = decreases.len() / 2;
        // Between two decreases that no rounding confuses.
        let gap = (middle..decreases.len() - 1).find(|&k| decreases[k] * 1.001 < decreases[k + 1]).unwrap();
        let floor = 0.5 * (decreases[gap] + decreases[gap + 1]);
        let expected: Vec<Reinsertion> =
            all.iter().map(|&found| if found.area_decrease > floor { found } else { Reinsertion::NONE }).collect();
        assert_eq!(search(&nodes, floor), expected);

        let list = candidates(&nodes, floor);
        assert!(list.len() < nodes.len() - 1);
        let listed = PrbvhParams { count: list.len() as u32, ..params(nodes.len(), floor) };
        let case = Case::new(Kernel::PrbvhSearchCandidates, listed.count, &listed).with(&nodes).with(&list);
        let result = case.zeros(list.len()).zeros(REPORT).run_everywhere();
        let of_list: Vec<Reinsertion> = list.iter().map(|&input| expected[input as usize]).collect();
        assert_eq!(result.get::<Reinsertion>("found"), of_list);
        let above = of_list.iter().filter(|found| found.output != NO_NODE).count();
        assert_eq!(result.get::<u32>("report")[FOUND] as usize, above);
        let all = expected.iter().filter(|found| found.output != NO_NODE).count();
        assert!(above > all * 9 / 10, "{above} of {all}: a list leaves out few");
    }
}

/// A loop that hangs in the air leaves counts behind, by which the cost kernel knows it.
#[test]
fn a_loop_is_never_refitted() {
    let tree = tree_of(&soup(20, 0.2, 1), 1);
    let mut nodes = tree.encode();
    // The parent of a node becomes its child.
    let (v, parent) = (1..19u32)
        .find_map(|v| {
            let parent = tree.children.iter().position(|children| children.contains(&v))? as u32;
            (parent != ROOT && !tree.children[v as usize].is_empty()).then_some((v, parent))
        })
        .unwrap();
    let left = tree.children[v as usize][0];
    let right = tree.children[v as usize][1];
    nodes[v as usize].down = parent;
    nodes[parent as usize].up = right;
    nodes[right as usize].up = v | RIGHT;
    let found = [Reinsertion { area_decrease: 1.0, input: right, output: parent }];
    let params = PrbvhParams { count: 1, ..params(nodes.len(), 0.0) };
    let case = Case::new(Kernel::PrbvhMarkPaths, 1, &params).with(&found).with(&nodes).zeros(19);
    let ways: Vec<u32> = case.run_everywhere().get("ways");
    let case = Case::new(Kernel::PrbvhRefitPaths, 1, &params).with(&found).with(&nodes).with(&ways);
    let after: Vec<u32> = case.run_everywhere().get("ways");
    assert!(after.iter().any(|&ways| ways != 0), "{left} left the tree unseen");
}

fn run(scene: &Scene, strategy: Strategy, device: &mut dyn Device) -> Optimized {
    let prbvh = PrbvhSettings { order: Order::LargestFirst, strategy, ..PrbvhSettings::default() };
    let settings = Settings { optimizer: Optimizer::Prbvh, prbvh, ..Settings::default() };
    optimize(scene, device, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn the_descent_makes_the_same_tree_on_every_device() {
    for triangles in [soup(3000, 0.05, 1), grid(12), soup(2, 0.1, 1), soup(3, 0.1, 1), soup(1, 0.1, 1).repeat(50)] {
        let scene = Scene::from_triangles("scene", triangles).unwrap();
        for strategy in [Strategy::Aggressive, Strategy::Conservative] {
            with_devices(|devices| {
                let mut hashes = devices.iter_mut().map(|(name, device)| {
                    let result = run(&scene, strategy, &mut **device);
                    let tree: &Bvh = &result.tree;
                    validate(tree, Some(&scene.triangles)).unwrap();
                    let rows = &result.outcome.rows;
                    assert!(rows.iter().all(|row| row.cost.is_finite()));
                    assert!(result.outcome.best().cost <= rows[0].cost);
                    assert_eq!(result.outcome.stop, StopReason::Converged, "{name}");
                    (tree_hash(tree), rows.iter().map(|row| row.cost.to_bits()).collect::<Vec<_>>())
                });
                let first = hashes.next().unwrap();
                assert!(hashes.all(|other| other == first));
            });
        }
    }
}

/// What the descent is for: a large part of the gain in its first iterations.
#[test]
fn most_of_the_gain_comes_first() {
    let scene = prbvh::scene::built_in(20_000);
    let mut device = prbvh::device::cpu::CpuDevice::new(0).unwrap();
    let gains = [Order::LargestFirst, Order::Interleaved].map(|order| {
        let prbvh = PrbvhSettings { order, limits: Limits::iterations(4), ..PrbvhSettings::default() };
        let settings = Settings { prbvh, ..Settings::default() };
        let result = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        result.outcome.rows[0].cost - result.outcome.best().cost
    });
    assert!(gains[0] > 1.2 * gains[1], "{gains:?}");
}

/// The last levels may have no candidates: then the cost after those before them is what counts.
#[test]
fn a_descent_that_runs_out_of_candidates_knows_its_cost() {
    let mut triangles = soup(60, 0.2, 4);
    triangles.push(Triangle { a: [-1e6, -1e6, 0.0], b: [1e6, -1e6, 0.0], c: [0.0, 1e6, 1e6] });
    let scene = Scene::from_triangles("huge and tiny", triangles).unwrap();
    with_devices(|devices| {
        for (name, device) in devices {
            let result = run(&scene, Strategy::Aggressive, &mut **device);
            let cost = result.quality.sah_cost;
            assert!((result.outcome.best().cost / cost - 1.0).abs() < 1e-5, "{name}: {cost}");
        }
    });
}

/// No iteration ran, so there is no best tree to go back to: what came in stays.
#[test]
fn a_broken_initial_tree_is_a_fault_and_stays_as_it_is() {
    let mut nodes = tree_of(&soup(20, 0.2, 1), 1).encode();
    // The way up leads past a node, which waits for both of its children.
    let right =
        nodes.iter().position(|node| !node.is_left() && node.up != NO_NODE && node.parent_of_right() != ROOT).unwrap();
    nodes[right].up = ROOT | RIGHT;
    with_devices(|devices| {
        for (name, device) in devices {
            let device = &mut **device;
            let tree = DeviceTree::upload(device, &nodes).unwrap();
            let outcome = prbvh(device, &tree, &PrbvhSettings::default(), &mut |_, _, _| ControlFlow::Continue(()));
            assert!(matches!(outcome.unwrap().stop, StopReason::Fault(_)), "{name}");
            let after = tree.download(device).unwrap();
            let links = |nodes: &[Node]| nodes.iter().map(|node| (node.up, node.down)).collect::<Vec<_>>();
            assert_eq!(links(&after), links(&nodes), "{name}");
            tree.free(device);
        }
    });
}

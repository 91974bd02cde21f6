//! The search in lanes against the search of each node by an invocation of its own: the same bits, on every device, in every order.

use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{NO_NODE, Node, RIGHT};
use prbvh_kernel::prbvh::search::MAX_STEPS;
use prbvh_kernel::prbvh::walk::{NOT_YET, Pending, WalkParams};
use prbvh_kernel::prbvh::{PrbvhParams, Reinsertion};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{FAULT_SEARCH_STEPS, FAULTS, FOUND, MOST_STEPS, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::fixtures::{flat, grid, nested, soup};
use prbvh_tests::oracle::random_tree;
use proptest::prelude::*;

const REPORT: usize = REPORT_WORDS as usize;

/// What a search leaves; `tops` only of those with an output.
#[derive(Clone, Debug, PartialEq)]
struct Found {
    found: Vec<Reinsertion>,
    tops: Vec<u32>,
    report: Vec<u32>,
}

fn tops_of(found: &[Reinsertion], tops: &[u32]) -> Vec<u32> {
    found.iter().zip(tops).map(|(found, &top)| if found.output == NO_NODE { NO_NODE } else { top }).collect()
}

/// One invocation for each node.
fn alone(nodes: &[Node], params: &PrbvhParams, list: Option<&[u32]>) -> Found {
    let length = params.count.max(1) as usize;
    let case = match list {
        None => Case::new(Kernel::PrbvhSearchTop, params.count, params).with(nodes),
        Some(list) => Case::new(Kernel::PrbvhSearchTopCandidates, params.count, params).with(nodes).with(list),
    };
    let result = case.zeros(length).zeros(length).zeros(REPORT).run_everywhere();
    let found: Vec<Reinsertion> = result.get("found");
    Found { tops: tops_of(&found, &result.get::<u32>("tops")), found, report: result.get("report") }
}

fn listed(nodes: &[Node], params: &PrbvhParams, list: Option<&[u32]>) -> Vec<Pending> {
    let case = match list {
        None => Case::new(Kernel::PrbvhList, params.count, params).with(nodes),
        Some(list) => Case::new(Kernel::PrbvhListCandidates, params.count, params).with(nodes).with(list),
    };
    case.zeros(params.count.max(1) as usize).run_everywhere().get("pending")
}

/// What the walk leaves. How many searches a lane begins depends on the others, so `taken` differs; nothing else does.
fn walked(nodes: &[Node], walk: &WalkParams, pending: &[Pending]) -> (Vec<Pending>, Vec<u32>) {
    let case = Case::new(Kernel::PrbvhWalk, walk.count, walk).with(nodes).with(pending).zeros(1).zeros(REPORT);
    with_devices(|devices| {
        let mut results = devices.iter_mut().map(|(name, device)| {
            let result = case.run_on(&mut **device).unwrap_or_else(|error| panic!("{name}: {error}"));
            (name.clone(), (result.get::<Pending>("pending"), result.get::<u32>("report")))
        });
        let (first, expected) = results.next().expect("there is always the CPU");
        for (name, result) in results {
            assert!(result == expected, "{first} and {name} differ");
        }
        expected
    })
}

fn confirmed(nodes: &[Node], params: &PrbvhParams, pending: &[Pending], report: &[u32]) -> Found {
    let case = Case::new(Kernel::PrbvhConfirmTop, params.count, params).with(nodes).with(pending);
    let result = case.zeros(pending.len()).with(report).run_everywhere();
    let with_tops: Vec<u32> = result.get("pending");
    let case = Case::new(Kernel::PrbvhConfirm, params.count, params).with(nodes).with(pending);
    assert_eq!(case.with(report).run_everywhere().get::<u32>("pending"), with_tops);
    let found: Vec<Reinsertion> = result.get("pending");
    Found { tops: tops_of(&found, &result.get::<u32>("tops")), found, report: result.get("report") }
}

fn in_lanes(nodes: &[Node], params: &PrbvhParams, list: Option<&[u32]>) -> Found {
    let (pending, report) = walked(nodes, &WalkParams::of(params), &listed(nodes, params, list));
    confirmed(nodes, params, &pending, &report)
}

fn params(mu: u32, first: u32, nodes: &[Node], floor: f32) -> PrbvhParams {
    PrbvhParams { floor, ..PrbvhParams::every(mu, first, nodes.len() as u32) }
}

/// Both ways with these inputs; returns what they find.
fn compare(nodes: &[Node], params: &PrbvhParams, list: Option<&[u32]>) -> Found {
    let found = alone(nodes, params, list);
    assert_eq!(in_lanes(nodes, params, list), found, "{params:?}");
    found
}

fn nodes_of(triangles: &[Triangle], seed: u64) -> Vec<Node> {
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    random_tree(&boxes, seed).encode()
}

#[test]
fn random_trees_have_the_same_reinsertions() {
    for n in [1, 2, 3, 4, 7, 30, 400] {
        let nodes = nodes_of(&soup(n, 0.1, n as u64), 1);
        let found = compare(&nodes, &params(1, 0, &nodes, 0.0), None);
        assert!(n < 30 || found.report[FOUND] > n as u32, "{n}");
        compare(&nodes, &params(3, 2, &nodes, 0.0), None);
    }
}

#[test]
fn ties_duplicates_and_flat_scenes_too() {
    for triangles in [grid(10), grid(6).repeat(2), vec![soup(1, 0.5, 0)[0]; 30], flat(60), nested(40)] {
        let nodes = nodes_of(&triangles, 3);
        compare(&nodes, &params(1, 0, &nodes, 0.0), None);
    }
}

#[test]
fn floors_and_lists_hide_the_same() {
    let nodes = nodes_of(&soup(300, 0.2, 5), 2);
    let all = compare(&nodes, &params(1, 0, &nodes, 0.0), None);
    let mut decreases: Vec<f32> = all.found.iter().map(|found| found.area_decrease).filter(|&d| d > 0.0).collect();
    decreases.sort_by(f32::total_cmp);
    let floor = decreases[decreases.len() / 2];
    let above = compare(&nodes, &params(1, 0, &nodes, floor), None);
    assert!(above.report[FOUND] > 0 && above.report[FOUND] < all.report[FOUND]);
    // Beyond the end of the tree, and the root.
    let list: Vec<u32> = (0..nodes.len() as u32 + 3).rev().collect();
    let of_list = PrbvhParams { count: (list.len() as u32).div_ceil(2), ..params(2, 0, &nodes, floor) };
    compare(&nodes, &of_list, Some(&list));
}

/// A comb of bars in a row: internal node `k` holds leaf `k` and the rest, so that searches of deep nodes end at the bound.
fn comb(n: u32) -> Vec<Node> {
    let internal = n - 1;
    let mut nodes: Vec<Node> = vec![bytemuck::Zeroable::zeroed(); 2 * n as usize - 1];
    for k in 0..n {
        let leaf = (internal + k) as usize;
        (nodes[leaf].min, nodes[leaf].max) = ([k as f32, 0.0, 0.0], [k as f32 + 0.5, 1.0, 1.0]);
        nodes[leaf].down = k;
    }
    nodes[0].up = NO_NODE;
    for v in (0..internal).rev() {
        let (left, right) = (internal + v, if v + 1 < internal { v + 1 } else { internal + v + 1 });
        nodes[v as usize].down = left;
        nodes[left as usize].up = right;
        nodes[right as usize].up = v | RIGHT;
        let aabb = nodes[left as usize].aabb().union(nodes[right as usize].aabb());
        (nodes[v as usize].min, nodes[v as usize].max) = (aabb.min, aabb.max);
    }
    nodes
}

/// Inputs 5,000 to 10,000 levels down, each of which takes all steps there are.
fn deep(nodes: &[Node]) -> PrbvhParams {
    PrbvhParams { count: 60, ..params(83, 5_000, nodes, 0.0) }
}

#[test]
fn searches_that_all_end_at_the_bound_fit_into_their_lanes() {
    let nodes = comb(12_000);
    let params = deep(&nodes);
    let found = compare(&nodes, &params, None);
    assert_eq!((found.report[MOST_STEPS], found.report[FAULTS]), (MAX_STEPS, 0));
    assert!(WalkParams::of(&params).count < params.count, "lanes take several of them");
}

#[test]
fn a_search_that_no_lane_takes_is_a_fault() {
    let nodes = comb(12_000);
    let params = deep(&nodes);
    // A single lane for all of them.
    let few = WalkParams { count: 1, ..WalkParams::of(&params) };
    let (pending, report) = walked(&nodes, &few, &listed(&nodes, &params, None));
    let left = pending.iter().filter(|pending| pending.output == NOT_YET).count();
    assert!(left > 0 && left < pending.len(), "{left} are left");
    assert_eq!(report[FAULTS], 0, "those that it took are done");
    let found = confirmed(&nodes, &params, &pending, &report);
    assert_eq!(found.report[FAULTS], FAULT_SEARCH_STEPS);
    assert!(found.found[pending.len() - left..].iter().all(|found| *found == Reinsertion::NONE));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Coordinates from a small grid: duplicates, flat and empty boxes, exact ties.
    #[test]
    fn degenerate_trees_too(
        corners in prop::collection::vec(prop::array::uniform9(0u8..4), 1..40),
        seed in any::<u64>(),
    ) {
        let triangle = |c: &[u8; 9]| {
            let corner = |k: usize| [f32::from(c[k]), f32::from(c[k + 1]), f32::from(c[k + 2])];
            Triangle { a: corner(0), b: corner(3), c: corner(6) }
        };
        let nodes = nodes_of(&corners.iter().map(triangle).collect::<Vec<_>>(), seed);
        compare(&nodes, &params(1, 0, &nodes, 0.0), None);
    }
}

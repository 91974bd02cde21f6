//! The kernels of the worst-first order, each alone: pool and list, unfolding, rounds of locks, the best tree.

use bytemuck::Zeroable;
use prbvh::device::Device;
use prbvh_kernel::Kernel;
use prbvh_kernel::mem::AtomicU32;
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::dual::DualMove;
use prbvh_kernel::prbvh::dual::search::{DualParams, TO_THE_ROOT, search};
use prbvh_kernel::prbvh::group::{BEGINS, COMES_FIRST};
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::CHUNK;
use prbvh_kernel::prbvh::worst::books::{
    BEGIN, BOOKS_WORDS, CLOSE, FRINGE_LENGTH, LIST_LENGTH, OVER_LIST, PART, POOL_LENGTH, POOL_SIDE, SELECTS, TURN,
};
use prbvh_kernel::prbvh::worst::keys::{COLD, IN_POOL, ON_FRINGE, TIRED, measure_of, waits};
use prbvh_kernel::prbvh::{DUAL, Move, PrbvhParams, WON};
use prbvh_kernel::status::REPORT_WORDS;
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::dual::topology;
use prbvh_tests::fixtures::{Random, grid, soup};
use prbvh_tests::locks::{Checked, Claimant, lock_rounds, rounds, rounds_fault, taken};
use prbvh_tests::moved::{nothing_kept, reinsert, restore};
use prbvh_tests::oracle::{NaiveTree, row_comb, tree_of};
use prbvh_tests::worst::Round;
use std::collections::BTreeSet;

const REPORT: usize = REPORT_WORDS as usize;

/// Of a tree with `places` internal nodes and a root of area 1.
fn round(places: usize, page: u32, wanted: u32) -> RoundParams {
    let nodes = 2 * places as u32 + 1;
    let (count, pool) = (places as u32, u32::MAX);
    RoundParams { count, nodes, root_area: 1.0, scale: 1.0, page, ..Zeroable::zeroed() }.wanting(wanted, pool)
}

/// A pool, of which some nodes are tired.
#[derive(Clone, Debug)]
struct Pool {
    places: usize,
    keys: Vec<u32>,
    pool: Vec<u32>,
    /// Whose turn it is: [`TURN`] and [`PART`] of the round before.
    turn: [u32; 2],
}

impl Pool {
    /// All nodes but the first few, in no order; measures over `octaves` factors of two.
    fn new(places: usize, octaves: f32, tired: u64, seed: u64) -> Self {
        let mut random = Random(seed);
        let mut key = |v: usize| {
            let measure = (4.0 * 0.5f32.powf(random.unit() * octaves)).to_bits() & !(TIRED | IN_POOL);
            let is_tired = random.bits() % 100 < tired;
            if v < 3 { COLD } else { measure | IN_POOL | if is_tired { TIRED } else { 0 } }
        };
        let keys = (0..places).map(&mut key).collect();
        let mut pool: Vec<u32> = (3..places as u32).collect();
        pool.sort_by_key(|v| v.wrapping_mul(0x85eb_ca6b));
        Self { places, keys, pool, turn: [0, 0] }
    }

    fn waiting(&self) -> BTreeSet<u32> {
        self.pool.iter().copied().filter(|&v| waits(self.keys[v as usize])).collect()
    }
}

/// What a selection left.
#[derive(Clone, Debug, PartialEq)]
struct Selected {
    list: Vec<u32>,
    pool: Vec<u32>,
    keys: Vec<u32>,
    turn: [u32; 2],
}

/// Count, threshold and selection on a device: in dispatches of many workgroups, or in one of a single one.
fn select(pool: &Pool, wanted: u32, is_alone: bool, device: &mut dyn Device) -> Selected {
    let Pool { places, keys, pool, turn } = pool;
    let mut sides = vec![0u32; 2 * places];
    sides[*places..][..pool.len()].copy_from_slice(pool);
    let mut books = vec![0u32; BOOKS_WORDS as usize];
    (books[POOL_SIDE], books[POOL_LENGTH + 1]) = (1, pool.len() as u32);
    [books[TURN], books[PART]] = *turn;
    let chunks = (pool.len() as u32).div_ceil(CHUNK);
    let params = RoundParams { count: chunks, flags: SELECTS, ..round(*places, 0, wanted) };
    let nodes = vec![Node::zeroed(); 2 * places + 1];
    let head = |flags: u32, books: &[u32], device: &mut dyn Device| {
        let params = RoundParams { count: 1, flags, ..params };
        let case = Case::new(Kernel::WorstHead, 1, &params).with(&nodes).with(keys).zeros(2 * places).with(&sides);
        case.zeros(*places).with(books).zeros(REPORT).run_on(device).unwrap()
    };
    let result = if is_alone {
        head(COMES_FIRST, &books, device)
    } else {
        let counted = Case::new(Kernel::WorstCount, chunks, &params).with(&sides).with(keys).with(&books);
        let books: Vec<u32> = counted.run_on(device).unwrap().get("books");
        let books: Vec<u32> = head(0, &books, device).get("books");
        let case = Case::new(Kernel::WorstSelect, chunks, &params).with(&nodes).with(keys).with(&sides);
        case.zeros(*places).zeros(2 * places).with(&books).run_on(device).unwrap()
    };
    let books: Vec<u32> = result.get("books");
    let over = prbvh_kernel::grid::workgroups(books[LIST_LENGTH]);
    assert_eq!(books[OVER_LIST + 1..][..3], over, "workgroups over the list");
    let mut list: Vec<u32> = result.get("list");
    list.truncate(books[LIST_LENGTH] as usize);
    assert_eq!(books[POOL_SIDE], 0, "the other side");
    let mut pool: Vec<u32> = result.get("pool");
    pool.truncate(books[POOL_LENGTH] as usize);
    Selected { list, pool, keys: result.get("keys"), turn: [books[TURN], books[PART]] }
}

/// What is wrong with a selection: the worst are on the list, who waits stays in the pool, who is tired leaves it.
fn selection_fault(before: &Pool, after: &Selected, wanted: usize) -> Option<String> {
    let waiting = before.waiting();
    let set = |nodes: &[u32]| nodes.iter().copied().collect::<BTreeSet<u32>>();
    let (list, pool) = (set(&after.list), set(&after.pool));
    if list.len() != after.list.len() || pool.len() != after.pool.len() {
        return Some("a node twice".to_owned());
    }
    if pool != waiting {
        return Some("the pool is not who waits".to_owned());
    }
    if !list.is_subset(&waiting) {
        return Some("who does not wait is on the list".to_owned());
    }
    let leaves = |v: &u32| !waiting.contains(v) && before.keys[*v as usize] & IN_POOL != 0;
    let expected =
        (0..before.places as u32).map(|v| before.keys[v as usize] & if leaves(&v) { !IN_POOL } else { u32::MAX });
    if !expected.eq(after.keys.iter().copied()) {
        return Some("keys".to_owned());
    }
    let measure = |v: &u32| f32::from_bits(measure_of(before.keys[*v as usize]));
    let least = list.iter().map(measure).fold(f32::INFINITY, f32::min);
    let most = waiting.difference(&list).map(measure).fold(0.0, f32::max);
    // Of a bucket a part may be on the list. No bucket is wider than a quarter of its least measure.
    if most > 1.25 * least {
        return Some(format!("{most} waits while {least} is searched"));
    }
    let expected = wanted.min(waiting.len());
    // A part of a bucket is by hashing, and of a large pool one in sixteen is counted.
    let about = 3 + expected / 3;
    (list.len().abs_diff(expected) > about).then(|| format!("{} on the list, not about {expected}", list.len()))
}

#[test]
fn the_worst_of_the_pool_are_on_the_list() {
    for (places, octaves, wanted) in
        [(4, 2.0, 1), (300, 30.0, 32), (3000, 8.0, 100), (3000, 0.1, 100), (3000, 60.0, 9000)]
    {
        let pool = Pool::new(places, octaves, 20, 5);
        selected_everywhere(&pool, wanted);
    }
    selected_everywhere(&Pool::new(60_000, 12.0, 50, 7), 1500);
}

/// The same selection on every device, up to its order. Returns it in order.
fn selected_everywhere(pool: &Pool, wanted: u32) -> Selected {
    with_devices(|devices| {
        let mut first: Option<Selected> = None;
        for (name, device) in devices {
            for is_alone in [false, true] {
                let mut selected = select(pool, wanted, is_alone, &mut **device);
                let fault = selection_fault(pool, &selected, wanted as usize);
                assert_eq!(fault, None, "{name}, {wanted} of {}", pool.places);
                selected.list.sort_unstable();
                selected.pool.sort_unstable();
                assert!(first.as_ref().is_none_or(|first| *first == selected), "{name}, alone: {is_alone}");
                first = Some(selected);
            }
        }
        first.unwrap()
    })
}

#[test]
fn a_wrong_selection_is_noticed() {
    let pool = Pool::new(300, 30.0, 20, 5);
    let right = selected_everywhere(&pool, 32);
    let fault = |change: &dyn Fn(&mut Selected)| {
        let mut selected = right.clone();
        change(&mut selected);
        selection_fault(&pool, &selected, 32).expect("a planted fault")
    };
    let waiting = *pool.waiting().iter().find(|v| !right.list.contains(v)).unwrap();
    let tired = *pool.pool.iter().find(|&&v| !waits(pool.keys[v as usize])).unwrap();
    let last = pool.waiting().into_iter().min_by_key(|&v| measure_of(pool.keys[v as usize])).unwrap();
    assert_eq!(fault(&|s| s.list.push(s.list[0])), "a node twice");
    assert_eq!(fault(&|s| s.pool.retain(|&v| v != waiting)), "the pool is not who waits");
    assert_eq!(fault(&|s| s.list.push(tired)), "who does not wait is on the list");
    assert_eq!(fault(&|s| s.keys[waiting as usize] ^= IN_POOL), "keys");
    assert!(fault(&|s| s.list.push(last)).contains("while"));
    assert!(fault(&|s| s.list.truncate(3)).contains("waits while") || fault(&|s| s.list.clear()).contains("not about"));
}

/// Whoever is searched in vain is tired. Nobody waits for ever: the list is empty only when nobody waits.
#[test]
fn everybody_is_searched_in_the_end() {
    for octaves in [0.1, 3.0] {
        let mut pool = Pool::new(2000, octaves, 0, 9);
        let mut rounds = 0;
        while !pool.waiting().is_empty() {
            let selected = with_devices(|devices| select(&pool, 60, rounds % 2 == 0, &mut *devices[0].1));
            assert!(
                !selected.list.is_empty(),
                "{} wait, and after {rounds} rounds none is searched",
                pool.waiting().len()
            );
            pool.keys = selected.keys;
            pool.turn = selected.turn;
            selected.list.iter().for_each(|&v| pool.keys[v as usize] |= TIRED);
            pool.pool = selected.pool;
            rounds += 1;
        }
        assert!(rounds < 4 * 2000 / 60, "{rounds} rounds");
    }
}

/// Unfolds until the fringe is empty, on a device; the lists after every stage.
fn unfold(nodes: &[Node], device: &mut dyn Device) -> Vec<Round> {
    let places = nodes.len() / 2;
    let root_area = nodes[0].aabb().half_area();
    let params = |count, page| RoundParams { count, root_area, ..round(places, page, 1) };
    let books = vec![0u32; BOOKS_WORDS as usize];
    let begin = Case::new(Kernel::WorstBooks, 1, &params(1, BEGIN)).with(&books).zeros(2 * places).zeros(REPORT);
    let begun = begin.run_on(device).unwrap();
    let mut state = Round {
        nodes: nodes.to_vec(),
        keys: vec![COLD; places],
        pool: vec![0; 2 * places],
        fringe: begun.get("fringe"),
        books: begun.get("books"),
        report: begun.get("report"),
        is_free: true,
        scale: 1.0,
    };
    let mut stages = Vec::new();
    while !state.on_fringe().unwrap().is_empty() {
        let case =
            Case::new(Kernel::WorstSelect, places as u32, &params(places as u32, 0)).with(nodes).with(&state.keys);
        let case = case.with(&state.pool).zeros(places).with(&state.fringe).with(&state.books);
        let result = case.run_on(device).unwrap();
        state = Round { keys: result.get("keys"), fringe: result.get("fringe"), pool: result.get("pool"), ..state };
        let close = Case::new(Kernel::WorstBooks, 1, &params(1, CLOSE)).with(&result.get::<u32>("books"));
        let closed = close.with(&state.fringe).with(&state.report).run_on(device).unwrap();
        (state.books, state.report) = (closed.get("books"), closed.get("report"));
        stages.push(state.clone());
        assert!(stages.len() < 100, "the fringe is never empty");
    }
    stages
}

/// The same stages by one workgroup: keys, and how long the lists are.
fn unfold_alone(nodes: &[Node], stages: u32, device: &mut dyn Device) -> (Vec<u32>, [u32; 4]) {
    let places = nodes.len() / 2;
    let root_area = nodes[0].aabb().half_area();
    let params = RoundParams { count: 1, root_area, flags: BEGINS, ..round(places, stages, 1) };
    let case = Case::new(Kernel::WorstHead, 1, &params).with(nodes).zeros(places).zeros(2 * places).zeros(2 * places);
    let begun = case.zeros(places).zeros(BOOKS_WORDS as usize).zeros(REPORT).run_on(device).unwrap();
    (begun.get("keys"), lengths(&begun.get::<u32>("books")))
}

/// Lengths of pool and fringe.
fn lengths(books: &[u32]) -> [u32; 4] {
    [POOL_LENGTH, POOL_LENGTH + 1, FRINGE_LENGTH, FRINGE_LENGTH + 1].map(|word| books[word])
}

/// Keys, pool and fringe cover every node in every stage, on every device. Returns the stages.
fn check_unfolding(tree: &NaiveTree) -> usize {
    let nodes = tree.encode();
    with_devices(|devices| {
        let mut first: Option<Vec<Vec<u32>>> = None;
        for (name, device) in devices {
            let stages = unfold(&nodes, &mut **device);
            for stage in &stages {
                stage.check_lists(tree).unwrap_or_else(|fault| panic!("{name}: stage {}: {fault}", stage.stage()));
            }
            let last = &stages[stages.len() - 1];
            assert!(last.keys.iter().all(|&key| key != COLD && key != ON_FRINGE), "{name}: all have keys");
            // A comb is longer than the loops of one invocation of lavapipe.
            if nodes.len() < 20_000 {
                for (stage, after) in (1..).zip(&stages) {
                    let alone = unfold_alone(&nodes, stage, &mut **device);
                    assert!(alone == (after.keys.clone(), lengths(&after.books)), "{name}: {stage} stages alone");
                }
            }
            let sets = stages.iter().map(|stage| stage.keys.clone()).collect();
            assert!(first.as_ref().is_none_or(|first| *first == sets), "{name}: keys");
            first = Some(sets);
        }
        first.unwrap().len()
    })
}

#[test]
fn unfolding_comes_to_every_node_once() {
    for (triangles, seed) in [(soup(2, 0.3, 1), 1), (soup(3, 0.3, 1), 1), (soup(3000, 0.05, 2), 2), (grid(20), 3)] {
        let stages = check_unfolding(&tree_of(&triangles, seed));
        assert!(triangles.len() < 1000 || stages > 3, "{stages} stages");
    }
}

/// No walk ends in silence: the part of a comb that one does not come to waits for the next.
#[test]
fn unfolding_a_comb_takes_more_than_one_walk() {
    let stages = check_unfolding(&row_comb(20_000));
    assert!(stages >= 5, "{stages} stages of 4096 steps");
}

/// Dual moves of all nodes of a tree, as the search finds them.
fn dual_moves(nodes: &[Node]) -> Vec<Move> {
    let (count, all) = (nodes.len() as u32 / 2, nodes.len() as u32);
    let params = DualParams { count, nodes: all, both_orders: 1, climb: TO_THE_ROOT, slack: 0.0, row: 0 };
    let mut report = [0; REPORT];
    let report = AtomicU32::from_mut_slice(&mut report);
    (0..count).map(|input| search(input, &params, nodes, report)).collect()
}

fn dual_params(found: &[Move], nodes: &[Node]) -> PrbvhParams {
    let every = PrbvhParams::every(1, 0, nodes.len() as u32);
    PrbvhParams { count: found.len() as u32, flags: DUAL, scale: 1.0, ..every }
}

fn claimants(tree: &NaiveTree, found: &[Move]) -> Vec<Claimant> {
    let nodes = tree.encode();
    let open = found.iter().filter(|found| found.is_open());
    open.map(|found| Claimant::alone(*found, topology(tree, &DualMove::new(&nodes[..], found)))).collect()
}

#[test]
fn rounds_of_locks_win_what_naive_ones_win() {
    let mut later = 0;
    for seed in 0..4 {
        let tree = tree_of(&if seed == 3 { grid(12) } else { soup(150, 0.1, seed) }, seed);
        let nodes = tree.encode();
        let found = dual_moves(&nodes);
        let claimants = claimants(&tree, &found);
        for count in 1..=4 {
            let checked = lock_rounds(&nodes, &found, &dual_params(&found, &nodes), count);
            assert_eq!(rounds_fault(&claimants, &checked, count), None, "{count} rounds");
        }
        later += rounds(nodes.len(), &claimants, 4).iter().filter(|won| won.is_some_and(|round| round > 0)).count();
    }
    assert!(later > 10, "{later} moves won in a later round");
}

/// Between two rounds the nodes of the winners are taken, and all others free.
#[test]
fn winners_keep_their_nodes_between_rounds() {
    use prbvh_kernel::prbvh::ROUNDS;
    let tree = tree_of(&soup(150, 0.1, 1), 1);
    let nodes = tree.encode();
    let found = dual_moves(&nodes);
    let claimants = claimants(&tree, &found);
    let params = PrbvhParams { flags: DUAL | ROUNDS, ..dual_params(&found, &nodes) };
    let checked = prbvh_tests::locks::lock_and_check(&nodes, &found, &vec![0; nodes.len()], &params);
    let won = rounds(nodes.len(), &claimants, 1);
    let winners = claimants.iter().zip(&won).filter(|(_, won)| won.is_some());
    let expected: BTreeSet<u32> = winners.flat_map(|(each, _)| each.written.iter().copied()).collect();
    assert!(!expected.is_empty() && taken(&checked.locks) == expected);
    assert!((0..).zip(&checked.locks).all(|(v, &lock)| lock == 0 || expected.contains(&v)));
}

#[test]
fn a_planted_fault_of_a_round_of_locks_is_noticed() {
    let tree = tree_of(&soup(150, 0.1, 1), 1);
    let nodes = tree.encode();
    let found = dual_moves(&nodes);
    let claimants = claimants(&tree, &found);
    let right = lock_rounds(&nodes, &found, &dual_params(&found, &nodes), 2);
    let fault = |change: &dyn Fn(&mut Checked)| {
        let mut checked = right.clone();
        change(&mut checked);
        rounds_fault(&claimants, &checked, 2).expect("a planted fault")
    };
    let winner = right.found.iter().position(Move::has_won).unwrap();
    let loser = right.found.iter().position(|found| !found.has_won()).unwrap();
    assert!(fault(&|checked| checked.found[winner].input &= !WON).contains("has won"));
    assert!(
        fault(&|checked| checked.found[loser] = Move { input: loser as u32 | WON, output: 5, ..Move::NONE })
            .contains("has won")
    );
    assert!(fault(&|checked| checked.locks[7] = u64::MAX).contains("7 is not free"));
    // One round less is another result.
    assert!(rounds_fault(&claimants, &lock_rounds(&nodes, &found, &dual_params(&found, &nodes), 1), 2).is_some());
}

/// Rounds that change the same nodes over and over; the best tree is the first, or one in between.
#[test]
fn the_best_tree_comes_back_after_several_rounds() {
    let first = tree_of(&soup(200, 0.2, 3), 3);
    let mut tree = first.clone();
    let mut kept = nothing_kept(first.children.len());
    let mut trees = Vec::new();
    for (round, epoch) in [1, 1, 2, 2, 2].into_iter().enumerate() {
        trees.push(tree.clone());
        let nodes = tree.encode();
        let found = dual_moves(&nodes);
        let params = dual_params(&found, &nodes);
        let moved = reinsert(&nodes, &lock_rounds(&nodes, &found, &params, 2).found, &kept, epoch, &params);
        assert!(moved.applied > 3, "round {round}: {} moves", moved.applied);
        kept = moved.kept;
        let after = NaiveTree::decode(&moved.nodes);
        let restored = NaiveTree::decode(&restore(&moved.nodes, &kept, epoch));
        let best = if epoch == 1 { &first } else { &trees[2] };
        assert_eq!(restored.children, best.children, "round {round}");
        assert_ne!(after.children, best.children, "round {round}: there was something to bring back");
        tree = after;
        tree.refit(0);
    }
    // A node that is not noted stays as it is.
    let noted = kept.iter().position(|kept| kept.epoch == 2).unwrap();
    kept[noted].epoch = 1;
    let links = |nodes: &[Node]| nodes.iter().map(|node| (node.up, node.down)).collect::<Vec<_>>();
    assert_ne!(links(&restore(&tree.encode(), &kept, 2)), links(&trees[2].encode()));
}

//! Every kernel against a naive oracle, on every device, in every order.

use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::cost::{COST_CHUNK, CostParams, NO_REFIT};
use prbvh_kernel::lbvh::{HierarchyParams, LeavesParams};
use prbvh_kernel::morton::MortonParams;
use prbvh_kernel::node::Node;
use prbvh_kernel::refit::RefitParams;
use prbvh_kernel::setup::{BOUNDS_CHUNK, BoundsParams, BoxesParams, Triangle};
use prbvh_kernel::sort::{DIGITS, GatherParams, SortParams};
use prbvh_kernel::status::{FAULT_BROKEN_TREE, FAULTS, REPORT_WORDS};
use prbvh_kernel::{Kernel, grid};
use prbvh_tests::compare::Case;
use prbvh_tests::fixtures::{Random, soup};
use prbvh_tests::numerics::f32_sum::chunk_sum;
use prbvh_tests::oracle::{NaiveTree, radix_tree_leaf_sets, random_tree};
use proptest::collection::vec;
use proptest::prelude::*;

/// Numbers of items around those of lanes, of steps and of chunks, none among them.
fn sizes(chunk: u32) -> impl Iterator<Item = u32> {
    let around = |n: u32| n - 1..=n + 1;
    [0].into_iter()
        .chain(around(1).skip(1))
        .chain(around(64))
        .chain(around(128))
        .chain(around(chunk))
        .chain([5 * chunk + 77])
}

fn boxes_of(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

#[test]
fn setup_boxes_is_the_box_of_the_corners() {
    let triangles = soup(1000, 0.3, 1);
    let params = BoxesParams { count: 1000 };
    let result = Case::new(Kernel::SetupBoxes, 1000, &params).with(&triangles).zeros(1000).run_everywhere();
    for (triangle, aabb) in triangles.iter().zip(result.get::<Aabb>("boxes")) {
        for k in 0..3 {
            let corners = [triangle.a[k], triangle.b[k], triangle.c[k]];
            assert_eq!(aabb.min[k], corners.into_iter().fold(f32::INFINITY, f32::min));
            assert_eq!(aabb.max[k], corners.into_iter().fold(f32::NEG_INFINITY, f32::max));
        }
    }
}

#[test]
fn setup_bounds_unites_each_chunk() {
    for n in sizes(BOUNDS_CHUNK) {
        let boxes = boxes_of(&soup(n.max(1) as usize, 0.3, 2));
        let groups = n.div_ceil(BOUNDS_CHUNK);
        let params = BoundsParams { count: grid::invocations(groups), boxes: n };
        let case = Case::new(Kernel::SetupBounds, params.count, &params).with(&boxes).zeros(groups.max(1) as usize);
        let expected = boxes[..n as usize].chunks(BOUNDS_CHUNK as usize);
        let expected: Vec<Aabb> =
            expected.map(|chunk| chunk.iter().fold(Aabb::EMPTY, |sum, aabb| sum.union(*aabb))).collect();
        assert_eq!(case.run_everywhere().get::<Aabb>("united")[..groups as usize], expected, "{n} boxes");
    }
}

/// Interleaves bit by bit.
fn morton(cells: [u64; 3], bits: u32) -> u64 {
    (0..bits)
        .flat_map(|bit| (0..3).map(move |k| (bit, k)))
        .fold(0, |code, (bit, k)| code | (cells[k] >> bit & 1) << (3 * bit + k as u32))
}

fn cells(aabb: &Aabb, bits: u32, extent: [f64; 3]) -> [u64; 3] {
    [0, 1, 2].map(|k| {
        let centre = 0.5 * (aabb.min[k] + aabb.max[k]);
        let per_unit = if extent[k] > 0.0 { (f64::from(1u32 << bits) / extent[k]) as f32 } else { 0.0 };
        ((centre * per_unit).floor() as u64).min((1 << bits) - 1)
    })
}

#[test]
fn morton_codes_interleave_the_cells() {
    let boxes = boxes_of(&soup(2000, 0.1, 3));
    for extent in [[1.1f64; 3], [2.0, 0.0, 1.5]] {
        let per_unit = |bits: u32| extent.map(|e| if e > 0.0 { (f64::from(1u32 << bits) / e) as f32 } else { 0.0 });
        let params = |bits| MortonParams { count: 2000, origin: [0.0; 3], cells_per_unit: per_unit(bits) };
        let thirty =
            Case::new(Kernel::Morton30, 2000, &params(10)).with(&boxes).zeros(2000).zeros(2000).run_everywhere();
        let sixty = Case::new(Kernel::Morton60, 2000, &params(20))
            .with(&boxes)
            .zeros(2000)
            .zeros(2000)
            .zeros(2000)
            .run_everywhere();
        let (high, low) = (sixty.get::<u32>("high"), sixty.get::<u32>("low"));
        for (i, aabb) in boxes.iter().enumerate() {
            assert_eq!(u64::from(thirty.get::<u32>("codes")[i]), morton(cells(aabb, 10, extent), 10));
            assert_eq!(u64::from(high[i]) << 30 | u64::from(low[i]), morton(cells(aabb, 20, extent), 20));
        }
        assert_eq!(sixty.get::<u32>("order"), (0..2000).collect::<Vec<_>>());
        assert_eq!(thirty.get::<u32>("order"), (0..2000).collect::<Vec<_>>());
    }
}

/// A pass of a sort, kernel by kernel.
struct Pass {
    params: SortParams,
    keys: Vec<u32>,
}

impl Pass {
    fn new(keys: Vec<u32>, chunk: u32, shift: u32) -> Self {
        let pairs = keys.len() as u32;
        let chunks = pairs.div_ceil(chunk);
        Self { params: SortParams { count: grid::invocations(chunks), pairs, chunk, chunks, shift }, keys }
    }

    fn digit(&self, key: u32) -> usize {
        (key >> self.params.shift) as usize % DIGITS
    }

    fn count(&self) -> Vec<u32> {
        let case = Case::new(Kernel::SortCount, self.params.count, &self.params).with(&self.keys);
        case.zeros(self.params.chunks as usize * DIGITS).run_everywhere().get("table")
    }

    fn rows(&self, table: &[u32]) -> (Vec<u32>, Vec<u32>) {
        let params = SortParams { count: grid::invocations(DIGITS as u32), ..self.params };
        let case = Case::new(Kernel::SortRows, params.count, &params).with(table).zeros(DIGITS);
        let result = case.run_everywhere();
        (result.get("table"), result.get("totals"))
    }

    fn scatter(&self, kernel: Kernel, table: &[u32], totals: &[u32]) -> Vec<(u32, u32)> {
        let values: Vec<u32> = (0..self.params.pairs).collect();
        let count = if kernel == Kernel::SortScatter { self.params.count } else { self.params.chunks };
        let params = SortParams { count, ..self.params };
        let case = Case::new(kernel, count, &params).with(&self.keys).with(&values);
        let case = case.with(table).with(totals).zeros(values.len()).zeros(values.len());
        let result = case.run_everywhere();
        result.get("sorted_keys").into_iter().zip(result.get("sorted_values")).collect()
    }
}

fn random_keys(length: u32, mask: u32) -> Vec<u32> {
    let mut random = Random(4);
    (0..length).map(|_| random.bits() as u32 & mask).collect()
}

#[test]
fn sort_count_counts_the_digits_of_each_chunk() {
    for (length, chunk) in [(1, 64), (1000, 300), (1025, 512), (100_000, 7777)] {
        let pass = Pass::new(random_keys(length, u32::MAX), chunk, 8);
        let table = pass.count();
        let chunks = pass.params.chunks as usize;
        for digit in 0..DIGITS {
            for (column, keys) in pass.keys.chunks(chunk as usize).enumerate() {
                let expected = keys.iter().filter(|&&key| pass.digit(key) == digit).count();
                assert_eq!(table[digit * chunks + column] as usize, expected);
            }
        }
    }
}

#[test]
fn sort_rows_makes_an_exclusive_scan_of_each_row() {
    for chunks in [1, 2, 63, 64, 65, 127, 128, 129, 500, 4096] {
        let pass = Pass::new(vec![0; chunks], 1, 0);
        let table = random_keys((DIGITS * chunks) as u32, u32::MAX);
        let (scanned, totals) = pass.rows(&table);
        for (d, row) in table.chunks(chunks).enumerate() {
            let mut sum = 0u32;
            for (k, count) in row.iter().enumerate() {
                assert_eq!(scanned[d * chunks + k], sum, "row {d}, word {k} of {chunks}");
                sum = sum.wrapping_add(*count);
            }
            assert_eq!(totals[d], sum, "row {d}");
        }
    }
}

/// Keys of all digits, of few, of one; chunks that end in the middle of a step.
#[test]
fn a_pass_is_one_of_a_stable_sort() {
    for length in [1, 2, 63, 64, 65, 127, 128, 129, 255, 256, 257, 1000, 4095, 4097, 100_000] {
        for (mask, chunk, shift) in
            [(u32::MAX, 512, 24), (0x0300, 77, 8), (0, 200, 0), (u32::MAX, 1 << 15, 30), (0xff, 64, 4)]
        {
            if length > 5000 && chunk < 200 {
                continue;
            }
            let pass = Pass::new(random_keys(length, mask), chunk, shift);
            let (table, totals) = pass.rows(&pass.count());
            let mut expected: Vec<(u32, u32)> = pass.keys.iter().copied().zip(0..).collect();
            expected.sort_by_key(|(key, _)| pass.digit(*key));
            for kernel in [Kernel::SortScatter, Kernel::SortScatterAlone] {
                let sorted = pass.scatter(kernel, &table, &totals);
                assert!(sorted == expected, "{kernel:?}: {length} keys of {mask:#x}, chunks of {chunk}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_pass_of_any_keys_and_chunks_is_stable(keys in vec(any::<u32>(), 1..400), chunk in 1u32..300, shift in 0u32..32) {
        let pass = Pass::new(keys, chunk, shift);
        let (table, totals) = pass.rows(&pass.count());
        let mut expected: Vec<(u32, u32)> = pass.keys.iter().copied().zip(0..).collect();
        expected.sort_by_key(|(key, _)| pass.digit(*key));
        for kernel in [Kernel::SortScatter, Kernel::SortScatterAlone] {
            prop_assert_eq!(&pass.scatter(kernel, &table, &totals), &expected);
        }
    }
}

#[test]
fn sort_gather_follows_the_order() {
    let order = [3u32, 0, 2, 1, 1];
    let words = [10u32, 11, 12, 13];
    let case = Case::new(Kernel::SortGather, 5, &GatherParams { count: 5 }).with(&order).with(&words).zeros(5);
    assert_eq!(case.run_everywhere().get::<u32>("gathered"), [13, 10, 12, 11, 11]);
}

/// Ranges of leaves below each node.
fn leaf_range(tree: &NaiveTree, v: u32, sets: &mut Vec<(usize, usize)>) -> (usize, usize) {
    let range = match tree.children[v as usize][..] {
        [left, right] => (leaf_range(tree, left, sets).0, leaf_range(tree, right, sets).1),
        _ => {
            let leaf = v as usize - tree.children.len() / 2;
            (leaf, leaf)
        }
    };
    sets.push(range);
    range
}

fn check_hierarchy(codes: &[u64]) {
    let n = codes.len();
    let high: Vec<u32> = codes.iter().map(|code| (code >> 30) as u32).collect();
    let low: Vec<u32> = codes.iter().map(|code| (code & 0x3fff_ffff) as u32).collect();
    let params = HierarchyParams { count: n as u32 - 1 };
    let case = Case::new(Kernel::LbvhHierarchy, n as u32 - 1, &params).with(&high).with(&low);
    let tree = NaiveTree::decode(&case.zeros(2 * n - 1).run_everywhere().get::<Node>("nodes"));
    let mut sets = Vec::new();
    leaf_range(&tree, 0, &mut sets);
    sets.sort_unstable();
    assert_eq!(sets, radix_tree_leaf_sets(codes).into_iter().collect::<Vec<_>>());
}

#[test]
fn lbvh_hierarchy_is_the_radix_tree() {
    let mut random = Random(7);
    for n in [2, 3, 4, 7, 64, 1000] {
        for mask in [0, 1, 0xff, (1 << 30) | 1, (1 << 60) - 1] {
            let mut codes: Vec<u64> = (0..n).map(|_| random.bits() & mask).collect();
            codes.sort_unstable();
            check_hierarchy(&codes);
        }
    }
}

#[test]
fn lbvh_leaves_hold_the_references_in_order() {
    let boxes = boxes_of(&soup(5, 0.3, 8));
    let order = [4u32, 2, 0, 1, 3];
    let case = Case::new(Kernel::LbvhLeaves, 5, &LeavesParams { count: 5 }).with(&order).with(&boxes).zeros(9);
    let nodes = case.run_everywhere().get::<Node>("nodes");
    for (k, &reference) in order.iter().enumerate() {
        assert_eq!(nodes[4 + k].down, reference);
        assert_eq!(nodes[4 + k].aabb(), boxes[reference as usize]);
    }
}

#[test]
fn refit_unites_the_children_everywhere() {
    for n in [1, 2, 3, 100, 3000] {
        let tree = random_tree(&boxes_of(&soup(n, 0.2, 9)), n as u64);
        let mut stale = tree.clone();
        for aabb in &mut stale.boxes[..n - 1] {
            *aabb = Aabb { min: [9.0; 3], max: [9.0; 3] };
        }
        let params = RefitParams { count: n as u32 };
        let case = Case::new(Kernel::Refit, n as u32, &params).with(&stale.encode()).zeros(n.max(2) - 1);
        let result = case.run_everywhere();
        assert!(NaiveTree::decode(&result.get::<Node>("nodes")) == tree, "{n} references");
        assert!(result.get::<u32>("arrivals")[..n - 1].iter().all(|&arrivals| arrivals == 2));
    }
}

/// What a device adds up, and in which shape, to the bit.
#[test]
fn cost_adds_up_chunks() {
    for n in sizes(COST_CHUNK).filter(|&n| n > 0) {
        let tree = random_tree(&boxes_of(&soup(n as usize, 0.1, 10)), 1);
        let areas: Vec<f32> = tree.boxes.iter().map(|aabb| aabb.half_area()).collect();
        for (first, nodes) in [(0, n - 1), (n - 1, n), (0, 1), (n / 2, n)] {
            let groups = nodes.div_ceil(COST_CHUNK);
            let count = grid::invocations(groups);
            let params = CostParams { count, first, nodes, internal: n - 1, to: 3, arrived: NO_REFIT };
            let case = Case::new(Kernel::Cost, count, &params).with(&tree.encode()).with(&[7]);
            let result = case.zeros(groups as usize + 4).zeros(REPORT_WORDS as usize).run_everywhere();
            let chunks = areas[first as usize..][..nodes as usize].chunks(COST_CHUNK as usize);
            let expected: Vec<f32> = [0.0; 3].into_iter().chain(chunks.map(chunk_sum)).chain([0.0]).collect();
            assert_eq!(result.get::<f32>("partial"), expected, "{nodes} of {n} from {first} on");
            assert_eq!(result.get::<u32>("report")[FAULTS], 0);
        }
    }
}

#[test]
fn cost_reports_broken_trees() {
    let n = 3000u32;
    let tree = random_tree(&boxes_of(&soup(n as usize, 0.1, 10)), 1);
    let groups = (n - 1).div_ceil(COST_CHUNK);
    let count = grid::invocations(groups);
    let params = CostParams { count, first: 0, nodes: n - 1, internal: n - 1, to: 0, arrived: 2 };
    for (broken, faults) in [(None, 0), (Some(1234), FAULT_BROKEN_TREE), (Some(n as usize - 2), FAULT_BROKEN_TREE)] {
        let mut arrivals = vec![2u32; n as usize - 1];
        broken.into_iter().for_each(|v: usize| arrivals[v] = 1);
        let case = Case::new(Kernel::Cost, count, &params).with(&tree.encode()).with(&arrivals);
        let result = case.zeros(groups as usize).zeros(REPORT_WORDS as usize).run_everywhere();
        assert_eq!(result.get::<u32>("report")[FAULTS], faults);
    }
}

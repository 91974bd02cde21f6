//! Every kernel against a naive oracle, on every device, in every order.

use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::cost::{COST_CHUNK, CostParams};
use prbvh_kernel::lbvh::{HierarchyParams, LeavesParams};
use prbvh_kernel::morton::MortonParams;
use prbvh_kernel::node::Node;
use prbvh_kernel::refit::RefitParams;
use prbvh_kernel::setup::{BOUNDS_CHUNK, BoundsParams, BoxesParams, Triangle};
use prbvh_kernel::sort::{DIGITS, GatherParams, SCAN_CHUNK, ScanParams, SortParams};
use prbvh_kernel::status::{FAULT_BROKEN_TREE, FAULTS, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::fixtures::{Random, soup};
use prbvh_tests::oracle::{NaiveTree, half_area, radix_tree_leaf_sets, random_tree};

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
    let boxes = boxes_of(&soup(1000, 0.3, 2));
    let count = 1000u32.div_ceil(BOUNDS_CHUNK);
    let params = BoundsParams { count, boxes: 1000 };
    let result = Case::new(Kernel::SetupBounds, count, &params).with(&boxes).zeros(count as usize).run_everywhere();
    let expected: Vec<Aabb> = boxes
        .chunks(BOUNDS_CHUNK as usize)
        .map(|chunk| chunk.iter().fold(Aabb::EMPTY, |sum, aabb| sum.union(*aabb)))
        .collect();
    assert_eq!(result.get::<Aabb>("united"), expected);
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

#[test]
fn sort_count_counts_the_digits_of_each_chunk() {
    let mut random = Random(4);
    let keys: Vec<u32> = (0..1000).map(|_| random.bits() as u32).collect();
    let params = SortParams { count: 4, pairs: 1000, chunk: 300, shift: 8 };
    let table = Case::new(Kernel::SortCount, 4, &params).with(&keys).zeros(4 * DIGITS).run_everywhere();
    let table = table.get::<u32>("table");
    for digit in 0..DIGITS {
        for (chunk, keys) in keys.chunks(300).enumerate() {
            let expected = keys.iter().filter(|&&key| (key >> 8) as usize % DIGITS == digit).count();
            assert_eq!(table[digit * 4 + chunk] as usize, expected);
        }
    }
}

#[test]
fn sort_scatter_is_one_pass_of_a_stable_sort() {
    let mut random = Random(5);
    let keys: Vec<u32> = (0..1000).map(|_| random.bits() as u32).collect();
    let values: Vec<u32> = (0..1000).collect();
    let params = SortParams { count: 4, pairs: 1000, chunk: 300, shift: 24 };
    let counted = Case::new(Kernel::SortCount, 4, &params).with(&keys).zeros(4 * DIGITS).run_everywhere();
    let table: Vec<u32> = counted
        .get::<u32>("table")
        .into_iter()
        .scan(0, |sum, count| {
            *sum += count;
            Some(*sum - count)
        })
        .collect();
    let case = Case::new(Kernel::SortScatter, 4, &params).with(&keys).with(&values).with(&table);
    let result = case.zeros(1000).zeros(1000).run_everywhere();
    let mut expected: Vec<(u32, u32)> = keys.into_iter().zip(values).collect();
    expected.sort_by_key(|(key, _)| key >> 24);
    assert_eq!(result.get::<u32>("sorted_keys"), expected.iter().map(|pair| pair.0).collect::<Vec<_>>());
    assert_eq!(result.get::<u32>("sorted_values"), expected.iter().map(|pair| pair.1).collect::<Vec<_>>());
}

#[test]
fn the_three_scan_kernels_make_an_exclusive_scan() {
    let mut random = Random(6);
    let words: Vec<u32> = (0..2000).map(|_| random.bits() as u32).collect();
    let chunks = 2000u32.div_ceil(SCAN_CHUNK);
    let params = ScanParams { count: chunks, words: 2000 };
    let sums = Case::new(Kernel::ScanSums, chunks, &params).with(&words).zeros(chunks as usize).run_everywhere();
    let spine = ScanParams { count: 1, words: chunks };
    let spine = Case::new(Kernel::ScanSpine, 1, &spine).with(&sums.get::<u32>("sums")).run_everywhere();
    let case = Case::new(Kernel::ScanApply, chunks, &params).with(&spine.get::<u32>("sums")).with(&words);
    let expected: Vec<u32> = words
        .iter()
        .scan(0u32, |sum, &word| {
            let before = *sum;
            *sum = sum.wrapping_add(word);
            Some(before)
        })
        .collect();
    assert_eq!(case.run_everywhere().get::<u32>("words"), expected);
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

#[test]
fn cost_adds_up_chunks_and_reports_broken_trees() {
    let n = 2000u32;
    let tree = random_tree(&boxes_of(&soup(n as usize, 0.1, 10)), 1);
    let count = (n - 1).div_ceil(COST_CHUNK);
    let params = CostParams { count, first: 0, nodes: n - 1, internal: n - 1, to: 0, arrived: 2 };
    let case = |arrivals: &[u32]| {
        Case::new(Kernel::Cost, count, &params)
            .with(&tree.encode())
            .with(arrivals)
            .zeros(count as usize)
            .zeros(REPORT_WORDS as usize)
            .run_everywhere()
    };
    let mut arrivals = vec![2u32; n as usize - 1];
    let result = case(&arrivals);
    let expected = tree.boxes[..n as usize - 1].chunks(COST_CHUNK as usize);
    for (partial, chunk) in result.get::<f32>("partial").into_iter().zip(expected) {
        let expected: f64 = chunk.iter().map(half_area).sum();
        assert!((f64::from(partial) / expected - 1.0).abs() < 1e-5, "{partial} is not {expected}");
    }
    assert_eq!(result.get::<u32>("report")[FAULTS], 0);
    arrivals[1234] = 1;
    assert_eq!(case(&arrivals).get::<u32>("report")[FAULTS], FAULT_BROKEN_TREE);
}

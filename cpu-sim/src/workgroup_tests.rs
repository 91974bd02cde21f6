//! What a workgroup promises, and that orders find who breaks the promise.

use crate::dispatch::{Executor, Order};
use prbvh_kernel::grid::WORKGROUP_SIZE;
use prbvh_kernel::mem::SharedU32;
use prbvh_kernel::native::{Alone, Lanes};
use prbvh_kernel::workgroup::{SCAN_WORDS, Workgroup, scan, total};
use proptest::prelude::*;
use std::cell::{Cell, RefCell};

const ORDERS: [Order; 4] = [Order::Ascending, Order::Descending, Order::Shuffled(1), Order::Shuffled(2)];

fn executor(order: Order) -> Executor {
    Executor::new(order, 1).unwrap()
}

/// The results of a kernel in every order; the first is that of the lane that is alone.
macro_rules! everywhere {
    ($words:expr, |$w:ident, $shared:ident| $body:expr) => {{
        let $w = &Alone { group: 5 };
        let $shared = &$w.memory::<{ $words }>();
        let mut results = vec![$body];
        for order in ORDERS {
            let executor = executor(order);
            let $w = &Lanes::new(&executor, 5);
            let $shared = &$w.memory::<{ $words }>();
            results.push($body);
        }
        results
    }};
}

fn all_equal<T: PartialEq>(results: &[T]) -> bool {
    results.windows(2).all(|pair| pair[0] == pair[1])
}

#[test]
fn a_phase_runs_each_lane_once_and_ends_before_the_next() {
    for order in ORDERS {
        let executor = executor(order);
        let w = Lanes::new(&executor, 0);
        let order_of_lanes = RefCell::new(Vec::new());
        for phase in 0..3 {
            w.phase(|lane| order_of_lanes.borrow_mut().push((phase, lane)));
        }
        let mut runs = order_of_lanes.into_inner();
        assert!(runs.is_sorted_by_key(|(phase, _)| *phase), "{order:?}");
        runs.sort_unstable();
        let expected: Vec<_> = (0..3).flat_map(|phase| (0..WORKGROUP_SIZE).map(move |lane| (phase, lane))).collect();
        assert_eq!(runs, expected, "{order:?}");
    }
}

#[test]
fn phases_and_groups_are_shuffled_each_in_its_own_way() {
    let executor = executor(Order::Shuffled(7));
    let lanes = |w: &Lanes<'_, Executor>| {
        let lanes = RefCell::new(Vec::new());
        w.phase(|lane| lanes.borrow_mut().push(lane));
        lanes.into_inner()
    };
    let (first, second) = (Lanes::new(&executor, 0), Lanes::new(&executor, 1));
    let orders = [lanes(&first), lanes(&first), lanes(&second)];
    assert!(orders[0] != orders[1] && orders[0] != orders[2] && orders[1] != orders[2]);
}

#[test]
fn each_goes_over_all_items_once() {
    for count in [0, 1, 63, 64, 65, 1000] {
        let counts = everywhere!(1, |w, _shared| {
            let items: Vec<Cell<u32>> = (0..count).map(|_| Cell::new(0)).collect();
            w.each(count, |k| items[k as usize].set(items[k as usize].get() + 1));
            items.iter().all(|item| item.get() == 1)
        });
        assert!(counts.iter().all(|&once| once), "{count}");
    }
}

/// A lane that reads what its neighbour stores in the same phase.
#[test]
fn a_planted_race_has_another_result_in_each_order() {
    let run = |is_a_race: bool| {
        everywhere!(WORKGROUP_SIZE as usize, |w, shared| {
            w.each(WORKGROUP_SIZE, |k| shared[k as usize].store(k));
            let sum = Cell::new(0u32);
            if is_a_race {
                w.each(WORKGROUP_SIZE, |k| {
                    let next = shared[((k + 1) % WORKGROUP_SIZE) as usize].load();
                    shared[k as usize].store(next);
                });
            } else {
                w.each(WORKGROUP_SIZE, |k| shared[k as usize].add(1));
            }
            w.each(WORKGROUP_SIZE, |k| sum.set(sum.get().wrapping_add((k + 1) * shared[k as usize].load())));
            sum.get()
        })
    };
    assert!(all_equal(&run(false)));
    let mut results = run(true);
    // The lane that is alone goes upward.
    assert_eq!(results[0], results[1]);
    results.remove(0);
    results.sort_unstable();
    results.dedup();
    assert_eq!(results.len(), ORDERS.len(), "{results:?}");
}

/// A phase too few: the sums of the lanes are read before the barrier.
#[test]
fn a_missing_barrier_has_another_result_in_some_order() {
    let results = everywhere!(WORKGROUP_SIZE as usize + 1, |w, shared| {
        w.each(WORKGROUP_SIZE, |k| shared[k as usize].store(0));
        w.each(WORKGROUP_SIZE, |k| {
            shared[k as usize].store(k);
            if k == 0 {
                let sum: u32 = shared[..64].iter().map(SharedU32::load).sum();
                shared[64].store(sum);
            }
        });
        shared[64].load()
    });
    assert!(!all_equal(&results), "{results:?}");
}

/// A word that nobody stored.
#[test]
fn memory_has_other_words_for_other_groups() {
    let results = everywhere!(2, |w, shared| {
        w.phase(|lane| {
            if lane == 0 {
                shared[0].store(1);
            }
        });
        shared[1].load()
    });
    assert!(!all_equal(&results), "{results:?}");
}

fn scanned(values: &[u32]) -> Vec<(Vec<u32>, u32)> {
    everywhere!(SCAN_WORDS as usize + 3, |w, shared| {
        let places: Vec<Cell<u32>> = values.iter().map(|_| Cell::new(0)).collect();
        let total_of = Cell::new(0);
        scan(
            w,
            shared,
            3,
            values.len() as u32,
            |k| values[k as usize],
            |k, before| {
                places[k as usize].set(before);
                values[k as usize]
            },
        );
        w.phase(|_| total_of.set(sum(w, shared)));
        (places.iter().map(Cell::get).collect(), total_of.get())
    })
}

fn sum<W: Workgroup, const N: usize>(_: &W, shared: &[SharedU32; N]) -> u32 {
    total::<W, N>(shared, 3)
}

fn naive(values: &[u32]) -> (Vec<u32>, u32) {
    let mut sum = 0u32;
    let mut places = Vec::new();
    for value in values {
        places.push(sum);
        sum = sum.wrapping_add(*value);
    }
    (places, sum)
}

#[test]
fn a_scan_of_every_length_is_the_naive_one() {
    for count in (0..140).chain([511, 512, 513, 1023, 1024, 1025, 100_000]) {
        let values: Vec<u32> = (0..count).map(|k: u32| k.wrapping_mul(0x9e37_79b9)).collect();
        assert!(scanned(&values).iter().all(|found| *found == naive(&values)), "{count} values");
    }
}

proptest! {
    #[test]
    fn a_scan_is_the_naive_one(values: Vec<u32>) {
        prop_assert!(scanned(&values).iter().all(|found| *found == naive(&values)));
    }
}

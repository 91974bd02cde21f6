//! The numbers of runs against f64: green on every device, and red where a fault is planted.

use prbvh::build::DeviceTree;
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{Buffer, Device, DeviceError, DeviceInfo, Dispatch, MemoryUse, Recording, Timing, Traffic};
use prbvh::optimize::{CurrentTree, IterationRow, Order, PrbvhSettings, RbvhSettings, Strategy};
use prbvh::pipeline::{Optimizer, Settings};
use prbvh::scene::{SafeRange, built_in};
use prbvh_kernel::Kernel;
use prbvh_kernel::cost::{COST_CHUNK, CostParams};
use prbvh_kernel::node::ROOT;
use prbvh_kernel::prbvh::Move;
use prbvh_kernel::prbvh::worst::top::TopNode;
use prbvh_kernel::status::{FOUND, PREDICTED};
use prbvh_lab::accuracy::{AccuracyReport, AccuracyRow, BreachKind, F32_COST_BOUND, NumericsCheck};
use prbvh_tests::command::run;
use prbvh_tests::devices::devices;
use prbvh_tests::numerics::fresh_sum::Walks;
use prbvh_tests::numerics::runs::checked;
use prbvh_tests::planted::{Planted, change};
use std::collections::BTreeSet;
use tempfile::tempdir;

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

/// Worst first, and the published order with both strategies.
fn orders() -> [Settings; 3] {
    let conservative = PrbvhSettings::published().with(|s| s.strategy = Strategy::Conservative);
    [PrbvhSettings::default(), PrbvhSettings::published(), conservative]
        .map(|prbvh| Settings::default().with(|s| s.prbvh = prbvh))
}

/// What does not depend on time.
fn timeless(report: &AccuracyReport) -> AccuracyReport {
    let mut report = report.clone();
    report.rows.iter_mut().for_each(|row| row.time_s = 0.0);
    report
}

#[test]
fn every_device_has_the_same_numbers_and_they_are_green() {
    let scene = built_in(2000);
    for settings in orders() {
        let (order, strategy) = (settings.prbvh.order, settings.prbvh.strategy);
        let mut first: Option<AccuracyReport> = None;
        for (name, mut device) in devices() {
            let report = timeless(&checked(&scene, &mut *device, &settings).unwrap());
            assert!(report.is_green(), "{name}: {:?}", report.breaches);
            assert!(first.get_or_insert_with(|| report.clone()) == &report, "{name} has other numbers");
        }
        let report = first.unwrap();
        assert!(report.rows.len() > 10);
        let search = report.search.as_ref().unwrap();
        assert!(search.offered > 500 && search.candidates >= search.offered && search.raising == 0, "{search:?}");
        assert_eq!((search.drift.count, search.decrease_error.count), (search.offered, search.offered));
        // Dual moves are summed up in one way only.
        assert!(order == Order::Published || search.drift.max == 0.0);
        assert!(search.decrease_error.max > 0.0 && search.decrease_error.bound_of(0.5) < 1e-5);
        let worst = report.worst_cost().unwrap().cost_error;
        assert!(worst > 0.0 && worst <= F32_COST_BOUND, "{worst}");
        // A bound that allows everything would test nothing.
        let bounds = report.rows.iter().map(|row| row.cost_bound);
        assert!(bounds.fold(0.0, f64::max) < 2.0 * F32_COST_BOUND, "{order}");
        let (predicted, measured) = report.decreases();
        let AccuracyRow { exact_cost: initial, .. } = report.rows[0];
        let last = report.rows[report.rows.len() - 1].exact_cost;
        assert!((initial - last - measured).abs() < 1e-9 * initial);
        let bounds: Vec<f64> = report.rows[1..].iter().filter_map(|row| row.prediction_bound).collect();
        if (order, strategy) == (Order::Published, Strategy::Conservative) {
            assert_eq!(bounds.len(), report.rows.len() - 1);
            // A bound that allows everything would test nothing.
            assert!(bounds.iter().all(|bound| *bound < 1e-5 * initial), "{bounds:?}");
            assert!((predicted - measured).abs() < 1e-6 * initial);
        } else {
            assert!(bounds.is_empty() && predicted > measured, "{predicted} {measured}");
        }
    }
}

#[test]
fn the_sequential_optimiser_keeps_its_cost_to_a_few_roundings_of_f64() {
    let settings = Settings::default().with(|s| s.optimizer = Optimizer::Rbvh(RbvhSettings::default()));
    let report = checked(&built_in(2000), &mut CpuDevice::new(1).unwrap(), &settings).unwrap();
    assert!(report.is_green() && report.search.is_none() && report.rows.len() > 10);
    assert!(report.worst_cost().unwrap().cost_error < 1e-12);
    assert!(report.decreases().1 > 1.0);
}

/// What a fault in the device makes red, of all [`orders`].
fn red_if(
    kernel: Kernel,
    fault: impl Fn(&Dispatch, &mut dyn Device) -> Result<(), DeviceError> + Copy,
) -> [BTreeSet<String>; 3] {
    red_after(&[kernel], fault)
}

/// The same after any of these kernels.
fn red_after(
    kernels: &[Kernel],
    fault: impl Fn(&Dispatch, &mut dyn Device) -> Result<(), DeviceError> + Copy,
) -> [BTreeSet<String>; 3] {
    orders().map(|settings| {
        let after = |dispatch: &Dispatch, device: &mut dyn Device| {
            if kernels.contains(&dispatch.kernel) { fault(dispatch, device) } else { Ok(()) }
        };
        let mut device = Planted::new(Box::new(CpuDevice::new(2).unwrap()), after);
        let report = checked(&built_in(2000), &mut device, &settings).unwrap();
        assert_eq!(report.is_green(), report.verdict().is_none());
        report.breaches.iter().map(|breach| format!("{:?}", breach.kind)).collect()
    })
}

fn kinds(kinds: &[BreachKind]) -> BTreeSet<String> {
    kinds.iter().map(|kind| format!("{kind:?}")).collect()
}

/// The kernel's partial sums of areas, times `1 + part`; not where it is asked for the root alone.
fn corrupt_areas(part: f32) -> [BTreeSet<String>; 3] {
    red_if(Kernel::Cost, move |dispatch, device| {
        let params: CostParams = bytemuck::pod_read_unaligned(&dispatch.push);
        if params.nodes == 1 {
            return Ok(());
        }
        change(device, &dispatch.buffers[2], |partial: &mut [f32]| {
            let sums = &mut partial[params.to as usize..][..params.nodes.div_ceil(COST_CHUNK) as usize];
            sums.iter_mut().for_each(|sum| *sum *= 1.0 + part);
        })
    })
}

#[test]
fn no_fault_no_red() {
    assert_eq!(corrupt_areas(0.0), [kinds(&[]), kinds(&[]), kinds(&[])]);
}

#[test]
fn corrupted_sums_of_areas_are_red_from_the_bound_on() {
    let bound = F32_COST_BOUND as f32;
    assert_eq!(corrupt_areas(0.5 * bound), [kinds(&[]), kinds(&[]), kinds(&[])]);
    for part in [1.5 * bound, -1.5 * bound, 0.1] {
        assert_eq!(corrupt_areas(part), [BreachKind::Cost; 3].map(|kind| kinds(&[kind])), "{part}");
    }
}

#[test]
fn corrupted_predictions_are_red_where_they_are_promises() {
    let corrupt = |dispatch: &Dispatch, device: &mut dyn Device| {
        let report = dispatch.buffers.iter().find(|buffer| buffer.label == "report").unwrap();
        // A thousandth more in the upper word, which is a large number in all rounds that matter.
        change(device, report, |words: &mut [u32]| words[PREDICTED + 1] += words[PREDICTED + 1] / 1000)
    };
    // Rounds of worst first are small here.
    let red = red_after(&[Kernel::PrbvhCheck, Kernel::WorstTail], corrupt);
    assert_eq!(red, [kinds(&[BreachKind::Prediction]), kinds(&[]), kinds(&[BreachKind::Prediction])]);
}

#[test]
fn a_search_that_misses_a_move_is_red() {
    let forget = |dispatch: &Dispatch, device: &mut dyn Device| {
        let buffer = |label: &str| dispatch.buffers.iter().find(|buffer| buffer.label == label).unwrap();
        // The report counts what the search found.
        change(device, buffer("report"), |words: &mut [u32]| words[FOUND] = words[FOUND].saturating_sub(1))?;
        change(device, buffer("found"), |found: &mut [Move]| {
            if let Some(found) = found.iter_mut().find(|found| found.is_open()) {
                *found = Move::NONE;
            }
        })
    };
    let [_, aggressive, _] = red_if(Kernel::PrbvhSearch, forget);
    assert_eq!(aggressive, kinds(&[BreachKind::Search]));
    let [worst_first, _, _] = red_if(Kernel::DualSearch, forget);
    assert_eq!(worst_first, kinds(&[BreachKind::Search]));
}

#[test]
fn a_dual_move_that_is_worth_more_than_promised_is_red() {
    let understate = |dispatch: &Dispatch, device: &mut dyn Device| {
        let found = dispatch.buffers.iter().find(|buffer| buffer.label == "found").unwrap();
        change(device, found, |found: &mut [Move]| {
            if let Some(found) = found.iter_mut().find(|found| found.is_open()) {
                found.area_decrease *= 0.1;
            }
        })
    };
    let [worst_first, _, _] = red_if(Kernel::DualSearch, understate);
    assert_eq!(worst_first, kinds(&[BreachKind::Search, BreachKind::Offer]));
}

#[test]
fn a_new_top_that_is_not_worth_what_it_claims_is_red() {
    let red_if = |part: f32| {
        let after = move |dispatch: &Dispatch, device: &mut dyn Device| {
            if dispatch.kernel != Kernel::WorstTop {
                return Ok(());
            }
            change(device, &dispatch.buffers[3], |top: &mut [TopNode]| {
                // A large top comes in pieces, and room that it does not need looks like a root without children.
                if let Some(root) = top.iter_mut().find(|node| node.v == ROOT && node.children != [0; 2]) {
                    root.node.max[0] *= part;
                }
            })
        };
        let mut device = Planted::new(Box::new(CpuDevice::new(2).unwrap()), after);
        let report = checked(&built_in(4000), &mut device, &Settings::default()).unwrap();
        report.breaches.iter().map(|breach| format!("{:?}", breach.kind)).collect::<BTreeSet<_>>()
    };
    assert_eq!(red_if(1.0), kinds(&[]));
    assert_eq!(red_if(2.0), kinds(&[BreachKind::Cost, BreachKind::Prediction]));
}

#[test]
fn a_round_that_nobody_took_note_of_is_red() {
    let scene = built_in(100);
    let mut device = CpuDevice::new(1).unwrap();
    let nodes = prbvh::build::sah_binned(&SafeRange::of(&scene.triangles).apply(&scene.triangles));
    let tree = DeviceTree::upload(&mut device, &nodes).unwrap();
    let of_scene = prbvh::bvh::Bvh::from_device(&nodes).unwrap().with_boxes_of(&scene.triangles);
    let cost = prbvh::bvh::quality(&of_scene, &Default::default()).sah_cost;
    let mut check = NumericsCheck::new(&scene, &Settings::default());
    for iteration in [0, 1] {
        let row = IterationRow::default().with(|row| {
            row.iteration = iteration;
            row.cost = cost;
            row.searched = iteration;
        });
        assert!(check.observe(&row, CurrentTree::Device(&tree, &mut device, None)).is_continue());
    }
    tree.free(&mut device);
    let breaches = check.finish().unwrap().breaches;
    assert_eq!(
        breaches.iter().map(|breach| (breach.iteration, breach.kind)).collect::<Vec<_>>(),
        [(1, BreachKind::Search)]
    );
}

#[test]
fn a_tree_that_is_none_is_red() {
    let scene = built_in(100);
    let mut device = CpuDevice::new(1).unwrap();
    let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let mut nodes = prbvh::build::sah_binned(&working);
    let mut observed = |nodes: &[prbvh_kernel::node::Node], cost: f64| {
        let tree = DeviceTree::upload(&mut device, nodes).unwrap();
        let mut check = NumericsCheck::new(&scene, &Settings::default());
        let row = IterationRow::default().with(|row| row.cost = cost);
        assert!(check.observe(&row, CurrentTree::Device(&tree, &mut device, None)).is_continue());
        tree.free(&mut device);
        check.finish().unwrap().breaches.iter().map(|breach| breach.kind).collect::<Vec<_>>()
    };
    let tree = prbvh::bvh::Bvh::from_device(&nodes).unwrap().with_boxes_of(&scene.triangles);
    let cost = prbvh::bvh::quality(&tree, &Default::default()).sah_cost;
    assert_eq!(observed(&nodes, cost), []);
    for wrong in [0.0, f64::NAN, f64::INFINITY, -cost] {
        assert_eq!(observed(&nodes, wrong), [BreachKind::Cost], "{wrong}");
    }
    nodes[3].down = 0;
    assert_eq!(observed(&nodes, cost), [BreachKind::Tree]);
}

/// Loses what it holds.
struct Fails(CpuDevice);

impl Device for Fails {
    fn info(&self) -> &DeviceInfo {
        self.0.info()
    }
    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        self.0.allocate(label, length, element_bytes)
    }
    fn free(&mut self, buffer: Buffer) {
        self.0.free(buffer);
    }
    fn upload(&mut self, buffer: &Buffer, bytes: &[u8]) -> Result<(), DeviceError> {
        self.0.upload(buffer, bytes)
    }
    fn download_from(&mut self, _: &Buffer, _: usize, _: &mut [u8]) -> Result<(), DeviceError> {
        Err(DeviceError::NoDevice("it is gone".to_owned()))
    }
    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        self.0.run(recording)
    }
    fn memory(&self) -> MemoryUse {
        self.0.memory()
    }

    fn traffic(&self) -> Traffic {
        Traffic::default()
    }
}

#[test]
fn a_device_that_fails_ends_the_check_with_its_error() {
    let scene = built_in(2);
    let mut device = Fails(CpuDevice::new(1).unwrap());
    let tree = DeviceTree::upload(&mut device, &prbvh::build::sah_binned(&scene.triangles)).unwrap();
    let mut check = NumericsCheck::new(&scene, &Settings::default());
    let flow = check.observe(&IterationRow::default(), CurrentTree::Device(&tree, &mut device, None));
    assert!(flow.is_break());
    assert!(check.finish().unwrap_err().to_string().contains("it is gone"));
}

/// Why the sum of a walk starts afresh at every pivot.
#[test]
fn one_running_sum_drifts_where_areas_differ_by_decades() {
    // Where nothing is rounded the two walks are one.
    let exact = Walks::of_case("whole-numbers");
    assert_eq!((exact.running, exact.worse), (exact.fresh.clone(), 0));
    assert!(exact.fresh.offered > 100 && exact.fresh.drift.max == 0.0, "{:?}", exact.fresh);
    let walks = Walks::of_case("teapot-in-stadium");
    assert!(walks.fresh.drift.max < 1e-6 && walks.running.drift.max > 0.1, "{walks:?}");
    assert!(walks.worse > 4 * walks.fresh_worse.max(1), "{walks:?}");
    let chain = Walks::of_case("chain-2^k");
    assert!(chain.fresh.drift.max < 1e-6 && chain.fresh.offered > chain.running.offered, "{chain:?}");
}

#[test]
fn the_command_prints_and_writes_the_numbers() {
    let folder = tempdir().unwrap();
    let base = ["-q", "optimize", "--triangles", "3000", "--device", "cpu"];
    let with = |more: &[&str]| run(PRBVH, folder.path(), &[&base, more].concat()).ok();
    let text = with(&["--check-numerics"]).stdout;
    for part in ["numbers against f64", "error of the cost", "decrease against f64", "predicted decreases"] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    assert!(!with(&[]).stdout.contains("drift"));

    let json = with(&["--check-numerics", "--json", "--out", "out"]).json();
    let accuracy = &json["accuracy"];
    let rows = accuracy["rows"].as_array().unwrap();
    assert_eq!(rows.len(), json["rows"].as_array().unwrap().len());
    assert_eq!(accuracy["breaches"].as_array().unwrap().len(), 0);
    for (checked, row) in rows.iter().zip(json["rows"].as_array().unwrap()) {
        let [cost, exact] = [&row["cost"], &checked["exact_cost"]].map(|cost| cost.as_f64().unwrap());
        assert!((cost / exact - 1.0).abs() <= F32_COST_BOUND);
        assert_eq!(checked["predicted_decrease"], row["predicted_decrease"]);
    }
    let csv = std::fs::read_to_string(folder.path().join("out/accuracy.csv")).unwrap();
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(csv.starts_with("iteration,time_s,exact_cost,cost_error,"), "{csv}");
    assert!(csv.lines().all(|line| line.split(',').count() == columns) && csv.lines().count() == rows.len() + 1);
    assert!(with(&["--json", "--out", "plain"]).json().get("accuracy").is_none());
    assert!(!folder.path().join("plain/accuracy.csv").exists());
    let svg =
        |folder_name: &str| std::fs::read_to_string(folder.path().join(folder_name).join("convergence.svg")).unwrap();
    assert!(svg("out").contains("f32") && !svg("plain").contains("f32"));
}

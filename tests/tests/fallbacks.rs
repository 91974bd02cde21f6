//! What a device may lack: each way around it, forced by a layer that hides a feature or a limit, makes the tree of the whole device. Memory that the host does not reach and queues
//! without time stamps are hidden in `device::vulkan::tests`.

use prbvh::bvh::tree_hash;
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{Device, DeviceInfo, DeviceKind};
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene::Scene;
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::Move;
use prbvh_tests::devices::vulkan_devices;
use prbvh_tests::fixtures::soup;
use prbvh_tests::hidden::Hidden;
use prbvh_tests::planted::{Planted, change};
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Tree and costs of a run, which do not depend on the device, and the kernels, which do.
struct Run {
    hash: String,
    costs: Vec<u64>,
    ran: BTreeSet<Kernel>,
}

/// Large enough for new tops and for rounds of more than one workgroup.
fn run(device: &mut dyn Device) -> Run {
    let scene = Scene::from_triangles("soup", soup(4000, 0.05, 1)).unwrap();
    let result = optimize(&scene, device, &Settings::default(), &mut |_| ControlFlow::Continue(())).unwrap();
    let costs = result.outcome.rows.iter().map(|row| row.cost.to_bits()).collect();
    Run { hash: tree_hash(&result.tree), costs, ran: result.ran }
}

/// What two runs differ in, if they do.
fn difference(whole: &Run, other: &Run) -> Option<String> {
    if let Some(row) = whole.costs.iter().zip(&other.costs).position(|(whole, other)| whole != other) {
        return Some(format!("the cost of row {row}"));
    }
    if whole.costs.len() != other.costs.len() {
        return Some(format!("{} rows, not {}", other.costs.len(), whole.costs.len()));
    }
    (whole.hash != other.hash).then(|| "the tree".to_owned())
}

/// What is hidden; a kernel that then must not run, and one that runs in its place.
struct Lack {
    name: &'static str,
    hide: fn(&mut DeviceInfo),
    without: Kernel,
    instead: Kernel,
}

const ONE_WORD: Lack = Lack {
    name: "64-bit atomics",
    hide: |info| info.atomics_64 = false,
    without: Kernel::PrbvhLock,
    instead: Kernel::PrbvhLockWords,
};
const TEN_BUFFERS: Lack = Lack {
    name: "ten buffers a kernel",
    hide: |info| info.kernel_buffers = 9,
    without: Kernel::WorstTail,
    instead: Kernel::WorstMark,
};
const LOOPS: Lack = Lack {
    name: "long loops, and lanes that run side by side",
    hide: |info| info.kind = DeviceKind::VulkanCpu,
    without: Kernel::SortScatter,
    instead: Kernel::SortScatterAlone,
};
const LANES: Lack = Lack {
    name: "a CPU",
    hide: |info| (info.kind, info.busy_invocations) = (DeviceKind::VulkanGpu, 1 << 18),
    without: Kernel::SortScatterAlone,
    instead: Kernel::SortScatter,
};
const ALL: Lack = Lack {
    name: "all of these",
    hide: |info| {
        (info.kind, info.busy_invocations) = (DeviceKind::VulkanGpu, 1);
        (info.atomics_64, info.kernel_buffers) = (false, 8);
    },
    ..ONE_WORD
};

fn check(whole: &Run, device: &mut dyn Device, Lack { name, hide, without, instead }: &Lack) {
    let other = run(&mut Hidden::new(device, hide));
    assert_eq!(difference(whole, &other), None, "without {name}");
    assert!(!other.ran.contains(without) && other.ran.contains(instead), "without {name}: {:?}", other.ran);
}

#[test]
fn every_way_around_what_is_lacking_makes_the_same_tree() {
    let mut cpu = CpuDevice::new(0).unwrap();
    let whole = run(&mut cpu);
    assert!(whole.ran.contains(&Kernel::WorstTail) && whole.ran.contains(&Kernel::WorstTop), "{:?}", whole.ran);
    for lack in [ONE_WORD, TEN_BUFFERS, LOOPS, LANES, ALL] {
        check(&whole, &mut cpu, &lack);
    }
    // Kernels of workgroups are others where lanes run side by side.
    for (_, mut device) in vulkan_devices() {
        check(&whole, &mut *device, &ALL);
    }
}

#[test]
fn another_tree_is_noticed() {
    let whole = run(&mut CpuDevice::new(0).unwrap());
    // What the first lane found is lost.
    let mut faulty = Planted::new(Box::new(CpuDevice::new(0).unwrap()), |dispatch, device| match dispatch.kernel {
        Kernel::DualSearch => change(device, &dispatch.buffers[2], |found: &mut [Move]| found[0] = Move::NONE),
        _ => Ok(()),
    });
    let difference = difference(&whole, &run(&mut faulty)).expect("a planted fault");
    assert!(difference.starts_with("the cost of row"), "{difference}");
}

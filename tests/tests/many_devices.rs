//! A process that opens devices again and again, from any thread: drivers were seen to crash it, at its end too, so it is a process of its own.

use bytemuck::cast_slice_mut;
use prbvh::device::vulkan::VulkanDevice;
use prbvh::device::{Device, Recording, Selection};
use prbvh_kernel::Kernel;
use prbvh_kernel::sort::GatherParams;
use prbvh_tests::devices::{validation_is_installed, without_vulkan};
use std::process::Command;

const THREADS: u32 = 8;
const DEVICES_OF_A_THREAD: u32 = 25;
const WORDS: u32 = 1000;
/// Set in the process that does the work.
const CHILD: &str = "PRBVH_TEST_OF_MANY_DEVICES";

/// Reverses words on a device of its own.
fn work(validate: bool) {
    let mut device = VulkanDevice::open(Selection::Automatic, validate).unwrap();
    let count = WORDS as usize;
    let [order, from, to] = ["order", "from", "to"].map(|label| device.allocate(label, count, 4).unwrap());
    let reversed: Vec<u32> = (0..WORDS).rev().collect();
    let squares: Vec<u32> = (0..WORDS).map(|k| k * k).collect();
    device.upload(&order, bytemuck::cast_slice(&reversed)).unwrap();
    device.upload(&from, bytemuck::cast_slice(&squares)).unwrap();
    let mut recording = Recording::new();
    let params = GatherParams { count: WORDS };
    recording.dispatch("gather", Kernel::SortGather, WORDS, &params, &[&order, &from, &to]);
    device.run(&recording).unwrap();
    let mut result = vec![0u32; count];
    device.download(&to, cast_slice_mut(&mut result)).unwrap();
    assert!(result.iter().rev().eq(&squares));
    device.close().unwrap();
}

#[test]
fn devices_come_and_go_on_many_threads() {
    if without_vulkan() {
        return;
    }
    if std::env::var_os(CHILD).is_none() {
        let program = std::env::current_exe().unwrap();
        let child = Command::new(program).args(["--nocapture", "--test-threads=1"]).env(CHILD, "1").output().unwrap();
        let said = String::from_utf8_lossy(&child.stderr);
        assert!(child.status.success(), "{}: {said}", child.status);
        assert!(said.contains("200 devices"), "the child did nothing: {said}");
        return;
    }
    let validation = validation_is_installed();
    std::thread::scope(|scope| {
        for thread in 0..THREADS {
            scope.spawn(move || {
                // Validated and not, in turn: both instances live in the process.
                (0..DEVICES_OF_A_THREAD).for_each(|k| work(validation && (thread + k).is_multiple_of(2)));
            });
        }
    });
    eprintln!("{} devices", THREADS * DEVICES_OF_A_THREAD);
}

//! The devices that every test runs on.

use prbvh::device::cpu::CpuDevice;
use prbvh::device::vulkan::{self, DeviceSummary, VulkanDevice};
use prbvh::device::{Device, Selection};
use prbvh_cpu_sim::Order;
use std::cell::RefCell;
use std::sync::OnceLock;

/// Orders in which the CPU runs invocations; all must give the same bytes.
pub const ORDERS: [Order; 5] =
    [Order::Ascending, Order::Descending, Order::Shuffled(1), Order::Shuffled(2), Order::Parallel];

/// Every device by name: the CPU in every order, and every Vulkan device under the validation layer where that is installed.
///
/// # Panics
/// If there is no Vulkan device, unless `PRBVH_WITHOUT_VULKAN=1` says that it is meant so.
#[must_use]
pub fn devices() -> Vec<(String, Box<dyn Device>)> {
    let mut devices = cpu_devices();
    devices.extend(vulkan_devices());
    devices
}

/// Calls `run` with every device; a thread opens them once and uses them again.
///
/// # Panics
/// As [`devices`].
pub fn with_devices<T>(run: impl FnOnce(&mut [(String, Box<dyn Device>)]) -> T) -> T {
    thread_local! {
        static DEVICES: RefCell<Vec<(String, Box<dyn Device>)>> = const { RefCell::new(Vec::new()) };
    }
    DEVICES.with_borrow_mut(|opened| {
        if opened.is_empty() {
            *opened = devices();
        }
        run(opened)
    })
}

/// Every Vulkan device that the kernels can run on; none with `PRBVH_WITHOUT_VULKAN=1`.
///
/// # Panics
/// If there is none otherwise.
#[must_use]
pub fn vulkan_devices() -> Vec<(String, Box<dyn Device>)> {
    if without_vulkan() {
        return Vec::new();
    }
    let usable = match vulkan::list_devices() {
        Ok(devices) => devices.into_iter().filter(DeviceSummary::is_usable).collect::<Vec<_>>(),
        Err(error) => panic!("{error}\nTo test without Vulkan set PRBVH_WITHOUT_VULKAN=1."),
    };
    assert!(!usable.is_empty(), "no Vulkan device can run the kernels: see `prbvh devices`");
    let validate = validation_is_installed();
    let open = |device: DeviceSummary| {
        let opened = VulkanDevice::open(Selection::Index(device.index), validate)
            .unwrap_or_else(|error| panic!("{}: {error}", device.name));
        (device.name, Box::new(opened) as Box<dyn Device>)
    };
    usable.into_iter().map(open).collect()
}

/// Whether the machine is to be tested without Vulkan (`PRBVH_WITHOUT_VULKAN=1`); says then what is not run.
#[must_use]
pub fn without_vulkan() -> bool {
    let without = std::env::var_os("PRBVH_WITHOUT_VULKAN").is_some_and(|value| value == "1");
    if without {
        let test = std::thread::current().name().unwrap_or("a test").to_owned();
        eprintln!("not run on Vulkan (PRBVH_WITHOUT_VULKAN=1): {test}");
    }
    without
}

/// Whether the validation layer is there; asked once.
#[must_use]
pub fn validation_is_installed() -> bool {
    static INSTALLED: OnceLock<bool> = OnceLock::new();
    *INSTALLED.get_or_init(|| match VulkanDevice::open(Selection::Automatic, true) {
        Ok(_) => true,
        Err(error) => {
            eprintln!("without validation: {error}");
            false
        }
    })
}

/// The CPU in every order.
///
/// # Panics
/// If threads cannot be started.
#[must_use]
pub fn cpu_devices() -> Vec<(String, Box<dyn Device>)> {
    let device = |order| CpuDevice::with_order(order, 3).expect("three threads");
    ORDERS.map(|order| (format!("CPU {order:?}"), Box::new(device(order)) as Box<dyn Device>)).into()
}

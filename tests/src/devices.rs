//! The devices that every test runs on.

use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh_cpu_sim::Order;

/// Orders in which the CPU runs invocations; all must give the same bytes.
pub const ORDERS: [Order; 5] =
    [Order::Ascending, Order::Descending, Order::Shuffled(1), Order::Shuffled(2), Order::Parallel];

/// Every device by name: the CPU in every order.
#[must_use]
pub fn devices() -> Vec<(String, Box<dyn Device>)> {
    cpu_devices()
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

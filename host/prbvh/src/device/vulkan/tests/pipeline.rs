//! From triangles to the optimised tree: the bits of the CPU device, with either kind of locks.

use super::{left_out, open, options, random};
use crate::build::{MortonBits, lbvh};
use crate::device::vulkan::{Access, Options};
use crate::device::{Device, Watched, cpu::CpuDevice};
use crate::optimize::{Limits, PrbvhSettings, Strategy, prbvh};
use prbvh_kernel::Kernel;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use std::ops::ControlFlow;
use std::time::Duration;

/// Small triangles all over a cube.
fn soup(count: usize) -> Vec<Triangle> {
    let mut random = random(3);
    let mut point = |size: f32| [(); 3].map(|()| random() as f32 / u32::MAX as f32 * size);
    (0..count)
        .map(|_| {
            let (a, u, v) = (point(100.0), point(2.0), point(2.0));
            let offset = |by: [f32; 3]| [a[0] + by[0], a[1] + by[1], a[2] + by[2]];
            Triangle { a, b: offset(u), c: offset(v) }
        })
        .collect()
}

/// The trees before the iterations, after each of them, and the best.
fn trees(device: &mut dyn Device, triangles: &[Triangle], bits: MortonBits, strategy: Strategy) -> Vec<Vec<Node>> {
    let (tree, _) = lbvh(device, triangles, bits).unwrap();
    let (limits, news) = (Limits::iterations(12), Duration::ZERO);
    let settings = PrbvhSettings { strategy, limits, news, ..PrbvhSettings::default() };
    let mut trees = Vec::new();
    let outcome = prbvh(device, &tree, &settings, &mut |_, tree, device| {
        trees.push(tree.download(device).unwrap());
        ControlFlow::Continue(())
    });
    assert!(outcome.unwrap().rows.iter().skip(1).any(|row| row.applied > 0), "nothing moved");
    trees.push(tree.download(device).unwrap());
    tree.free(device);
    assert_eq!(device.memory().bytes, 0, "buffers left over");
    trees
}

#[test]
fn a_pipeline_is_made_when_its_kernel_is_first_run() {
    if left_out("a_pipeline_is_made_when_its_kernel_is_first_run") {
        return;
    }
    let mut device = open(options(Access::WherePossible));
    assert!(device.runner.pipelines().made().is_empty());
    let mut watched = Watched::new(&mut device);
    let (tree, _) = lbvh(&mut watched, soup(300), MortonBits::Thirty).unwrap();
    tree.free(&mut watched);
    let ran = watched.kernels();
    assert!(!ran.is_empty() && ran.len() < Kernel::ALL.len());
    assert_eq!(device.runner.pipelines().made(), ran);
    device.close().unwrap();
}

#[test]
fn every_iteration_has_the_bits_of_the_cpu_device() {
    if left_out("every_iteration_has_the_bits_of_the_cpu_device") {
        return;
    }
    let triangles = soup(20_000);
    let cases = [
        (MortonBits::Thirty, Strategy::Aggressive),
        (MortonBits::Sixty, Strategy::Aggressive),
        (MortonBits::Sixty, Strategy::Conservative),
    ];
    for (bits, strategy) in cases {
        let native = trees(&mut CpuDevice::new(2).unwrap(), &triangles, bits, strategy);
        for (atomics_64, access) in [(true, Access::WherePossible), (false, Access::Never)] {
            // The second one lacks all that a device may lack.
            let mut device = open(Options { atomics_64, timestamps: atomics_64, ..options(access) });
            let vulkan = trees(&mut device, &triangles, bits, strategy);
            device.close().unwrap();
            assert_eq!(vulkan.len(), native.len());
            let same =
                |k: &usize| bytemuck::cast_slice::<_, u8>(&vulkan[*k]) == bytemuck::cast_slice::<_, u8>(&native[*k]);
            let first = (0..native.len()).find(|k| !same(k));
            assert_eq!(
                first, None,
                "the first tree that differs; {bits:?}, {strategy:?}, 64-bit atomics: {atomics_64}"
            );
        }
    }
}

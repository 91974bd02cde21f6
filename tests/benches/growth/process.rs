//! Peak memory of a whole run, in a process of its own: what earlier runs left behind does not count.

use crate::Builder;
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene;
use prbvh_tests::bench::peak;
use std::ops::ControlFlow;
use std::process::Command;

/// What the child does: one run, and its peak on stdout.
pub(crate) fn child(exponent: u32, settings: &Settings) {
    let scene = scene::built_in(1 << exponent);
    peak::forget();
    let mut device = CpuDevice::new(0).unwrap_or_else(|error| panic!("{error}"));
    optimize(&scene, &mut device, settings, &mut |_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"));
    println!("{}", peak::bytes().map_or_else(|| "unknown".to_owned(), |bytes| bytes.to_string()));
}

/// Most bytes of a process that optimises the built-in scene of 2^`exponent` triangles: program, triangles, device, validation and the tree
/// handed out. None where the system does not tell.
pub(crate) fn peak_bytes(exponent: u32, builder: Builder) -> Option<u64> {
    let program = std::env::current_exe().expect("a program has a path");
    let mut command = Command::new(program);
    command.args(["--peak-of", &exponent.to_string(), "--initial", builder.name()]);
    let output = command.output().unwrap_or_else(|error| panic!("{error}"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).trim().parse().ok()
}

//! Where and with what a benchmark ran.

use prbvh_lab::report::{Machine, Program};

/// Program, commit, processor, cores, memory, system: one line.
#[must_use]
pub fn line() -> String {
    let Machine { cpu, cores, memory_bytes, os } = Machine::current();
    let Program { version, commit, .. } = Program::current();
    let warning = if cfg!(debug_assertions) { "NOT AN OPTIMISED BUILD, times mean nothing: " } else { "" };
    format!("{warning}prbvh {version} ({commit}), {cpu}, {cores} cores, {} GiB, {os}", memory_bytes >> 30)
}

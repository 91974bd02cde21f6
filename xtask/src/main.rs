//! `cargo xtask`: the project's own tasks, one file each.

mod bench;
mod choices;
mod ci;
mod circles;
mod fuzz;
mod miri;
mod numerics;
mod repo;
mod setup;
mod shaders;
mod test;
mod tidy;
mod vendored;
mod vulkan;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", about = "The project's own tasks", version)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Compiles the kernels to SPIR-V: writes kernel/spv, or with --check compares.
    BuildShaders(shaders::BuildShaders),
    #[command(hide = true)]
    CompileKernels(shaders::compile::CompileKernels),
    /// Looks for a Vulkan driver, the validation layer and a browser, and installs what is missing where it may.
    Setup,
    /// Does what setup does, then runs all tests.
    Test(test::Test),
    /// Measures time, memory and cost beside a peer, and checks the answers.
    #[command(disable_help_flag = true)]
    Bench(bench::Bench),
    /// Lowers the reference costs by what compare.json and report.json files say.
    Bless(choices::Bless),
    /// Repeats the choice of the presets on compare.json files, and says whether the code has the same.
    Presets(choices::Presets),
    /// Fuzzes loaders, tree files and scenes for minutes; the tests do so for seconds.
    Fuzz(fuzz::Fuzz),
    /// Runs the kernels on the smallest scene under Miri, which must be installed.
    Miri(miri::Miri),
    /// Makes the numbers of docs/numerics.md by their experiments, or with --check compares.
    Numerics(numerics::Numerics),
    /// Everything that must pass before a merge.
    Ci,
    /// Checks the rules of the house that no other tool knows.
    Tidy,
}

fn main() -> ExitCode {
    let result = match Cli::parse().task {
        Task::BuildShaders(task) => task.run().map(|()| ExitCode::SUCCESS),
        Task::CompileKernels(task) => task.run().map(|()| ExitCode::SUCCESS),
        Task::Setup => setup::run().map(|()| ExitCode::SUCCESS),
        Task::Test(task) => task.run(),
        Task::Bench(task) => task.run().map(|()| ExitCode::SUCCESS),
        Task::Bless(task) => task.run(),
        Task::Presets(task) => task.run(),
        Task::Fuzz(task) => task.run().map(|()| ExitCode::SUCCESS),
        Task::Miri(task) => task.run().map(|()| ExitCode::SUCCESS),
        Task::Numerics(task) => task.run(),
        Task::Ci => ci::run().map(|()| ExitCode::SUCCESS),
        Task::Tidy => tidy::run().map(|()| ExitCode::SUCCESS),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}

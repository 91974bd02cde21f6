//! The `prbvh` command with peers that fail.

#[path = "../../../host/lab/src/cli/mod.rs"]
mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    prbvh_lab::compare::peers::add(prbvh_tests::planted_peers::PLANTED);
    cli::main()
}

//! `cargo xtask test`: all tests, with a Vulkan driver to run them on.

use crate::{repo, setup};
use anyhow::{Context, Result};
use clap::Args;
use std::process::{ExitCode, Stdio};

/// Set to 1: do without Vulkan. The tests that need it say that they did not run.
pub(crate) const WITHOUT_VULKAN: &str = "PRBVH_WITHOUT_VULKAN";

#[derive(Args)]
pub(crate) struct Test {
    /// For `cargo test`.
    #[arg(allow_hyphen_values = true)]
    cargo: Vec<String>,
    /// For the test programs.
    #[arg(last = true)]
    harness: Vec<String>,
}

impl Test {
    /// Returns the exit code of the tests.
    ///
    /// # Errors
    /// If cargo cannot be started.
    pub(crate) fn run(self) -> Result<ExitCode> {
        if std::env::var_os(WITHOUT_VULKAN).is_some_and(|value| value == "1") {
            println!("{WITHOUT_VULKAN}=1: no Vulkan driver is looked for, and tests that need one do not run");
        } else if let Err(error) = setup::run() {
            // The tests that need no driver are still worth running; the others fail and say why.
            eprintln!("warning: {error:#} (or set {WITHOUT_VULKAN}=1 to do without)");
        }
        // The dev profile: it is optimised (see Cargo.toml), and clippy and tests share the dependencies built for it.
        let mut cargo = repo::cargo()?;
        cargo.args(["test", "--workspace"]).args(self.cargo);
        if !self.harness.is_empty() {
            cargo.arg("--").args(self.harness);
        }
        let status = cargo.stdin(Stdio::null()).status().context("cannot start cargo")?;
        Ok(ExitCode::from(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)))
    }
}

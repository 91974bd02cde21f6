//! `cargo xtask test`: all tests, with what they need beside Rust.

use crate::{repo, setup};
use anyhow::{Context, Result};
use clap::Args;
use std::process::{ExitCode, Stdio};

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
        if let Err(error) = setup::run() {
            // The tests that need none of it are still worth running; the others fail and say why.
            eprintln!("warning: {error:#}");
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

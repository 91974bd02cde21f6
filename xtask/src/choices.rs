//! `cargo xtask bless FILE…` and `cargo xtask presets COMPARE.json…`.
//!
//! Both need the library, which the tasks do not link: shaders must be buildable where it is not.

use crate::repo;
use anyhow::{Context, Result};
use clap::Args;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};

const REFERENCE: &str = "host/lab/src/reference/best-costs.json";

#[derive(Args)]
pub(crate) struct Bless {
    /// compare.json and report.json files.
    #[arg(required = true)]
    files: Vec<PathBuf>,
}

#[derive(Args)]
pub(crate) struct Presets {
    /// compare.json files of `prbvh compare SCENE… --methods candidates --out DIR`.
    #[arg(required = true)]
    files: Vec<PathBuf>,
}

impl Bless {
    /// # Errors
    /// If cargo cannot be started.
    pub(crate) fn run(self) -> Result<ExitCode> {
        start("bless", &self.files)
    }
}

impl Presets {
    /// Fails where the code has other presets.
    ///
    /// # Errors
    /// If cargo cannot be started.
    pub(crate) fn run(self) -> Result<ExitCode> {
        start("presets", &self.files)
    }
}

fn start(task: &str, files: &[PathBuf]) -> Result<ExitCode> {
    let mut cargo = cargo_run("prbvh-choices")?;
    cargo.args([task, "--reference"]).arg(repo::root()?.join(REFERENCE));
    finish(cargo, files)
}

/// Cargo about to run a program of the tests, whose arguments come next.
pub(crate) fn cargo_run(program: &str) -> Result<Command> {
    let mut cargo = repo::cargo()?;
    cargo.args(["run", "--quiet", "--package", "prbvh-tests", "--bin", program, "--"]);
    Ok(cargo)
}

/// Runs it with files at the end of its arguments.
pub(crate) fn finish(mut cargo: Command, files: &[PathBuf]) -> Result<ExitCode> {
    for file in files {
        // Cargo runs it in the top folder of the project; the paths are of where the user is.
        cargo.arg(std::path::absolute(file).with_context(|| format!("the path of {}", file.display()))?);
    }
    let status = cargo.stdin(Stdio::null()).status().context("cannot start cargo")?;
    Ok(ExitCode::from(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)))
}

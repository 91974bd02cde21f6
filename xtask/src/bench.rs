//! `cargo xtask bench`: time, memory and cost, beside a peer; see tests/benches.

use crate::repo;
use anyhow::{Result, ensure};
use clap::Args;

#[derive(Args)]
pub(crate) struct Bench {
    /// For the benchmark: `--help` lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl Bench {
    /// # Errors
    /// If the benchmark cannot be built, or an answer that it checks is wrong.
    pub(crate) fn run(self) -> Result<()> {
        let mut cargo = repo::cargo()?;
        cargo.args(["bench", "--package", "prbvh-tests", "--bench", "spine", "--"]).args(self.arguments);
        ensure!(cargo.status()?.success(), "the benchmark failed");
        Ok(())
    }
}

//! `cargo xtask bench [--parts | --plan]`: see tests/benches.

use crate::repo;
use anyhow::{Result, ensure};
use clap::Args;

#[derive(Args)]
pub(crate) struct Bench {
    /// Each builder alone, the collapse and tracing, instead of the way from triangles to the best tree beside a peer.
    #[arg(long)]
    parts: bool,
    /// What plans leave out: every omission with and without it in turn.
    #[arg(long, conflicts_with = "parts")]
    plan: bool,
    /// For the benchmark: `--help` lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl Bench {
    /// # Errors
    /// If the benchmark cannot be built, or an answer that it checks is wrong.
    pub(crate) fn run(self) -> Result<()> {
        let mut cargo = repo::cargo()?;
        let bench = match (self.parts, self.plan) {
            (true, _) => "parts",
            (_, true) => "plan",
            _ => "spine",
        };
        cargo.args(["bench", "--package", "prbvh-tests", "--bench", bench, "--"]).args(self.arguments);
        ensure!(cargo.status()?.success(), "the benchmark failed");
        Ok(())
    }
}

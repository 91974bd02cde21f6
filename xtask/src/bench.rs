//! `cargo xtask bench [--parts | --plan | --peers | --growth | --dynamic | --wide]`: see tests/benches.

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
    /// Anytime curves, cost against wall time, beside a peer with many settings.
    #[arg(long, conflicts_with_all = ["parts", "plan"])]
    peers: bool,
    /// Scaling with threads, growth of time and memory with triangles, and what limits the search.
    #[arg(long, conflicts_with_all = ["parts", "plan", "peers"])]
    growth: bool,
    /// A scene in motion: a tree that is refitted and made better in each frame, beside a peer.
    #[arg(long, conflicts_with_all = ["parts", "plan", "peers", "growth"])]
    dynamic: bool,
    /// Rays through binary, wide and compressed trees, beside a peer; with `-- --costs` no times.
    #[arg(long, conflicts_with_all = ["parts", "plan", "peers", "growth", "dynamic"])]
    wide: bool,
    /// For the benchmark: `--help` lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl Bench {
    /// # Errors
    /// If the benchmark cannot be built, or an answer that it checks is wrong.
    pub(crate) fn run(self) -> Result<()> {
        let mut cargo = repo::cargo()?;
        let chosen = [
            (self.parts, "parts"),
            (self.plan, "plan"),
            (self.peers, "peers"),
            (self.growth, "growth"),
            (self.dynamic, "dynamic"),
            (self.wide, "wide"),
        ];
        let bench = chosen.into_iter().find(|(is_chosen, _)| *is_chosen).map_or("spine", |(_, bench)| bench);
        cargo.args(["bench", "--package", "prbvh-tests", "--bench", bench, "--"]).args(self.arguments);
        ensure!(cargo.status()?.success(), "the benchmark failed");
        Ok(())
    }
}

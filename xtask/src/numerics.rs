//! `cargo xtask numerics [--check] [SCENE…]`: the experiments behind docs/numerics.md.

use crate::{choices, repo};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

const DOCUMENT: &str = "docs/numerics.md";

#[derive(Args)]
pub(crate) struct Numerics {
    /// Compare with the document instead of writing it.
    #[arg(long)]
    check: bool,
    /// Scenes of the table of scenes; without any it stays as it is.
    scenes: Vec<PathBuf>,
}

impl Numerics {
    /// Fails where the document has other numbers.
    ///
    /// # Errors
    /// If cargo cannot be started.
    pub(crate) fn run(self) -> Result<ExitCode> {
        let mut cargo = choices::cargo_run("prbvh-numerics")?;
        cargo.arg("--document").arg(repo::root()?.join(DOCUMENT));
        if self.check {
            cargo.arg("--check");
        }
        choices::finish(cargo, &self.scenes)
    }
}

//! `cargo xtask fuzz`: what the tests fuzz for seconds, for minutes and with other seeds.

use crate::repo;
use anyhow::{Result, ensure};
use clap::Args;

#[derive(Args)]
pub(crate) struct Fuzz {
    /// Minutes for each target; they run side by side, but read one file at a time.
    #[arg(long, default_value_t = 5.0)]
    minutes: f64,
    /// The first seed; a run that failed names its own.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Names of targets, as the tests of host/lab/tests/fuzz have them; all if there are none.
    targets: Vec<String>,
}

impl Fuzz {
    /// # Errors
    /// If the targets cannot be built, or one of them fails.
    pub(crate) fn run(self) -> Result<()> {
        let mut cargo = repo::cargo()?;
        cargo.args(["test", "--release", "--package", "prbvh-lab", "--test", "fuzz", "--", "--nocapture"]);
        if !self.targets.is_empty() {
            cargo.arg("--exact").args(&self.targets);
        }
        cargo.env("PRBVH_FUZZ_MINUTES", self.minutes.to_string()).env("PRBVH_FUZZ_SEED", self.seed.to_string());
        ensure!(cargo.status()?.success(), "a target failed: its input is named above; it belongs in tests/corpus");
        Ok(())
    }
}

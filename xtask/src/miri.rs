//! `cargo xtask miri`: the kernels and cpu-sim on the smallest scene, interpreted by Miri, which finds undefined behaviour and data races.

use crate::repo;
use anyhow::{Result, bail, ensure};
use clap::Args;
use std::process::{Command, Stdio};

/// Leaks, borrows and provenance are those of crossbeam under rayon, which Miri's strictest rules refuse; ours are checked by these all the same.
/// The clock is the system's, because the devices keep the time.
const FLAGS: &str = "-Zmiri-tree-borrows -Zmiri-permissive-provenance -Zmiri-ignore-leaks -Zmiri-disable-isolation";

const INSTALL: &str = "rustup toolchain install nightly --profile minimal --component miri,rust-src";

#[derive(Args)]
pub(crate) struct Miri {
    /// Toolchain that has Miri.
    #[arg(long, default_value = "nightly")]
    toolchain: String,
}

impl Miri {
    /// # Errors
    /// If there is no Miri, or it finds fault.
    pub(crate) fn run(self) -> Result<()> {
        self.check_installed()?;
        // Without LLVM behind it Miri shares no build with others.
        let target = repo::root()?.join("target").join("miri");
        for tests in [
            &["--package", "prbvh-kernel", "--package", "prbvh-cpu-sim"][..],
            &["--package", "prbvh-lab", "--test", "smallest_scene", "--", "--nocapture"],
        ] {
            let mut cargo = self.cargo();
            cargo.args(["miri", "test", "--target-dir"]).arg(&target).args(tests).env("MIRIFLAGS", FLAGS);
            ensure!(
                cargo.current_dir(repo::root()?).status()?.success(),
                "Miri found fault, or could not run the tests"
            );
        }
        Ok(())
    }

    /// rustup's own cargo, which takes the name of a toolchain; the one that runs this task does not.
    fn cargo(&self) -> Command {
        let mut cargo = Command::new("rustup");
        cargo.args(["run", &self.toolchain, "cargo"]);
        // Those of the cargo that runs this task.
        for variable in ["CARGO", "RUSTC", "RUSTDOC", "RUSTUP_TOOLCHAIN", "RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS"] {
            cargo.env_remove(variable);
        }
        cargo.stdin(Stdio::null());
        cargo
    }

    fn check_installed(&self) -> Result<()> {
        let mut version = self.cargo();
        version.args(["miri", "--version"]);
        match repo::output(&mut version) {
            Ok(Some(version)) => {
                println!("{}", version.trim());
                Ok(())
            }
            _ => bail!(
                "no Miri in toolchain `{}`: {INSTALL} (any recent nightly will do; --toolchain names another)",
                self.toolchain
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_toolchain_without_miri_is_refused_with_the_way_to_get_one() {
        let error = Miri { toolchain: "none-of-that-name".to_owned() }.run().unwrap_err().to_string();
        for part in ["none-of-that-name", "rustup toolchain install nightly", "miri,rust-src", "--toolchain"] {
            assert!(error.contains(part), "{error}");
        }
    }
}

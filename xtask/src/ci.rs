//! `cargo xtask ci`: everything that must pass before a merge, all of it even if something fails.

use crate::repo;
use anyhow::{Result, bail};
use std::process::Command;
use std::time::Instant;

/// # Errors
/// Names the steps that failed.
pub(crate) fn run() -> Result<()> {
    let mut failed = Vec::new();
    for (name, command) in steps()? {
        println!("\n=== {name}");
        let start = Instant::now();
        if let Err(error) = repo::run(&mut { command }) {
            eprintln!("error: {error:#}");
            failed.push(name);
        }
        println!("=== {name}: {:.0} s", start.elapsed().as_secs_f64());
    }
    if !failed.is_empty() {
        bail!("failed: {}", failed.join(", "));
    }
    Ok(())
}

/// The steps are the commands that a developer types, no others.
fn steps() -> Result<Vec<(&'static str, Command)>> {
    let cargo = |line: &str| -> Result<Command> {
        let mut cargo = repo::cargo()?;
        cargo.args(line.split(' '));
        Ok(cargo)
    };
    let mut doc = cargo("doc --workspace --no-deps")?;
    // Only here: a flag for all of them would reach the shader compiler.
    doc.env("RUSTDOCFLAGS", "-D warnings");
    Ok(vec![
        ("tidy", cargo("xtask tidy")?),
        ("fmt", cargo("fmt --all --check")?),
        ("clippy", cargo("clippy --workspace --all-targets -- -D warnings")?),
        // Each by itself: together they would have the features of both.
        ("clippy, the library as it comes", cargo("clippy -p prbvh --all-targets -- -D warnings")?),
        ("clippy, without features", cargo("clippy -p prbvh --no-default-features --all-targets -- -D warnings")?),
        (
            "clippy, the laboratory without features",
            cargo("clippy -p prbvh-lab --no-default-features --all-targets -- -D warnings")?,
        ),
        ("build-shaders", cargo("xtask build-shaders --check")?),
        ("test", cargo("xtask test")?),
        ("numerics", cargo("xtask numerics --check")?),
        ("doc", doc),
        (
            "packages",
            cargo(
                "package --workspace --exclude prbvh-tests --exclude prbvh-python --exclude xtask --no-verify --allow-dirty --quiet",
            )?,
        ),
    ])
}

//! Where the project is, and how to run programs in it.

use anyhow::{Context, Result, bail};
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Top folder of the project.
pub(crate) fn root() -> Result<PathBuf> {
    // Cargo sets it when it runs the task; a binary that is started by hand falls back to where it was built.
    let manifest = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    let mut root = PathBuf::from(manifest);
    root.pop();
    if !root.join("kernel/Cargo.toml").is_file() {
        bail!("{} is not the top folder of the project: start the task as `cargo xtask`", root.display());
    }
    Ok(root)
}

/// The cargo that runs the task, in the top folder.
pub(crate) fn cargo() -> Result<Command> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo")));
    cargo.current_dir(root()?);
    Ok(cargo)
}

/// Runs a program that must succeed, its output passed through.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let shown = show(command);
    let status = command.stdin(Stdio::null()).status().with_context(|| format!("cannot start `{shown}`"))?;
    if !status.success() {
        bail!("`{shown}` failed ({status})");
    }
    Ok(())
}

/// What a program that must succeed printed to stdout. `None` if there is no such program.
pub(crate) fn output(command: &mut Command) -> Result<Option<String>> {
    let shown = show(command);
    let text = both(command)?.map(|(stdout, _)| String::from_utf8(stdout)).transpose();
    text.with_context(|| format!("output of `{shown}`"))
}

/// What a program that must succeed printed to stdout and stderr, in that order. `None` if there is no such program.
pub(crate) fn both(command: &mut Command) -> Result<Option<(Vec<u8>, Vec<u8>)>> {
    let shown = show(command);
    let output = match command.stdin(Stdio::null()).output() {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        other => other.with_context(|| format!("cannot start `{shown}`"))?,
    };
    if !output.status.success() {
        // spirv-val complains to stdout.
        let printed = [output.stderr, output.stdout].concat();
        bail!("`{shown}` failed ({}): {}", output.status, String::from_utf8_lossy(&printed).trim());
    }
    Ok(Some((output.stdout, output.stderr)))
}

fn show(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}
